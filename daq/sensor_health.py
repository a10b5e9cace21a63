"""Derives a sensor's state from its statuses, and makes the events that report changes of state."""

import enum
from collections import Counter

from flightpower.flight.messages import Event, Status


class SensorState(enum.StrEnum):
    STARTING = "starting"
    WAITING = "waiting"  # has sent nothing yet, which is normal while the motor is stopped
    OK = "ok"
    DEGRADED = "degraded"  # answers, but without measurements, or not as configured
    FAILED = "failed"  # does not answer, or is not the configured part
    RECOVERING = "recovering"  # answers again, but not yet for RECOVERED_AFTER_NS


UNTRIED = frozenset({SensorState.STARTING, SensorState.WAITING})
GOOD_STATUSES = frozenset({Status.OK, Status.BUSY})
SILENT = frozenset({Status.NO_DATA})
EVENT_SPACING_NS = 5_000_000_000  # least time between two events of one sensor
RECOVERED_AFTER_NS = 500_000_000  # time of good readings after a failure
STARTUP_NS = 2_000_000_000  # no reports of failures before this time: the magnetometer must wait for the IMU
DEGRADED_AFTER_NS = 500_000_000  # time of readings without a measurement; single stale readings are normal
SEVERITY = {SensorState.DEGRADED: "warning", SensorState.FAILED: "error"}


class SensorHealth:
    """Tracks the state of one sensor: counts its statuses and reports changes of state, with limited frequency."""

    def __init__(self, sensor: str, *, silent_at_rest: bool = False):
        """silent_at_rest: whether the sensor sends nothing until the motor turns."""
        self.sensor = sensor
        self._may_wait = silent_at_rest
        self.state = SensorState.STARTING
        self.statuses: Counter[Status] = Counter()
        self._cause = ""
        self._first_ns: int | None = None  # time of the first failure
        self._good_since_ns: int | None = None
        self._bad_since_ns: int | None = None
        self._reported = SensorState.STARTING
        self._reported_ns: int | None = None
        self._unreported = 0
        self._settled = False  # whether the state is OK and was reported as OK

    @property
    def errors(self) -> int:
        """Number of messages without a measurement, not counting those during startup."""
        return sum(
            n for status, n in self.statuses.items() if status not in GOOD_STATUSES and status is not Status.STARTING
        )

    @property
    def trouble(self) -> str:
        """Why the sensor failed, or what is wrong with it; empty while it works or is being started."""
        return self._cause if self.state in SEVERITY else ""

    @property
    def settled(self) -> bool:
        """Whether the sensor works and its state was reported, so that another good reading changes nothing."""
        return self._settled and self._bad_since_ns is None

    def failed(self, cause: str, now_ns: int) -> Event | None:
        """Note that the driver raised an error."""
        self._good_since_ns = None
        self._cause = cause
        self._first_ns = now_ns if self._first_ns is None else self._first_ns
        if self.state is SensorState.STARTING and now_ns - self._first_ns < STARTUP_NS:
            return None
        return self._move(SensorState.FAILED, now_ns)

    def read(self, statuses: list[Status], now_ns: int, complaint: str = "") -> Event | None:
        """Note that the driver returned messages with these statuses, possibly none. complaint: see `daq.sensors`."""
        if complaint and GOOD_STATUSES.issuperset(statuses):
            self._may_wait, self._good_since_ns = False, None
            self._bad_since_ns = now_ns if self._bad_since_ns is None else self._bad_since_ns
            if complaint != self._cause and self.state is SensorState.DEGRADED:
                self._reported = SensorState.OK  # a different problem is reported again
            self._cause = complaint
            return self._move(SensorState.DEGRADED, now_ns)
        if not statuses:
            return self._event(now_ns)
        if self._may_wait and SILENT.issuperset(statuses):
            return self._move(SensorState.WAITING, now_ns)
        if GOOD_STATUSES.issuperset(statuses):
            self._may_wait = False
            self._bad_since_ns = None
            self._good_since_ns = now_ns if self._good_since_ns is None else self._good_since_ns
            recovered = self.state in UNTRIED or now_ns - self._good_since_ns >= RECOVERED_AFTER_NS
            if self.state is SensorState.OK or recovered:
                return self._move(SensorState.OK, now_ns)
            return self._move(SensorState.RECOVERING, now_ns)
        self._good_since_ns = None
        self._bad_since_ns = now_ns if self._bad_since_ns is None else self._bad_since_ns
        if now_ns - self._bad_since_ns >= DEGRADED_AFTER_NS:
            self._cause = ", ".join(sorted({status for status in statuses if status not in GOOD_STATUSES}))
            return self._move(SensorState.DEGRADED, now_ns)
        return self._event(now_ns)

    def _move(self, state: SensorState, now_ns: int) -> Event | None:
        if state is not self.state:
            self.state = state
            self._unreported += 1
        event = self._event(now_ns)
        self._settled = state is SensorState.OK and self._reported is SensorState.OK
        return event

    def _event(self, now_ns: int) -> Event | None:
        """Return an event if a change is unreported and the last event is at least EVENT_SPACING_NS old."""
        if self.state in (self._reported, SensorState.RECOVERING, SensorState.WAITING):
            return None
        if self._reported_ns is not None and now_ns - self._reported_ns < EVENT_SPACING_NS:
            return None
        more = f" ({self._unreported} changes since the last report)" if self._unreported > 2 else ""
        text = "works" if self.state is SensorState.OK else f"{self.state}: {self._cause}"
        first = self._reported is SensorState.STARTING and self.state is SensorState.OK  # must not delay a problem
        self._reported, self._reported_ns, self._unreported = self.state, None if first else now_ns, 0
        return Event(severity=SEVERITY.get(self.state, "info"), sensor=self.sensor, text=f"{self.sensor} {text}{more}")
