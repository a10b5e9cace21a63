"""Starts one sensor, reads it, and restarts it when it fails.

Drivers' exceptions are caught only here: a failed sensor loses its own data and nothing else.
"""

import errno
from collections import deque
from collections.abc import Callable, Iterator

from flightpower.daq.repeated_readings import RepeatedReadingsOfSensor
from flightpower.daq.sensor_health import SensorHealth
from flightpower.daq.sensors import Sample, Sensor, SensorFailure, complaint_of
from flightpower.flight.messages import OK, TYPE_OF_TOPIC, Event, Status

RETRY_NS = 500_000_000
TRANSFER_FAILURES_LIMIT = 3  # failed transfers in a row after which the sensor is restarted
SKIPPING_NS = 1_000_000_000  # two skipped ticks within this time degrade the sensor's health
BUSY = Status.BUSY
TIMEOUTS = frozenset({errno.ETIMEDOUT, errno.EAGAIN})


class SensorSupervisor:
    """Runs one sensor for the sampling loop.

    device: the sensor's bus or port; after a timeout the other sensors on it are skipped in that tick. make: opens the
    bus or port and returns a new driver; may raise OSError. topics: the topics that the driver writes. blocking:
    whether a transfer waits for the sensor (on a bus), or returns the bytes that have arrived (on a port).
    silent_at_rest: see `SensorHealth`.
    """

    def __init__(
        self,
        name: str,
        device: str,
        topics: tuple[str, ...],
        make: Callable[[], Sensor],
        *,
        blocking: bool = False,
        silent_at_rest: bool = False,
    ):
        self.name = name
        self.blocking = blocking
        self.device = device
        self.timed_out = False  # whether the latest read ended in a timeout
        self.topics = topics
        self.health = SensorHealth(name, silent_at_rest=silent_at_rest)
        self.in_flight = False  # set by the sampling loop
        self._repeated = RepeatedReadingsOfSensor()
        self.skipped = 0  # number of messages for ticks in which the sensor was skipped
        self._skipped_ns: deque[int] = deque(maxlen=2)  # times of the latest skipped ticks
        self.events: list[Event] = []  # emptied by the bus worker
        self._make = make
        self._sensor: Sensor | None = None
        self._startup: Iterator[float] | None = None
        self._resume_ns: int | None = None
        self._absence = Status.STARTING
        self._failures = 0

    def open(self, now_ns: int) -> OSError | None:
        """Try to open the bus or port. Returns the error if that fails."""
        try:
            self._begin()
        except OSError as error:
            self._fail(now_ns, status_of(error), cause_of(error))
            return error
        return None

    def read(self, now_ns: int) -> list[Sample]:
        """This tick's messages. A failed sensor gives messages without values, whose status names the failure."""
        self.timed_out = False
        try:
            if (self._startup is not None or self._sensor is None) and not self._is_ready(now_ns):
                return self._absent(now_ns, self._absence)
            assert self._sensor is not None
            samples = self._sensor.read(now_ns)
        except OSError as error:
            status = status_of(error)
            self.timed_out = status is Status.TIMEOUT
            return self._transfer_failed(now_ns, status, cause_of(error))
        except SensorFailure as failure:
            return self._fail(now_ns, failure.status, str(failure))
        except Exception as error:  # a bug in a driver must not end the recording; the event names it
            return self._fail(now_ns, Status.FAULT, f"driver error {type(error).__name__}: {error}")
        self._failures = 0
        if self.in_flight or self._repeated.stale:
            samples = self._repeated.marked(samples, now_ns, in_flight=self.in_flight)
        health, good = self.health, True
        for _, _, message, _ in samples:
            status = message.status
            health.statuses[status] += 1
            good &= status is OK or status is BUSY
        skipping = len(self._skipped_ns) == 2 and now_ns - self._skipped_ns[0] < SKIPPING_NS
        complaint = complaint_of(self._sensor)
        if good and not skipping and not complaint and health.settled:
            return samples
        statuses = [sample.message.status for sample in samples]
        self._add_event(health.read([*statuses, Status.TIMEOUT] if skipping else statuses, now_ns, complaint))
        return samples

    def skip(self, now_ns: int) -> list[Sample]:
        """Messages for a tick in which the bus hangs or is slow. Safe while `read` is running in another thread."""
        self.skipped += len(self.topics)
        self._skipped_ns.append(now_ns)
        return [Sample(topic, now_ns, TYPE_OF_TOPIC[topic](status=Status.TIMEOUT)) for topic in self.topics]

    @property
    def errors(self) -> int:
        """Number of messages without a measurement, not counting those during startup."""
        return self.health.errors + self.skipped

    @property
    def system_id(self) -> int | None:
        """MAVLink system of an autopilot that has been heard; None for any other sensor."""
        return getattr(self._sensor, "system_id", None)

    def _is_ready(self, now_ns: int) -> bool:
        """Whether the sensor can be read now. Continues its startup if the next step is due."""
        if self._sensor is not None and self._startup is None:
            return True
        if self._resume_ns is not None and now_ns < self._resume_ns:
            return False
        if self._sensor is None:
            self._begin()
        assert self._startup is not None
        for wait_s in self._startup:
            if wait_s > 0:
                self._resume_ns = now_ns + round(wait_s * 1e9)
                return False
        self._startup = None
        return True

    def _begin(self) -> None:
        self._sensor = self._make()
        self._startup = self._sensor.start()
        self._resume_ns = None

    def _transfer_failed(self, now_ns: int, status: Status, cause: str) -> list[Sample]:
        """Retry a single failed transfer in the next tick; after several, or one during startup, restart the sensor."""
        self._failures += 1
        if self._startup is None and self._sensor is not None and self._failures < TRANSFER_FAILURES_LIMIT:
            return self._absent(now_ns, status)
        return self._fail(now_ns, status, cause)

    def _fail(self, now_ns: int, status: Status, cause: str) -> list[Sample]:
        was_ready = self._sensor is not None and self._startup is None
        self._sensor, self._startup = None, None
        self._resume_ns = None if was_ready else now_ns + RETRY_NS
        self._absence = status
        self._add_event(self.health.failed(cause, now_ns))
        return self._absent(now_ns, status)

    def _absent(self, now_ns: int, status: Status) -> list[Sample]:
        self.health.statuses[status] += len(self.topics)
        return [Sample(topic, now_ns, TYPE_OF_TOPIC[topic](status=status)) for topic in self.topics]

    def _add_event(self, event: Event | None) -> None:
        if event is not None:
            self.events.append(event)


def status_of(error: OSError) -> Status:
    return Status.TIMEOUT if error.errno in TIMEOUTS else Status.NO_REPLY


def cause_of(error: OSError) -> str:
    """The error in one line, with the device if the error names one."""
    where = f" ({error.filename})" if error.filename else ""
    return f"{error.strerror or error}{where}"
