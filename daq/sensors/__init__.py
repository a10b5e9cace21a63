"""Drivers, with one file for each device, and separate functions for transactions, bit fields and conversions.

A driver uses an open bus or port that it does not own. It is independent of other sensors, never sleeps and never
catches an I/O error. States reported by the part (stale, fault, saturated) are data. OSError and `SensorFailure` are
raised to `daq.sensor_supervisor`, which makes a new driver and starts the part again.
"""

from collections.abc import Iterator
from typing import NamedTuple, Protocol

from flightpower.flight.messages import Message, Status


class Sample(NamedTuple):
    """A message, its topic, the time of the measurement (monotonic [ns]), and the tick in which its reading began.

    tick: None for the current tick; set if the answer came after the end of its tick.
    """

    topic: str
    time_ns: int
    message: Message
    tick: int | None = None


class Sensor(Protocol):
    """The interface of a driver."""

    def start(self) -> Iterator[float]:
        """Start the part. Yields the time [s] to wait before each next step. It is called once per driver object."""

    def read(self, now_ns: int) -> list[Sample]:
        """This tick's messages; may be empty. now_ns: monotonic time at which this sensor's reading begins."""


def complaint_of(sensor: object) -> str:
    """A fault of a part that still measures, such as a missed rate; empty if there is none.

    A driver that audits its part keeps the text in its attribute `complaint`.
    """
    return getattr(sensor, "complaint", "")


class SensorFailure(Exception):
    """The part answers incorrectly and must be restarted. `status` is logged."""

    def __init__(self, status: Status, text: str):
        super().__init__(text)
        self.status = status


def wrong_device(expected: str, identity: str) -> SensorFailure:
    return SensorFailure(Status.WRONG_DEVICE, f"{expected} expected, but {identity}")


def brown_out(part: str) -> SensorFailure:
    return SensorFailure(Status.FAULT, f"{part} is back at its power-on defaults: check its supply for interruptions")
