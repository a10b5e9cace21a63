"""One bus or port and the sensors on it: read one after the other, without ever holding up the other lanes.

A transfer on a hanging bus takes as long as its timeout, which no tick at 100 Hz has room for, and a bad bus driver in
the kernel may take longer than it was told. So a bus is read by a thread of its own, which waits for I/O and nothing
else; what it has not brought by the deadline is lost, and it is left alone until it comes back.
"""

import threading
from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

from daq.clock import Clock
from daq.sensors import Sample
from daq.station import Station
from flight.messages import Event

SILENCE_NS = 500_000_000  # of a lane that does not come back; then it is told


class LaneTurn(NamedTuple):
    """What a lane brought in one tick."""

    samples: list[Sample]
    events: list[Event]
    durations_ns: dict[str, int]  # by sensor


class Lane:
    """The stations of one bus or port. Once a transfer hangs, the stations behind it are passed over in that tick."""

    def __init__(self, stations: Sequence[Station], clock: Clock):
        self.name = stations[0].lane
        self._stations = stations
        self._clock = clock

    def begin(self) -> None:
        """Start this tick's turn, if that can be done beside others."""

    def finish(self, deadline_ns: int) -> LaneTurn:
        """This tick's turn; `deadline_ns` (monotonic) is kept by lanes that can be left alone."""
        return self._turn()

    def _turn(self) -> LaneTurn:
        samples: list[Sample] = []
        events: list[Event] = []
        durations: dict[str, int] = {}
        begin_ns = self._clock.now_ns()
        hung = False
        for station in self._stations:
            if hung:
                samples += station.pass_over(begin_ns)
                continue
            samples += station.turn(begin_ns)
            hung = station.hung
            if station.events:
                events += station.events
                station.events.clear()
            end_ns = self._clock.now_ns()
            durations[station.name] = end_ns - begin_ns
            begin_ns = end_ns
        return LaneTurn(samples, events, durations)


class WatchedLane(Lane):
    """A lane read by a thread of its own, for a real clock: `finish` keeps its deadline whatever the bus does."""

    def __init__(self, stations: Sequence[Station], clock: Clock):
        super().__init__(stations, clock)
        self._go, self._done = threading.Lock(), threading.Lock()  # as signals: taken until somebody lets go
        self._go.acquire()
        self._done.acquire()
        self._busy = False  # a turn that missed its deadline is still under way
        self._begun_ns = 0
        self._result: LaneTurn | None = None
        self._late_events: list[Event] = []
        self._told = False
        self._thread = threading.Thread(target=self._work, name=f"lane {self.name}", daemon=True)
        self._thread.start()

    def begin(self) -> None:
        if self._busy and self._done.acquire(blocking=False):
            self._take_late()
        if not self._busy:
            self._begun_ns = self._clock.now_ns()
            self._go.release()

    def finish(self, deadline_ns: int) -> LaneTurn:
        now_ns = self._clock.now_ns()
        if not self._busy and self._done.acquire(timeout=max(0.0, (deadline_ns - now_ns) / 1e9)):
            turn = self._result
            assert turn is not None
            late, self._late_events = self._late_events, []
            return turn._replace(events=late + turn.events)
        self._busy = True
        now_ns = self._clock.now_ns()
        events, self._late_events = self._late_events, []
        if not self._told and now_ns - self._begun_ns > SILENCE_NS:
            self._told = True
            events.append(Event(severity="error", sensor="daq", text=f"{self.name} hangs: it gave no answer for 0.5 s"))
        samples = [sample for station in self._stations for sample in station.pass_over(now_ns)]
        return LaneTurn(samples, events, {})

    def _take_late(self) -> None:
        """A turn came to its end after its tick: what it measured is not logged twice, what it tells is kept."""
        self._busy = False
        assert self._result is not None
        self._late_events += self._result.events
        if self._told:
            self._told = False
            self._late_events.append(Event(sensor="daq", text=f"{self.name} answers again"))

    def _work(self) -> None:
        while True:
            self._go.acquire()
            self._result = self._turn()
            self._done.release()


def lanes_of(stations: Sequence[Station], clock: Clock, *, watched: bool) -> list[Lane]:
    """A lane for each bus and port, in the order of the stations. watched: buses get threads of their own."""
    places = sorted(stations, key=lambda station: [s.lane for s in stations].index(station.lane))
    groups = [list(group) for _, group in groupby(places, key=lambda station: station.lane)]
    return [(WatchedLane if watched and group[0].may_hang else Lane)(group, clock) for group in groups]
