"""What to say about a sensor, and how often: states out of statuses, events out of changes of state."""

import enum
from collections import Counter

from flight.messages import Event, Status


class State(enum.StrEnum):
    STARTING = "starting"
    OK = "ok"
    DEGRADED = "degraded"  # it answers, but not with measurements
    FAILED = "failed"  # it does not answer, or is not what it should be
    RECOVERING = "recovering"  # it answers again, but not yet for long enough to be believed


FINE = frozenset({Status.OK, Status.BUSY})
QUIET_BETWEEN_NS = 5_000_000_000  # between two events of one sensor
BELIEVED_AFTER_NS = 500_000_000  # of good readings
GRACE_NS = 2_000_000_000  # at power-on parts need their time, and the magnetometer waits for the IMU
DEGRADED_AFTER_NS = 500_000_000  # of readings without measurement: a stale one now and then is no news
SEVERITY = {State.DEGRADED: "warning", State.FAILED: "error"}


class Health:
    """The state of one sensor. Counts its statuses; turns changes of state into events, not too many of them."""

    def __init__(self, sensor: str):
        self.sensor = sensor
        self.state = State.STARTING
        self.statuses: Counter[Status] = Counter()
        self._cause = ""
        self._first_ns: int | None = None  # of the first failure
        self._good_since_ns: int | None = None
        self._bad_since_ns: int | None = None
        self._told = State.STARTING
        self._told_ns: int | None = None
        self._untold = 0

    @property
    def errors(self) -> int:
        """Readings that were no measurement, those while the sensor was brought up left out."""
        return sum(n for status, n in self.statuses.items() if status not in FINE and status is not Status.STARTING)

    def failed(self, cause: str, now_ns: int) -> Event | None:
        """It raised."""
        self._good_since_ns = None
        self._cause = cause
        self._first_ns = now_ns if self._first_ns is None else self._first_ns
        if self.state is State.STARTING and now_ns - self._first_ns < GRACE_NS:
            return None
        return self._move(State.FAILED, now_ns)

    def read(self, statuses: list[Status], now_ns: int) -> Event | None:
        """It answered with messages of these statuses, perhaps with none."""
        if not statuses:
            return self._repeat(now_ns)
        if FINE.issuperset(statuses):
            self._bad_since_ns = None
            self._good_since_ns = now_ns if self._good_since_ns is None else self._good_since_ns
            believed = self.state is State.STARTING or now_ns - self._good_since_ns >= BELIEVED_AFTER_NS
            if self.state is State.OK or believed:
                return self._move(State.OK, now_ns)
            return self._move(State.RECOVERING, now_ns)
        self._good_since_ns = None
        self._bad_since_ns = now_ns if self._bad_since_ns is None else self._bad_since_ns
        if now_ns - self._bad_since_ns >= DEGRADED_AFTER_NS:
            self._cause = ", ".join(sorted({status for status in statuses if status not in FINE}))
            return self._move(State.DEGRADED, now_ns)
        return self._repeat(now_ns)

    def _move(self, state: State, now_ns: int) -> Event | None:
        if state is not self.state:
            self.state = state
            self._untold += 1
        return self._repeat(now_ns)

    def _repeat(self, now_ns: int) -> Event | None:
        """An event if there is a change that was not told, and the last one was told long enough ago."""
        if self.state is self._told or self.state is State.RECOVERING:
            return None
        if self._told_ns is not None and now_ns - self._told_ns < QUIET_BETWEEN_NS:
            return None
        more = f" ({self._untold} changes since the last report)" if self._untold > 2 else ""
        text = "works" if self.state is State.OK else f"{self.state}: {self._cause}"
        self._told, self._told_ns, self._untold = self.state, now_ns, 0
        return Event(severity=SEVERITY.get(self.state, "info"), sensor=self.sensor, text=f"{self.sensor} {text}{more}")
