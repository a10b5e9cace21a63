"""Differential pressure transducers that answer a bare read with four bytes: TE MS45xxDO and Honeywell TruStability.

Both carry the same kind of signal conditioner: two bits of status, 14 of pressure, 11 of temperature (TE application
note "Interfacing to MEAS digital pressure modules"; Honeywell technical note "I2C communications with TruStability").
A zero-length transfer or a repeated start makes the next transfer fail, so nothing but a bare read is ever sent.
"""

import enum
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from daq.bus import I2CBus
from daq.sensors import Sample
from flight.messages import DifferentialPressure
from flight.messages import Status as Outcome

INCH_OF_WATER_PA = 249.08891  # conventional, water at 4 degC: what both makers mean
PSI_PA = 6894.757293
FULL_COUNT = 2**14 - 1
FIRST_DATA_S = 0.01  # 8.4 ms after power-on (MS4515DO datasheet)


class FrameStatus(enum.IntEnum):
    """The part's own two bits."""

    GOOD = 0
    COMMAND = 1  # reserved: never in normal operation
    STALE = 2  # this value was read before
    FAULT = 3  # stays until the supply is switched off and on


class Frame(NamedTuple):
    status: FrameStatus
    pressure_counts: int
    temperature_counts: int


@dataclass(frozen=True)
class Transfer:
    """A straight line through two points: `low_counts` is `low_Pa`, `high_counts` is `high_Pa`."""

    low_counts: float
    high_counts: float
    low_Pa: float
    high_Pa: float


class BridgeTransducer:
    """The transducer at `address`, writing to `topic`. reversed_ports: its tubes are exchanged."""

    def __init__(self, bus: I2CBus, address: int, transfer: Transfer, *, topic: str, reversed_ports: bool = False):
        self._bus, self._address = bus, address
        self._transfer = transfer
        self._topic = topic
        self._sign = -1 if reversed_ports else 1

    def start(self) -> Iterator[float]:
        """Nothing to set; wait for the first measurement."""
        yield FIRST_DATA_S

    def read(self, now_ns: int) -> list[Sample]:
        frame = decode(self._bus.read(self._address, 4))
        return [Sample(self._topic, now_ns, message(frame, self._transfer, self._sign))]


def decode(reply: bytes) -> Frame:
    """Bit fields of the four bytes."""
    word = int.from_bytes(reply, "big")
    return Frame(FrameStatus(word >> 30), (word >> 16) & 0x3FFF, (word >> 5) & 0x7FF)


def message(frame: Frame, transfer: Transfer, sign: int = 1) -> DifferentialPressure:
    """What a frame means. A stale or faulty one has no values: the part repeats old ones."""
    if frame.status is FrameStatus.STALE:
        return DifferentialPressure(status=Outcome.STALE)
    if frame.status is not FrameStatus.GOOD:
        return DifferentialPressure(status=Outcome.FAULT)
    pinned = frame.pressure_counts in (0, FULL_COUNT)  # open or saturated bridge
    return DifferentialPressure(
        status=Outcome.SATURATED if pinned else Outcome.OK,
        pressure_counts=frame.pressure_counts,
        temperature_counts=frame.temperature_counts,
        differential_pressure_Pa=sign * pressure_Pa(frame.pressure_counts, transfer),
        temperature_K=temperature_K(frame.temperature_counts),
    )


def pressure_Pa(counts: float, transfer: Transfer) -> float:
    """Port 1 minus port 2 [Pa]: the inverse of the part's transfer function."""
    fraction = (counts - transfer.low_counts) / (transfer.high_counts - transfer.low_counts)
    return transfer.low_Pa + fraction * (transfer.high_Pa - transfer.low_Pa)


def temperature_K(counts: int) -> float:
    """-50 to 150 degC over 2047 counts."""
    return counts * 200 / 2047 - 50 + 273.15
