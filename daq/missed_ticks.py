"""Reports missed ticks, for which other programs or a busy kernel kept the sampling thread waiting."""

from collections import deque

from flightpower.daq.recording_status import RECENT_S, ticks_missed
from flightpower.daq.sampling_loop import GridTick
from flightpower.flight.messages import Event

EVENT_SPACING_NS = 5_000_000_000  # least time between two events
STALL_NS = 5_000_000_000  # this long without a tick is a stall: a hole in a run that no interpolation can bridge


class MissedTicks:
    """Counts missed ticks and reports them, at most every five seconds. period_ns: of the ticks."""

    def __init__(self, period_ns: int):
        self._period_ns = period_ns
        self._unreported = self._longest = 0
        self._reported_ns: int | None = None
        self._latest: deque[tuple[int, int]] = deque()  # times, and numbers of ticks missed

    def add(self, tick: GridTick, now_ns: int) -> list[Event]:
        """Count a tick. Returns an event if missed ticks are to be reported."""
        if tick.missed:
            self._latest.append((now_ns, tick.missed))
        self._unreported += tick.missed
        self._longest = max(self._longest, tick.missed)
        if not self._unreported or (self._reported_ns is not None and now_ns - self._reported_ns < EVENT_SPACING_NS):
            return []
        longest_s = self._longest * self._period_ns / 1e9
        stalled = self._longest * self._period_ns >= STALL_NS
        longest = f"{longest_s:.1f} s" if longest_s >= 0.1 else "less than 0.1 s"
        text = f"{ticks_missed(self._unreported)}, {longest} in a row: stop other programs on this computer"
        self._unreported = self._longest = 0
        self._reported_ns = now_ns
        return [Event(severity="error" if stalled else "warning", sensor="daq", text=text)]

    def recent(self, now_ns: int) -> int:
        """Number of ticks missed in the last RECENT_S."""
        while self._latest and now_ns - self._latest[0][0] > RECENT_S * 1e9:
            self._latest.popleft()
        return sum(missed for _, missed in self._latest)
