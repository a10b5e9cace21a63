"""Recording: a tray, its buses and a clock, to a log file. The same on the aircraft and on a simulated clock."""

from collections.abc import Callable
from pathlib import Path
from threading import Event as Never
from typing import NamedTuple

from daq import luggage, wiring
from daq.bus import Buses
from daq.clock import Clock
from daq.config import Tray
from daq.loop import Stop, turns
from daq.recorder import Recorder, new_log_path, open_recorder
from daq.salvage import complete_unfinished
from daq.sensors import Sample
from daq.station import Station
from flight.aircraft import Aircraft
from flight.messages import Event

REPORT_EVERY_NS = 1_000_000_000
OWN_TOPICS = ("/time", "/daq/tick", "/daq/event")
DROPPED = "the disk did not keep up, and data were dropped"


class Recording(NamedTuple):
    """What became of a recording."""

    path: Path
    ticks: int  # that were done
    missed: int  # that were skipped
    errors: dict[str, int]  # messages without measurement, by sensor
    write_error: str  # why the end of the log may be missing; empty when it is all there


class NothingToRead(Exception):
    """Not one of the tray's buses and ports can be opened."""


def stations(tray: Tray, buses: Buses, aircraft: Aircraft | None) -> list[Station]:
    """A place in the loop for each of the tray's sensors, in the tray's order.

    Raises InputError when the configuration lacks something.
    """
    return [
        Station(table.name, table.lane, table.topics, wiring.maker(table, tray, buses, aircraft))
        for table in tray.sensors
    ]


def record(
    tray: Tray,
    *,
    buses: Buses,
    clock: Clock,
    log_path: str | Path | None = None,
    until_ns: int | None = None,
    stop: Stop | None = None,
    progress: Callable[[float], None] | None = None,
    on_event: Callable[[Event], None] | None = None,
) -> Recording:
    """Record the tray to a new log until `until_ns` (the clock's time [ns]) or until `stop` is set.

    log_path: of the log; the next free name in the tray's directory when not given. progress: told how long it has
    been recording [s], once a second of the clock, from the sampling thread; so is on_event of each event.
    Raises InputError before anything is written (configuration, files that cannot be read, a log that exists), and
    NothingToRead when no bus and no port can be opened.
    """
    bags = luggage.pack(tray)
    places = stations(tray, buses, bags.aircraft)
    start_ns = clock.now_ns()
    causes = [place.open(start_ns) for place in places]
    if all(causes):
        raise NothingToRead(f"none of the tray's buses and ports can be opened: {'; '.join(sorted(set(causes)))}")
    path = Path(log_path) if log_path is not None else new_log_path(Path(tray.directory))
    news = salvage_events(path.parent) if log_path is None else []
    recorder = open_recorder(path, offset_ns=clock.unix_ns() - start_ns)
    tell = on_event or (lambda event: None)
    ticks = missed = 0
    disk = DiskWatch(recorder)
    report_ns = start_ns
    try:
        begin(recorder, bags, places, rate_Hz=tray.rate_Hz, start_ns=start_ns)
        news.append(Event(sensor="daq", text=f"recording {path}"))
        for event in news:
            tell(event)
        recorder.write([Sample("/daq/event", start_ns, event) for event in news], tick=0, now_ns=start_ns)
        for turn in turns(places, rate_Hz=tray.rate_Hz, clock=clock, stop=stop or Never(), until_ns=until_ns):
            ticks, missed = ticks + 1, missed + turn.beat.missed
            events = turn.events + disk.events()
            for event in events:
                tell(event)
            recorder.write(
                turn.samples + [Sample("/daq/event", turn.now_ns, event) for event in events],
                tick=turn.beat.number,
                now_ns=turn.now_ns,
            )
            if progress is not None and turn.now_ns >= report_ns:
                progress((turn.now_ns - start_ns) / 1e9)
                report_ns += REPORT_EVERY_NS
            if recorder.lost:
                break
    finally:
        recorder.close()
    errors = {place.name: place.health.errors for place in places}
    return Recording(path, ticks, missed, errors, recorder.error or (DROPPED if recorder.lost else ""))


def begin(recorder: Recorder, bags: luggage.Luggage, places: list[Station], *, rate_Hz: float, start_ns: int) -> None:
    """What stands at the start of a log: the luggage, and every topic, also those on which nothing may ever come."""
    start_unix_ns = start_ns + recorder.offset_ns
    luggage.stow(recorder.log, bags, rate_Hz=rate_Hz, start_unix_ns=start_unix_ns, start_monotonic_ns=start_ns)
    for topic in [*(topic for place in places for topic in place.topics), *OWN_TOPICS]:
        recorder.log.declare(topic)


def salvage_events(directory: Path) -> list[Event]:
    """Complete what earlier power cuts left unfinished in `directory`; that it fails is no reason not to record."""
    try:
        done = complete_unfinished(directory)
    except OSError as error:
        return [Event(severity="warning", sensor="daq", text=f"an unfinished log could not be completed: {error}")]
    return [
        Event(
            sensor="daq", text=f"{path} was unfinished and is complete now: {kept} bytes kept, {cut} torn ones cut off"
        )
        for path, kept, cut in done
    ]


class DiskWatch:
    """Tells once when the disk stops taking data, and once when it takes them again."""

    def __init__(self, recorder: Recorder):
        self._recorder = recorder
        self._error = ""

    def events(self) -> list[Event]:
        error, before = self._recorder.error, self._error
        self._error = error
        if error and not before:
            return [Event(severity="error", sensor="daq", text=f"cannot write the log, keeping it in memory: {error}")]
        if before and not error:
            return [Event(sensor="daq", text="the log is being written again, nothing was lost")]
        return []
