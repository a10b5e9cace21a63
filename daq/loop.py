"""The sampling loop: every sensor once a tick, ticks on an absolute grid."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

from daq.clock import Clock
from daq.lane import lanes_of
from daq.sensors import Sample
from daq.station import Station
from flight.messages import Event, Gps, Tick, Time

TIME_EVERY_NS = 1_000_000_000
DEADLINE = 0.8  # of a tick; the rest is for packing what came


class Stop(Protocol):
    """Says when to stop: a `threading.Event`, or anything like it."""

    def is_set(self) -> bool: ...


class Beat(NamedTuple):
    """One tick of the grid: its number, how late it began [ns], how many were skipped just before it."""

    number: int
    late_ns: int
    missed: int


class Turn(NamedTuple):
    """All that one tick brought."""

    beat: Beat
    now_ns: int
    samples: list[Sample]
    events: list[Event]


def every(period_ns: int, clock: Clock, stop: Stop, until_ns: int | None = None) -> Iterator[Beat]:
    """Beats on a fixed grid that starts now; those that were missed are skipped and counted, never made up for.

    until_ns: monotonic time of the end; the beat that falls on it is not given.
    """
    start_ns, number, missed = clock.now_ns(), 0, 0
    while not stop.is_set():
        due_ns = start_ns + number * period_ns
        if until_ns is not None and due_ns >= until_ns:
            return
        clock.sleep_until_ns(due_ns)
        yield Beat(number, clock.now_ns() - due_ns, missed)
        following = max(number + 1, -((start_ns - clock.now_ns()) // period_ns))
        number, missed = following, following - number - 1


def turns(
    stations: Sequence[Station],
    *,
    rate_Hz: float,
    clock: Clock,
    stop: Stop,
    until_ns: int | None = None,
    watched: bool = False,
) -> Iterator[Turn]:
    """Read all stations at each beat. /daq/tick closes every turn, /time comes once a second.

    watched: buses and ports are read by threads of their own and have DEADLINE of a tick for it; for a real clock.
    """
    time_due_ns = clock.now_ns()
    period_ns = round(1e9 / rate_Hz)
    gps_utc: tuple[int, int] | None = None  # (UTC, monotonic) of the latest dated solution
    lanes = lanes_of(stations, clock, watched=watched)
    for beat in every(period_ns, clock, stop, until_ns):
        begin_ns = clock.now_ns()
        deadline_ns = begin_ns - beat.late_ns + round(DEADLINE * period_ns)
        samples: list[Sample] = []
        events: list[Event] = []
        durations: dict[str, int] = {}
        for lane in lanes:
            lane.begin()
        for lane in lanes:
            brought = lane.finish(deadline_ns)
            samples += brought.samples
            events += brought.events
            durations |= brought.durations_ns
        for sample in samples:
            if isinstance(sample.message, Gps) and sample.message.utc_ns is not None:
                gps_utc = (sample.message.utc_ns, sample.time_ns)
        if begin_ns >= time_due_ns:
            time_due_ns += TIME_EVERY_NS * (1 + (begin_ns - time_due_ns) // TIME_EVERY_NS)
            samples.append(Sample("/time", clock.now_ns(), time_message(clock, gps_utc)))
        tick = Tick(late_ns=beat.late_ns, missed=beat.missed, duration_ns=durations)
        samples.append(Sample("/daq/tick", begin_ns, tick))
        yield Turn(beat, begin_ns, samples, events)


def time_message(clock: Clock, gps_utc: tuple[int, int] | None) -> Time:
    """One instant on every clock. GPS time runs on from the latest solution, and is late by the receiver's latency."""
    now_ns = clock.now_ns()
    utc_ns = None if gps_utc is None else gps_utc[0] + now_ns - gps_utc[1]
    return Time(monotonic_ns=now_ns, system_ns=clock.unix_ns(), gps_utc_ns=utc_ns)
