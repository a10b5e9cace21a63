"""Fakes of TE MS5611-01BA03, MS5607-02BA03, MS5805-02BA01: PROM, conversion times, inverse of the compensation.

The parts have the same commands and different scale factors (MS5611 datasheet p. 7-11; MS5805 datasheet p. 6-9):

- The MS5611 has eight PROM words, with the CRC in the last four bits of word 7. The MS5805 has seven, with the CRC in
  the first four bits of word 0.
- Second-order terms of the MS5805: below 20 degC T2 = 11 dT^2/2^35, OFF2 = 31 (TEMP-2000)^2/2^3,
  SENS2 = 63 (TEMP-2000)^2/2^5, and no further term below -15 degC.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np

from flightpower.hw_fakes.i2c import no_acknowledge
from flightpower.hw_fakes.sample_blocks import SampleBlocks
from flightpower.sim.sensor_truth import SensorTruth

RESET, READ_ADC, CONVERT_D1, CONVERT_D2, READ_PROM = 0x1E, 0x00, 0x40, 0x50, 0xA0
RELOAD_NS = 2_800_000  # time to load the PROM into the registers after a reset (MS5611 datasheet fig. 2)
# Typical and longest conversion time [ns] by oversampling code 0, 2, 4 … (MS5611 datasheet p. 3).
CONVERSION_NS = {
    0x0: (540_000, 600_000),
    0x2: (1_060_000, 1_170_000),
    0x4: (2_080_000, 2_280_000),
    0x6: (4_130_000, 4_540_000),
    0x8: (8_220_000, 9_040_000),
    0xA: (16_440_000, 18_080_000),
}
FULL_COUNT = 2**24 - 1
PRESSURE_GRID_S = 1e-3
TEMPERATURE_GRID_S = 0.1  # step of temperature, which changes slowly


@dataclass(frozen=True)
class SecondOrder:
    """One branch of the compensation: T2 = t2 dT^2, OFF2 = off (TEMP - 2000)^2, SENS2 = sens (TEMP - 2000)^2."""

    t2: float
    off: float
    sens: float


@dataclass(frozen=True)
class MS56xxType:
    """The differences between the members of the family."""

    typical: tuple[int, ...]  # C1 … C6 of the datasheet's example
    prom_words: int
    crc_in_word: int
    crc_shift: int
    off_shift: int  # OFF = C2 2^off_shift + C4 dT / 2^(23 - off_shift)
    sens_shift: int  # SENS = C1 2^sens_shift + C3 dT / 2^(23 - sens_shift)
    cold: SecondOrder
    colder_off: float  # factor of (TEMP + 1500)^2 below -15 degC
    colder_sens: float
    oversampling: tuple[int, ...]


MS5611 = MS56xxType(
    typical=(40127, 36924, 23317, 23282, 33464, 28312),
    prom_words=8,
    crc_in_word=7,
    crc_shift=0,
    off_shift=16,
    sens_shift=15,
    cold=SecondOrder(t2=2**-31, off=5 / 2, sens=5 / 4),
    colder_off=7.0,
    colder_sens=11 / 2,
    oversampling=(0x0, 0x2, 0x4, 0x6, 0x8),
)
# Sold on boards meant for an MS5611 (MS5607-02BA03 datasheet p. 8 and 9): other scale factors, same memory.
MS5607 = MS56xxType(
    typical=(46372, 43981, 29059, 27842, 31553, 28165),
    prom_words=8,
    crc_in_word=7,
    crc_shift=0,
    off_shift=17,
    sens_shift=16,
    cold=SecondOrder(t2=2**-31, off=61 / 16, sens=2.0),
    colder_off=15.0,
    colder_sens=8.0,
    oversampling=(0x0, 0x2, 0x4, 0x6, 0x8),
)
MS5805 = MS56xxType(
    typical=(46546, 42845, 29751, 29457, 32745, 29059),
    prom_words=7,
    crc_in_word=0,
    crc_shift=12,
    off_shift=17,
    sens_shift=16,
    cold=SecondOrder(t2=11 * 2**-35, off=31 / 8, sens=63 / 32),
    colder_off=0.0,
    colder_sens=0.0,
    oversampling=(0x0, 0x2, 0x4, 0x6, 0x8, 0xA),
)


def crc4(words: list[int]) -> int:
    """CRC-4 over the words' bytes (AN520 p. 5); the CRC's own bits must be zero in `words`."""
    remainder = 0
    for word in words:
        for byte in (word >> 8, word & 0xFF):
            remainder ^= byte
            for _ in range(8):
                remainder = (remainder << 1) ^ (0x3000 if remainder & 0x8000 else 0)
                remainder &= 0xFFFF
    return remainder >> 12


def draw_prom(part: MS56xxType, seed: int) -> list[int]:
    """Draw PROM words with coefficients scattered by 3 % (1 sigma) about the typical ones, and a matching CRC."""
    draw = np.random.default_rng(seed)
    words = [0] * 8
    words[0] = int(draw.integers(1, 0x1000))
    words[1:7] = [int(c * (1 + 0.03 * np.clip(draw.standard_normal(), -3, 3))) for c in part.typical]
    if part.prom_words == 8:
        words[7] = int(draw.integers(0, 0x100)) << 8  # serial code; AN520 leaves the low byte out of the checksum
    words[part.crc_in_word] |= crc4(words) << part.crc_shift
    return words[: part.prom_words]


def temperature_counts(part: MS56xxType, prom: list[int], temperature_K: float) -> int:
    """D2 at which the compensation gives `temperature_K`, to the nearest count."""
    c5, c6 = prom[5], prom[6]
    centi_degC = 100 * (temperature_K - 273.15)
    slope = c6 / 2**23
    dT = (centi_degC - 2000) / slope
    if centi_degC < 2000:  # solve 2000 + slope dT - t2 dT^2 = wanted for the root near the first-order root
        t2 = part.cold.t2
        dT = (slope - sqrt(slope**2 - 4 * t2 * (centi_degC - 2000))) / (2 * t2)
    return _clip(round(dT + c5 * 2**8))


def pressure_counts(part: MS56xxType, prom: list[int], pressure_Pa: float, d2: int) -> int:
    """D1 at which the compensation with temperature counts `d2` gives `pressure_Pa`, to the nearest count."""
    c1, c2, c3, c4, c5, c6 = prom[1:7]
    dT = d2 - c5 * 2**8
    centi_degC = 2000 + dT * c6 / 2**23
    offset = c2 * 2**part.off_shift + c4 * dT / 2 ** (23 - part.off_shift)
    sensitivity = c1 * 2**part.sens_shift + c3 * dT / 2 ** (23 - part.sens_shift)
    if centi_degC < 2000:
        offset -= part.cold.off * (centi_degC - 2000) ** 2
        sensitivity -= part.cold.sens * (centi_degC - 2000) ** 2
    if centi_degC < -1500:
        offset -= part.colder_off * (centi_degC + 1500) ** 2
        sensitivity -= part.colder_sens * (centi_degC + 1500) ** 2
    return _clip(round((pressure_Pa * 2**15 + offset) * 2**21 / sensitivity))


def _clip(counts: int) -> int:
    return min(max(counts, 0), FULL_COUNT)


class FakeMS56xx:
    """A barometer of the family.

    which: its name in `sim.sensor_truth.SensorTruth` ("baro", "static"). now_ns: gives the time since the start of
    `sensor_truth` [ns]. seed: draws the coefficients and the conversion time, between typical and worst case.
    powered_ns: when its supply came on, on that clock.

    A conversion gives the pressure at the middle of its duration; the part does not average.
    """

    def __init__(
        self,
        part: MS56xxType,
        which: str,
        sensor_truth: SensorTruth,
        now_ns: Callable[[], int],
        *,
        seed: int,
        powered_ns: int = 0,
    ):
        self.part = part
        self._now_ns = now_ns
        self.prom = draw_prom(part, seed)
        self._slowness = np.random.default_rng(seed + 1).uniform()
        self._pressure = SampleBlocks(
            lambda t_s: sensor_truth.absolute_pressure_Pa(which, t_s), PRESSURE_GRID_S, length=1000
        )
        self._temperature = SampleBlocks(
            lambda t_s: sensor_truth.transducer_temperature_K(which, t_s), TEMPERATURE_GRID_S, length=64
        )
        self.power_cycle(powered_ns)

    def power_cycle(self, at_ns: int) -> None:
        """Switch the supply off and on."""
        self._ready_ns = at_ns + RELOAD_NS
        self._conversion: tuple[int, int, int] | None = None  # command, start, end
        self._spoilt = False
        self._reply = b""

    def write(self, data: bytes) -> None:
        now_ns = self._now_ns()
        if now_ns < self._ready_ns:
            raise no_acknowledge()
        if not data:
            return
        command = data[0]
        if command == RESET:
            self.power_cycle(now_ns)
        elif command == READ_ADC:
            self._reply = self._adc(now_ns).to_bytes(3, "big")
        elif command & 0xF0 == READ_PROM:
            index = (command & 0x0F) >> 1
            self._reply = (self.prom[index] if index < len(self.prom) else 0).to_bytes(2, "big")
        elif command & 0xF0 in (CONVERT_D1, CONVERT_D2) and command & 0x0F in self.part.oversampling:
            self._start(command, now_ns)

    def read(self, count: int) -> bytes:
        if self._now_ns() < self._ready_ns:
            raise no_acknowledge()
        reply, self._reply = self._reply[:count], b""
        return reply + bytes(count - len(reply))

    def write_read(self, data: bytes, count: int) -> bytes:
        self.write(data)
        return self.read(count)

    def _start(self, command: int, now_ns: int) -> None:
        """Start a conversion. If it starts during another, its result is wrong (MS5611 datasheet p. 11)."""
        self._spoilt = self._conversion is not None and now_ns < self._conversion[2]
        self._conversion = (command, now_ns, now_ns + self.conversion_ns(command & 0x0F))

    def conversion_ns(self, oversampling: int) -> int:
        """Conversion time of this part, by oversampling code."""
        typical_ns, worst_ns = CONVERSION_NS[oversampling]
        return round(typical_ns + self._slowness * (worst_ns - typical_ns))

    def _adc(self, now_ns: int) -> int:
        """The result, readable once; zero if there is none. Reading too early spoils it (MS5611 datasheet p. 11)."""
        if self._conversion is None:
            return 0
        command, start_ns, end_ns = self._conversion
        if now_ns < end_ns:
            self._spoilt = True
            return 0
        self._conversion = None
        counts = self._convert(command, (start_ns + end_ns) * 0.5e-9)
        return counts >> 1 if self._spoilt else counts

    def _convert(self, command: int, t_s: float) -> int:
        d2 = temperature_counts(self.part, self.prom, float(self._temperature.row(round(t_s / TEMPERATURE_GRID_S))))
        if command & 0xF0 == CONVERT_D2:
            return d2
        return pressure_counts(self.part, self.prom, float(self._pressure.row(round(t_s / PRESSURE_GRID_S))), d2)
