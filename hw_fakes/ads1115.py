"""A fake TI ADS1115: single-shot conversions of four inputs with 16 bits (SBAS444D, sections in brackets)."""

from collections.abc import Callable

import numpy as np

CONVERSION, CONFIG, LOW, HIGH = range(4)  # [8.1]
RESET_VALUES = {CONVERSION: 0x0000, CONFIG: 0x8583, LOW: 0x8000, HIGH: 0x7FFF}
OS, SINGLE = 0x8000, 0x0100  # [8.1.3]
FULL_SCALE_V = (6.144, 4.096, 2.048, 1.024, 0.512, 0.256, 0.256, 0.256)
RATES_HZ = (8, 16, 32, 64, 128, 250, 475, 860)
PAIRS = ((0, 1), (0, 3), (1, 3), (2, 3))  # multiplexer codes 0 to 3; codes 4 to 7 measure AIN0 to AIN3 against ground
RATE_TOLERANCE = 0.1  # [7.5]
WAKE_UP_S = 25e-6  # [9.4.2.1]


class FakeADS1115:
    """The part. input_V: gives an input's voltage at times [s] since the start; seed: draws the oscillator's error.

    Continuous mode is not modeled: the result register then keeps its value.
    """

    def __init__(self, input_V: Callable[[int, float], float], now_ns: Callable[[], int], seed: int):
        self._input_V, self._now_ns = input_V, now_ns
        self._slow = 1.0 + np.random.default_rng(seed).uniform(-RATE_TOLERANCE, RATE_TOLERANCE)
        self.power_cycle(0)

    def power_cycle(self, at_ns: int) -> None:
        self._registers = dict(RESET_VALUES)
        self._pointer = CONVERSION
        self._ends_ns: int | None = None

    def write(self, data: bytes) -> None:
        if not data:
            return
        self._convert()
        self._pointer = data[0] & 3
        if len(data) < 3 or self._pointer == CONVERSION:
            return
        word = int.from_bytes(data[1:3], "big")
        if self._pointer != CONFIG:
            self._registers[self._pointer] = word
            return
        self._registers[CONFIG] = word & ~OS
        if word & OS and word & SINGLE and self._ends_ns is None:
            duration_s = WAKE_UP_S + self._slow / RATES_HZ[word >> 5 & 7]
            self._ends_ns = self._now_ns() + round(duration_s * 1e9)

    def read(self, count: int) -> bytes:
        self._convert()
        word = self._registers[self._pointer]
        if self._pointer == CONFIG and self._ends_ns is None:
            word |= OS
        return (word.to_bytes(2, "big") + bytes([0xFF]) * count)[:count]

    def write_read(self, data: bytes, count: int) -> bytes:
        self.write(data)
        return self.read(count)

    def _convert(self) -> None:
        """Finish a conversion if its time has passed."""
        if self._ends_ns is None or self._now_ns() < self._ends_ns:
            return
        config, at_s = self._registers[CONFIG], self._ends_ns * 1e-9
        code = config >> 12 & 7
        plus, minus = (code - 4, None) if code >= 4 else PAIRS[code]
        volts = self._input_V(plus, at_s) - (0.0 if minus is None else self._input_V(minus, at_s))
        counts = int(np.clip(round(volts / FULL_SCALE_V[config >> 9 & 7] * 2**15), -(2**15), 2**15 - 1))
        self._registers[CONVERSION] = counts % 2**16
        self._ends_ns = None
