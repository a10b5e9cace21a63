"""Driver of the power monitors TI INA226 (SBOS547B) and INA228 (SLYS021A): battery voltage, and current through a
shunt.

The part continuously averages over most of a tick. Current is computed here from the shunt's voltage, so the part's
calibration register is not used. Register numbers and bits: section "Register Maps" of each datasheet.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from flightpower.daq.bus import I2CBus
from flightpower.daq.sensors import Sample, SensorFailure, brown_out, wrong_device
from flightpower.flight.messages import Battery, Status

TI = 0x5449  # manufacturer's number
RESET_S = 0.001  # the datasheets give 0.3 ms at most
FREE_SHARE = 0.9  # fraction of a tick that conversions may take, so that each tick has a new value
STALE_LIMIT = 12  # more stale reads in a row than this mean that the part has stopped measuring
AVERAGES = (1, 4, 16, 64, 128, 256, 512, 1024)  # number of averages by code, in both parts


@dataclass(frozen=True)
class PowerMonitor:
    """The differences between the two parts: register numbers and sizes, counts, and conversion times by code."""

    name: str
    manufacturer_register: int
    identity_register: int
    identity: int  # identity without the revision in the lowest four bits
    reset_value: int  # value to write to register 0
    control_register: int  # register of averaging and conversion times
    flags_register: int
    flags_setup: int  # value to write to the flags at the start
    conversion_ready: int  # bit of the flags that shows a finished conversion
    voltage_register: int
    shunt_register: int
    value_bytes: int
    unused_bits: int  # number of unused bits below the value
    volts_per_count: float
    shunt_volts_per_count: float
    conversion_us: tuple[int, ...]
    continuous: int  # control word to convert voltage and shunt in turn, continuously
    average_at: int  # bit position in the control word
    conversion_at: tuple[int, ...]

    def control(self, conversion: int, average: int) -> int:
        """The control word with these codes."""
        return sum((conversion << shift for shift in self.conversion_at), self.continuous | average << self.average_at)


INA226 = PowerMonitor(
    name="INA226",
    manufacturer_register=0xFE,
    identity_register=0xFF,
    identity=0x2260,
    reset_value=0x8000,
    control_register=0x00,
    flags_register=0x06,
    flags_setup=0x0000,
    conversion_ready=0x0008,
    voltage_register=0x02,
    shunt_register=0x01,
    value_bytes=2,
    unused_bits=0,
    volts_per_count=1.25e-3,
    shunt_volts_per_count=2.5e-6,
    conversion_us=(140, 204, 332, 588, 1100, 2116, 4156, 8244),
    continuous=0x4007,
    average_at=9,
    conversion_at=(6, 3),
)
INA228 = PowerMonitor(
    name="INA228",
    manufacturer_register=0x3E,
    identity_register=0x3F,
    identity=0x2280,
    reset_value=0x8000,
    control_register=0x01,
    flags_register=0x0B,
    flags_setup=0x8000,  # ALATCH: the ready bit is cleared when it is read
    conversion_ready=0x0002,
    voltage_register=0x05,
    shunt_register=0x04,
    value_bytes=3,
    unused_bits=4,
    volts_per_count=195.3125e-6,
    shunt_volts_per_count=312.5e-9,
    conversion_us=(50, 84, 150, 280, 540, 1052, 2074, 4120),
    continuous=0xB000,
    average_at=0,
    conversion_at=(9, 6, 3),  # including the temperature conversion, although temperature is not measured
)


class PowerMonitorDriver:
    """The part at `address`, writing to /battery. shunt_ohm: resistance of the shunt. period_s: tick period."""

    def __init__(self, bus: I2CBus, address: int, part: PowerMonitor, *, shunt_ohm: float, period_s: float):
        self._bus, self._address, self._part = bus, address, part
        self._shunt_ohm = shunt_ohm
        conversion, average = averaging(part, period_s)
        self._control = part.control(conversion, average)
        self._cycle_ns = cycle_us(part, conversion, average) * 1000
        self._stale = 0

    def start(self) -> Iterator[float]:
        part = self._part
        maker = self._word(part.manufacturer_register)
        identity = self._word(part.identity_register)
        if maker != TI or identity & 0xFFF0 != part.identity:
            raise wrong_device(part.name, f"manufacturer 0x{maker:04x}, device 0x{identity:04x}")
        self._set(0, part.reset_value)
        yield RESET_S
        self._set(part.control_register, self._control)
        self._set(part.flags_register, part.flags_setup)

    def read(self, now_ns: int) -> list[Sample]:
        """Mean values over the part's last cycle, dated one cycle ago: on average, this is the middle of the cycle."""
        part = self._part
        if not self._word(part.flags_register) & part.conversion_ready:
            if self._word(part.control_register) != self._control:
                raise brown_out(part.name)
            self._stale += 1
            if self._stale > STALE_LIMIT:
                raise SensorFailure(Status.STALE, f"{part.name} has stopped measuring")
            return [Sample("/battery", now_ns, Battery(status=Status.STALE))]
        self._stale = 0
        voltage = self._value(part.voltage_register)
        shunt = self._value(part.shunt_register)
        full = 2 ** (8 * part.value_bytes - part.unused_bits - 1)
        message = Battery(
            status=Status.SATURATED if shunt in (full - 1, -full) else Status.OK,
            voltage_V=voltage * part.volts_per_count,
            current_A=shunt * part.shunt_volts_per_count / self._shunt_ohm,
        )
        return [Sample("/battery", now_ns - self._cycle_ns, message)]

    def _word(self, register: int) -> int:
        return int.from_bytes(self._bus.write_read(self._address, bytes([register]), 2), "big")

    def _value(self, register: int) -> int:
        data = self._bus.write_read(self._address, bytes([register]), self._part.value_bytes)
        return int.from_bytes(data, "big", signed=True) >> self._part.unused_bits

    def _set(self, register: int, word: int) -> None:
        self._bus.write(self._address, bytes([register]) + word.to_bytes(2, "big"))


def cycle_us(part: PowerMonitor, conversion: int, average: int) -> int:
    """Time of one averaged pair of voltage and shunt [us]."""
    return 2 * part.conversion_us[conversion] * AVERAGES[average]


def averaging(part: PowerMonitor, period_s: float) -> tuple[int, int]:
    """Codes of the conversion time and averages whose cycle fills a tick best; of equal ones, the most averages."""
    limit_us = FREE_SHARE * period_s * 1e6
    pairs = [(c, a) for c in range(len(part.conversion_us)) for a in range(len(AVERAGES))]
    fitting = [pair for pair in pairs if cycle_us(part, *pair) <= limit_us]
    return max(fitting, key=lambda pair: (cycle_us(part, *pair), pair[1]))
