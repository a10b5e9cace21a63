"""Fakes of TI INA226 (SBOS547B) and INA228 (SLYS021A), power monitors that convert bus and shunt voltage in turn.

Sections are those of the datasheets' register maps. A register is two or three bytes, most significant first; writing
the pointer selects it until the next such write. Only the functions needed to read voltage and current are modeled: no
alerts, power or energy.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flightpower.flight.arrays import Array
from flightpower.sim.sensor_truth import SensorTruth

AVERAGES = (1, 4, 16, 64, 128, 256, 512, 1024)
CLOCK_TOLERANCE = 0.1  # of conversion times: from typical to maximum in "Electrical Characteristics"


@dataclass(frozen=True)
class Variant:
    """The registers and scales of a part."""

    reset_values: dict[int, int]  # values of all registers that exist
    three_bytes: frozenset[int]
    control: int
    reset_register: int
    flags: int
    shunt: int
    voltage: int
    bits: int
    spare_bits: int
    shunt_V: float  # a count
    bus_V: float  # a count
    conversion_s: tuple[float, ...]
    average_at: int  # position of AVG in the control word
    bus_time_at: int
    shunt_time_at: int
    ready: int


INA226 = Variant(
    reset_values={0: 0x4127, 1: 0, 2: 0, 3: 0, 4: 0, 5: 0, 6: 0, 7: 0, 0xFE: 0x5449, 0xFF: 0x2260},
    three_bytes=frozenset(),
    control=0,
    reset_register=0,
    flags=6,
    shunt=1,
    voltage=2,
    bits=16,
    spare_bits=0,
    shunt_V=2.5e-6,
    bus_V=1.25e-3,
    conversion_s=(140e-6, 204e-6, 332e-6, 588e-6, 1.1e-3, 2.116e-3, 4.156e-3, 8.244e-3),
    average_at=9,
    bus_time_at=6,
    shunt_time_at=3,
    ready=0x0008,
)
INA228 = Variant(
    reset_values={
        0: 0, 1: 0xFB68, 2: 0x1000, 3: 0, 4: 0, 5: 0, 6: 0, 7: 0, 8: 0, 0xB: 0x0001, 0x3E: 0x5449, 0x3F: 0x2281,
    },
    three_bytes=frozenset([4, 5, 7, 8]),
    control=1,
    reset_register=0,
    flags=0xB,
    shunt=4,
    voltage=5,
    bits=20,
    spare_bits=4,
    shunt_V=312.5e-9,
    bus_V=195.3125e-6,
    conversion_s=(50e-6, 84e-6, 150e-6, 280e-6, 540e-6, 1.052e-3, 2.074e-3, 4.12e-3),
    average_at=0,
    bus_time_at=9,
    shunt_time_at=6,
    ready=0x0002,
)  # fmt: skip
RESET = 0x8000
LATCHED = 0x8000  # ALATCH of the INA228's flags: the ready bit stays until it is read


class FakePowerMonitor:
    """The part with a shunt of `shunt_ohm` in the battery's negative or positive line. seed: draws its oscillator."""

    def __init__(
        self,
        variant: Variant,
        sensor_truth: SensorTruth,
        now_ns: Callable[[], int],
        seed: int,
        shunt_ohm: float = 0.0005,
        *,
        powered_ns: int = 0,
    ):
        self._variant, self._sensor_truth, self._now_ns = variant, sensor_truth, now_ns
        self._shunt_ohm = shunt_ohm
        self._slow = 1.0 + float(np.random.default_rng(seed).uniform(-CLOCK_TOLERANCE, CLOCK_TOLERANCE))
        self.power_cycle(powered_ns)

    def power_cycle(self, at_ns: int) -> None:
        self._registers = dict(self._variant.reset_values)
        self._pointer = 0
        self._begun_ns = at_ns
        self._seen_cycle = 0  # number of cycles when the ready bit was last read
        self._converted = -1  # number of the cycle whose result is in the registers

    def write(self, data: bytes) -> None:
        if not data:
            return
        self._pointer = data[0]
        if len(data) < 3 or self._pointer not in self._registers:
            return
        word = int.from_bytes(data[1:3], "big")
        if self._pointer == self._variant.reset_register and word & RESET:
            self.power_cycle(self._now_ns())
        elif self._pointer in (self._variant.control, self._variant.reset_register, self._variant.flags):
            self._registers[self._pointer] = word
            if self._pointer == self._variant.control:
                self._begun_ns, self._seen_cycle, self._converted = self._now_ns(), 0, -1

    def read(self, count: int) -> bytes:
        self._convert()
        size = 3 if self._pointer in self._variant.three_bytes else 2
        word = self._registers.get(self._pointer, 0)
        if self._pointer == self._variant.flags:
            word |= self._variant.ready * (self._cycles() > self._seen_cycle)
            if self._variant is INA226 or word & LATCHED:
                self._seen_cycle = self._cycles()
        return (word.to_bytes(size, "big") + bytes([0xFF]) * count)[:count]

    def write_read(self, data: bytes, count: int) -> bytes:
        self.write(data)
        return self.read(count)

    def _times(self) -> tuple[float, float, int]:
        """Conversion time of bus and shunt [s], and the number of averages."""
        variant, control = self._variant, self._registers[self._variant.control]
        bus_s = variant.conversion_s[control >> variant.bus_time_at & 7] * self._slow
        shunt_s = variant.conversion_s[control >> variant.shunt_time_at & 7] * self._slow
        return bus_s, shunt_s, AVERAGES[control >> variant.average_at & 7]

    def _cycles(self) -> int:
        """Number of complete averages since the conversions began."""
        bus_s, shunt_s, averages = self._times()
        return int((self._now_ns() - self._begun_ns) * 1e-9 / ((bus_s + shunt_s) * averages))

    def _convert(self) -> None:
        """Put the mean values of the latest complete cycle into the registers: shunt and bus in turn."""
        cycle = self._cycles() - 1
        if cycle < 0 or cycle == self._converted:
            return
        self._converted = cycle
        bus_s, shunt_s, averages = self._times()
        begin_s = self._begun_ns * 1e-9 + cycle * averages * (bus_s + shunt_s)
        pair_s: Array = begin_s + np.arange(averages, dtype=np.float64) * (bus_s + shunt_s)
        _, current_A = self._sensor_truth.battery(pair_s + shunt_s / 2)
        voltage_V, _ = self._sensor_truth.battery(pair_s + shunt_s + bus_s / 2)
        variant = self._variant
        self._store(variant.shunt, float(np.mean(current_A)) * self._shunt_ohm / variant.shunt_V)
        self._store(variant.voltage, max(0.0, float(np.mean(voltage_V)) / variant.bus_V))

    def _store(self, register: int, counts: float) -> None:
        half = 2 ** (self._variant.bits - 1)
        value = int(np.clip(round(counts), -half, half - 1))
        self._registers[register] = (value % (2 * half)) << self._variant.spare_bits
