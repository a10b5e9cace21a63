"""A bus, or the ports, and the sensors on it: read one after the other, without ever holding up the other lanes.

A transfer on a hanging bus takes as long as its timeout, which no tick at 100 Hz has room for, and a bad bus driver in
the kernel may take longer than it was told; a serial line has been seen to hold up its reader for 300 ms on a busy
machine, though it was told not to wait. So they are read by threads of their own, which wait for I/O and little else.
What a bus has not brought by the deadline is lost for that tick, what a line brings late is logged late, and either is
left alone until it comes back.
"""

import threading
from collections.abc import Sequence
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


NOTHING = LaneTurn([], [], {})


class Lane:
    """Stations that are read in turn. Once a transfer on a bus hangs, the others on it are passed over in that tick."""

    def __init__(self, stations: Sequence[Station], clock: Clock):
        self.name = ", ".join(dict.fromkeys(station.lane for station in stations))
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
        hung: set[str] = set()
        for station in self._stations:
            if station.lane in hung:
                samples += station.pass_over(begin_ns)
                continue
            samples += station.turn(begin_ns)
            if station.hung:
                hung.add(station.lane)
            if station.events:
                events += station.events
                station.events.clear()
            end_ns = self._clock.now_ns()
            durations[station.name] = end_ns - begin_ns
            begin_ns = end_ns
        return LaneTurn(samples, events, durations)


class WatchedLane(Lane):
    """A lane read by a thread of its own, for a real clock: `finish` keeps its deadline whatever the lane does.

    waits: for the parts' answers, as on a bus; then a tick without answer is a timeout, and one that comes late is not
    taken for another tick's. A line only gives what has arrived: late is as good as in time.
    """

    def __init__(self, stations: Sequence[Station], clock: Clock, *, waits: bool):
        super().__init__(stations, clock)
        self._waits = waits
        self._go, self._done = threading.Lock(), threading.Lock()  # as signals: taken until somebody lets go
        self._go.acquire()
        self._done.acquire()
        self._busy = False  # a turn that missed its deadline is still under way
        self._begun_ns = 0
        self._result = NOTHING
        self._late = NOTHING
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
        wait_s = max(0.0, (deadline_ns - self._clock.now_ns()) / 1e9)
        late, self._late = self._late, NOTHING
        if not self._busy and self._done.acquire(timeout=wait_s):
            turn = self._result
            return LaneTurn(late.samples + turn.samples, late.events + turn.events, turn.durations_ns)
        self._busy = True
        now_ns = self._clock.now_ns()
        silent = now_ns - self._begun_ns > SILENCE_NS
        samples, events = late.samples, late.events
        if silent and not self._told:
            self._told = True
            text = f"{self.name} hangs: it gave no answer for 0.5 s"
            events = [*events, Event(severity="error", sensor="daq", text=text)]
        if self._waits or silent:
            samples = [*samples, *(sample for station in self._stations for sample in station.pass_over(now_ns))]
        return LaneTurn(samples, events, {})

    def _take_late(self) -> None:
        """A turn came to its end after its tick."""
        self._busy = False
        events = self._result.events
        if self._told:
            self._told = False
            events = [*events, Event(sensor="daq", text=f"{self.name} answers again")]
        self._late = LaneTurn([] if self._waits else self._result.samples, events, {})

    def _work(self) -> None:
        while True:
            self._go.acquire()
            self._result = self._turn()
            self._done.release()


def lanes_of(stations: Sequence[Station], clock: Clock, *, watched: bool) -> list[Lane]:
    """The lanes, in the order of the stations. watched: each bus has a thread of its own, and all ports share one."""
    if not watched:
        return [Lane(group, clock) for group in _grouped(stations)]
    buses = _grouped([station for station in stations if station.may_hang])
    ports = [station for station in stations if not station.may_hang]
    lanes = [WatchedLane(group, clock, waits=True) for group in buses]
    return [*lanes, *([WatchedLane(ports, clock, waits=False)] if ports else [])]


def _grouped(stations: Sequence[Station]) -> list[list[Station]]:
    names = dict.fromkeys(station.lane for station in stations)
    return [[station for station in stations if station.lane == name] for name in names]
