"""One sensor through its life: brought up, read, and brought up again when it fails.

The one place where drivers' exceptions are caught: a sensor that fails costs its own data and nothing else.
"""

import errno
from collections.abc import Callable, Iterator

from daq.health import Health
from daq.sensors import Sample, Sensor, SensorFailure
from flight.messages import TYPE_OF_TOPIC, Event, Status

RETRY_NS = 500_000_000
GLITCHES = 3  # failed transfers in a row before the part is brought up afresh
TIMEOUTS = frozenset({errno.ETIMEDOUT, errno.EAGAIN})


class Station:
    """A sensor's place in the loop.

    lane: the bus or port it hangs on; when a transfer on it hangs, the others on it are not tried in the same tick.
    make: opens the bus or port and makes a fresh driver; may raise OSError. topics: what the driver writes. may_hang:
    transfers on its lane wait for the part (a bus), others take what is there (a port).
    """

    def __init__(
        self, name: str, lane: str, topics: tuple[str, ...], make: Callable[[], Sensor], *, may_hang: bool = False
    ):
        self.name = name
        self.may_hang = may_hang
        self.lane = lane
        self.hung = False  # whether the latest turn ended in a timeout
        self.topics = topics
        self.health = Health(name)
        self.passed_over = 0  # messages for turns that were not taken
        self.events: list[Event] = []  # taken by the loop
        self._make = make
        self._sensor: Sensor | None = None
        self._bring_up: Iterator[float] | None = None
        self._resume_ns: int | None = None
        self._absence = Status.STARTING
        self._failures = 0

    def open(self, now_ns: int) -> str:
        """Try to open the bus or port; why it could not be, or nothing."""
        try:
            self._begin()
        except OSError as error:
            self._fail(now_ns, status_of(error), cause_of(error))
            return cause_of(error)
        return ""

    def turn(self, now_ns: int) -> list[Sample]:
        """This tick's messages; a sensor that is not there gives messages that say so."""
        self.hung = False
        try:
            if not self._up(now_ns):
                return self._absent(now_ns, self._absence)
            assert self._sensor is not None
            samples = self._sensor.read(now_ns)
        except OSError as error:
            status = status_of(error)
            self.hung = status is Status.TIMEOUT
            return self._glitch(now_ns, status, cause_of(error))
        except SensorFailure as failure:
            return self._fail(now_ns, failure.status, str(failure))
        except Exception as error:  # a driver's mistake must not cost the flight; the event says that it is one
            return self._fail(now_ns, Status.FAULT, f"driver error {type(error).__name__}: {error}")
        self._failures = 0
        statuses = [sample.message.status for sample in samples]
        self.health.statuses.update(statuses)
        self._tell(self.health.read(statuses, now_ns))
        return samples

    def pass_over(self, now_ns: int) -> list[Sample]:
        """Not tried in this tick, because its bus hangs. Touches nothing that a turn under way does."""
        self.passed_over += len(self.topics)
        return [Sample(topic, now_ns, TYPE_OF_TOPIC[topic](status=Status.TIMEOUT)) for topic in self.topics]

    @property
    def errors(self) -> int:
        """Readings that were no measurement, those while the sensor was brought up left out."""
        return self.health.errors + self.passed_over

    def _up(self, now_ns: int) -> bool:
        """Whether the part can be read now; goes on with bringing it up when it is time to."""
        if self._sensor is not None and self._bring_up is None:
            return True
        if self._resume_ns is not None and now_ns < self._resume_ns:
            return False
        if self._sensor is None:
            self._begin()
        assert self._bring_up is not None
        for wait_s in self._bring_up:
            if wait_s > 0:
                self._resume_ns = now_ns + round(wait_s * 1e9)
                return False
        self._bring_up = None
        return True

    def _begin(self) -> None:
        self._sensor = self._make()
        self._bring_up = self._sensor.start()
        self._resume_ns = None

    def _glitch(self, now_ns: int, status: Status, cause: str) -> list[Sample]:
        """A transfer failed. While reading, the next tick may do better; a few in a row, or bringing it up, may not."""
        self._failures += 1
        if self._bring_up is None and self._sensor is not None and self._failures < GLITCHES:
            return self._absent(now_ns, status)
        return self._fail(now_ns, status, cause)

    def _fail(self, now_ns: int, status: Status, cause: str) -> list[Sample]:
        was_up = self._sensor is not None and self._bring_up is None
        self._sensor, self._bring_up = None, None
        self._resume_ns = None if was_up else now_ns + RETRY_NS
        self._absence = status
        self._tell(self.health.failed(cause, now_ns))
        return self._absent(now_ns, status)

    def _absent(self, now_ns: int, status: Status) -> list[Sample]:
        self.health.statuses[status] += len(self.topics)
        return [Sample(topic, now_ns, TYPE_OF_TOPIC[topic](status=status)) for topic in self.topics]

    def _tell(self, event: Event | None) -> None:
        if event is not None:
            self.events.append(event)


def status_of(error: OSError) -> Status:
    return Status.TIMEOUT if error.errno in TIMEOUTS else Status.NO_REPLY


def cause_of(error: OSError) -> str:
    """One line, with the device where the error knows it."""
    where = f" ({error.filename})" if error.filename else ""
    return f"{error.strerror or error}{where}"
