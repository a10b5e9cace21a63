"""Drivers, one file a device: transaction, bit fields and conversion apart.

A driver is made over an open bus or port that it does not own, knows nothing of other sensors, never sleeps and never
catches an I/O error. What the part says (stale, fault, saturated) is data; OSError and `SensorFailure` rise to the
loop, which makes a new driver and brings the part up again.
"""

from collections.abc import Iterator
from typing import NamedTuple, Protocol

from flight.messages import Message, Status


class Sample(NamedTuple):
    """A message on its topic, with when the measurement was made (monotonic [ns])."""

    topic: str
    time_ns: int
    message: Message


class Sensor(Protocol):
    """What the loop needs of a driver."""

    def start(self) -> Iterator[float]:
        """Bring the part up; each value is how long [s] to wait before going on. Called once in a driver's life."""

    def read(self, now_ns: int) -> list[Sample]:
        """What there is at this tick, perhaps nothing. now_ns: monotonic time at the start of this sensor's turn."""


class SensorFailure(Exception):
    """The part answers, but not as it should: it has to be brought up again. `status` goes into the log."""

    def __init__(self, status: Status, text: str):
        super().__init__(text)
        self.status = status


def wrong_device(expected: str, found: str) -> SensorFailure:
    return SensorFailure(Status.WRONG_DEVICE, f"{expected} expected, but {found}")


def brown_out(part: str) -> SensorFailure:
    return SensorFailure(Status.FAULT, f"{part} is back at its power-on defaults: was its supply interrupted?")
