"""Driver of differential pressure transducers that answer a plain read by four bytes: TE MS45xxDO, Honeywell
TruStability.

Both have the same kind of signal conditioner: two bits of status, 14 of pressure, 11 of temperature (TE application
note "Interfacing to MEAS digital pressure modules"; Honeywell technical note "I2C communications with TruStability").
A zero-length transfer or a repeated start makes the next transfer fail, so only plain reads are used.

The reply has no checksum, and controllers shift it by a bit if a part stretches the clock. A jump of the temperature in
the reply, which is impossible, reveals that. A pressure that jumps is read again, and believed only if the second
reading agrees.
"""

import enum
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from flightpower.daq.bus import I2CBus
from flightpower.daq.sensors import Sample
from flightpower.daq.sensors.slow_value import SlowValue
from flightpower.flight.messages import OK, DifferentialPressure, Status

INCH_OF_WATER_PA = 249.08891  # conventional, water at 4 degC, as used by both manufacturers
PSI_PA = 6894.757293
FULL_COUNT = 2**14 - 1
# 3 K, and the warming of the tray's electronics per second. Shifted by a bit, room temperature is 36 K off.
TEMPERATURE_STEP, TEMPERATURE_PER_S = 31.0, 0.2  # counts of 0.1 K
BELIEVED_AFTER = 15_000  # number of readings: ten minutes. A second part at the same address agrees with itself.
JUMP_PA = 10.0  # change between two ticks: 0.5 m/s at 15 m/s. A larger change is read again.
FIRST_DATA_S = 0.01  # 8.4 ms after power-on (MS4515DO datasheet)


class FrameStatus(enum.IntEnum):
    """The two status bits of the part."""

    GOOD = 0
    COMMAND = 1  # command mode, which never occurs in normal operation
    STALE = 2  # this value has been read before
    FAULT = 3  # remains until the supply is switched off and on


STATUSES = tuple(FrameStatus)
REPEATED = (FrameStatus.GOOD, FrameStatus.STALE)  # status of a reading right after another one


class Frame(NamedTuple):
    """The fields of the four bytes."""

    status: FrameStatus
    pressure_counts: int
    temperature_counts: int


@dataclass(frozen=True)
class TransferFunction:
    """A straight line through two points: `low_counts` at `low_Pa` and `high_counts` at `high_Pa`."""

    low_counts: float
    high_counts: float
    low_Pa: float
    high_Pa: float


class BridgeTransducerDriver:
    """The transducer at `address`, writing to `topic`. reversed_ports: the tubes are exchanged."""

    def __init__(
        self, bus: I2CBus, address: int, transfer: TransferFunction, *, topic: str, reversed_ports: bool = False
    ):
        self._bus, self._address = bus, address
        self._transfer = transfer
        self._topic = topic
        self._sign = -1 if reversed_ports else 1
        self._temperature = SlowValue(TEMPERATURE_STEP, TEMPERATURE_PER_S, BELIEVED_AFTER)
        self._jump_counts = (
            JUMP_PA * (transfer.high_counts - transfer.low_counts) / (transfer.high_Pa - transfer.low_Pa)
        )
        self._pressure_counts: int | None = None  # the latest believed reading

    def start(self) -> Iterator[float]:
        """Wait for the first measurement; nothing is configured."""
        yield FIRST_DATA_S

    def read(self, now_ns: int) -> list[Sample]:
        """This tick's pressure. `corrupt` if a second reading does not confirm a jump of pressure or temperature."""
        frame = decode(self._bus.read(self._address, 4))
        if frame.status is FrameStatus.GOOD:
            fits = self._temperature.fits(frame.temperature_counts, now_ns)
            before = self._pressure_counts
            if not fits or (before is not None and abs(frame.pressure_counts - before) > self._jump_counts):
                again = decode(self._bus.read(self._address, 4))  # stale if it is the same measurement
                confirmed = self._is_near(again, self._pressure_counts) or (
                    fits and self._is_near(again, frame.pressure_counts)
                )
                if (
                    again.status not in REPEATED
                    or not confirmed
                    or not self._temperature.fits(again.temperature_counts, now_ns)
                ):
                    return [Sample(self._topic, now_ns, DifferentialPressure(status=Status.CORRUPT))]
                frame = again._replace(status=FrameStatus.GOOD)
            self._pressure_counts = frame.pressure_counts
        return [Sample(self._topic, now_ns, message(frame, self._transfer, self._sign))]

    def _is_near(self, frame: Frame, pressure_counts: int | None) -> bool:
        return pressure_counts is None or abs(frame.pressure_counts - pressure_counts) <= self._jump_counts


def decode(reply: bytes) -> Frame:
    """Decode the four bytes."""
    word = int.from_bytes(reply, "big")
    return Frame(STATUSES[word >> 30], (word >> 16) & 0x3FFF, (word >> 5) & 0x7FF)


def message(frame: Frame, transfer: TransferFunction, sign: int = 1) -> DifferentialPressure:
    """The message for a frame. A stale or faulty frame repeats old values, so the message has none."""
    if frame.status:
        return DifferentialPressure(status=Status.STALE if frame.status is FrameStatus.STALE else Status.FAULT)
    at_limit = frame.pressure_counts in (0, FULL_COUNT)  # open or saturated bridge
    return DifferentialPressure(
        status=Status.SATURATED if at_limit else OK,
        pressure_counts=frame.pressure_counts,
        temperature_counts=frame.temperature_counts,
        differential_pressure_Pa=sign * pressure_Pa(frame.pressure_counts, transfer),
        temperature_K=temperature_K(frame.temperature_counts),
    )


def pressure_Pa(counts: float, transfer: TransferFunction) -> float:
    """Pressure at port 1 minus port 2 [Pa]: the inverse of the part's transfer function."""
    fraction = (counts - transfer.low_counts) / (transfer.high_counts - transfer.low_counts)
    return transfer.low_Pa + fraction * (transfer.high_Pa - transfer.low_Pa)


def temperature_K(counts: int) -> float:
    """Temperature [K]: 2047 counts span -50 to 150 degC."""
    return counts * 200 / 2047 - 50 + 273.15
