"""Recording: a tray, its buses and a clock, to log files. The same on the aircraft and on a simulated clock."""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Protocol

from daq import luggage, wiring
from daq.arm import ArmSwitch
from daq.bus import Buses
from daq.bus_recording import BusRecording
from daq.clock import Clock
from daq.config import SensorTable, Tray
from daq.health import State
from daq.keeper import Keeper
from daq.logbook import Limits, Logbook, numbered, parts_of
from daq.loop import Stop, Turn, turns
from daq.recorder import Recorder
from daq.salvage import complete_unfinished
from daq.sensors import Sample
from daq.station import Station
from flight.aircraft import Aircraft
from flight.errors import InputError
from flight.messages import Event

REPORT_EVERY_NS = 1_000_000_000
OWN_TOPICS = ("/time", "/daq/tick", "/daq/event")


class Recording(NamedTuple):
    """What became of a recording."""

    paths: list[Path]  # the logs, in order
    ticks: int  # that were done
    missed: int  # that were skipped
    errors: dict[str, int]  # messages without measurement, by sensor
    write_error: str  # why a part of it may be missing; empty when it is all there

    @property
    def path(self) -> Path:
        """The first log."""
        return self.paths[0]


class NothingToRead(Exception):
    """Not one of the tray's buses and ports can be opened."""


class Listener(Protocol):
    """Somebody who is told every turn, in the sampling thread: it must not wait and must not raise."""

    def hear(self, turn: Turn, events: list[Event]) -> None: ...


def stations(
    tray: Tray, buses: Buses, aircraft: Aircraft | None, bus_recording: BusRecording | None = None
) -> list[Station]:
    """A place in the loop for each of the tray's sensors, in the tray's order.

    Raises InputError when the configuration lacks something.
    """

    def maker(table: SensorTable) -> wiring.Maker:
        if bus_recording is None:
            return wiring.maker(table, tray, buses, aircraft)
        ear = bus_recording.sensor(table.name)
        return ear.maker(wiring.maker(table, tray, ear.buses(buses), aircraft))

    return [
        Station(table.name, table.lane, table.topics, maker(table), may_hang=table.may_hang) for table in tray.sensors
    ]


def open_all(places: list[Station], now_ns: int) -> None:
    """Open the buses and ports; raises NothingToRead when not one can be."""
    causes = [place.open(now_ns) for place in places]
    if all(causes):
        raise NothingToRead(f"none of the tray's buses and ports can be opened: {'; '.join(sorted(set(causes)))}")


def record(
    tray: Tray,
    *,
    buses: Buses,
    clock: Clock,
    log_path: str | Path | None = None,
    until_ns: int | None = None,
    stop: Stop | None = None,
    new_file: threading.Event | None = None,
    watched: bool = False,
    listener: Listener | None = None,
    bus_recording: BusRecording | None = None,
    progress: Callable[[float], None] | None = None,
    report: Callable[[str], None] | None = None,
    on_event: Callable[[Event], None] | None = None,
) -> Recording:
    """Record the tray to new logs until `until_ns` (the clock's time [ns]) or until `stop` is set.

    log_path: of the first log; the next free name in the tray's directory when not given. new_file: set by whoever
    wants a new log begun. watched: see `turns`. bus_recording: is given every transaction of the buses. progress: told
    how long it has been going on [s], once a second of the clock, from the sampling thread; so are report of a line
    that says how it goes, and on_event of each event.
    Raises InputError before anything is written (configuration, files that cannot be read, a log that exists), and
    NothingToRead when no bus and no port can be opened.
    """
    bags = luggage.pack(tray)
    places = stations(tray, buses, bags.aircraft, bus_recording)
    if bus_recording is not None:
        bus_recording.begin(tray.text, bags.aircraft)
    start_ns = clock.now_ns()
    open_all(places, start_ns)
    path = Path(log_path) if log_path is not None else None
    directory = Path(tray.directory) if path is None else path.parent
    name = numbered(directory) if path is None else parts_of(path)
    news = salvage_events(directory) if path is None else []
    keeper = Keeper(directory, round(tray.files.keep_free_MB * 1e6), tray.files.when_full)
    keeper.look()
    if path is not None and not keeper.room:
        raise InputError(f"{path}: {keeper.events()[0].text}")

    def begin(recorder: Recorder, number: int, now_ns: int, before: Path | None) -> None:
        at_start(recorder, bags, places, rate_Hz=tray.rate_Hz, start_ns=now_ns, number=number, before=before)

    offset_ns = clock.unix_ns() - start_ns
    limits = Limits(round(tray.files.new_after_min * 60e9), round(tray.files.new_after_MB * 1e6))
    book = Logbook(name, begin, offset_ns=offset_ns, limits=limits, keeper=keeper)
    switch = ArmSwitch(tray.arm)
    if keeper.room and switch.recording:
        book.open(start_ns)
    keeper.start()
    tell = on_event or (lambda event: None)
    ticks = missed = 0
    report_ns = start_ns
    try:
        for turn in turns(
            places,
            rate_Hz=tray.rate_Hz,
            clock=clock,
            stop=stop or threading.Event(),
            until_ns=until_ns,
            watched=watched,
        ):
            ticks, missed = ticks + 1, missed + turn.beat.missed
            asked = new_file is not None and new_file.is_set()
            if asked and new_file is not None:
                new_file.clear()
            switched = switch.look(turn.samples)
            events = news + turn.events + switched
            events += book.attend(turn.now_ns, wanted=switch.recording, new_file=asked)
            news = []
            for event in events:
                tell(event)
            book.write(
                turn.samples + [Sample("/daq/event", turn.now_ns, event) for event in events],
                tick=turn.beat.number,
                now_ns=turn.now_ns,
            )
            if listener is not None:
                listener.hear(turn, events)
            if turn.now_ns >= report_ns:
                report_ns += REPORT_EVERY_NS * (1 + (turn.now_ns - report_ns) // REPORT_EVERY_NS)
                elapsed_s = (turn.now_ns - start_ns) / 1e9
                if progress is not None:
                    progress(elapsed_s)
                if report is not None:
                    report(status_line(elapsed_s, ticks, missed, places, book, keeper, armed=switch.recording))
    finally:
        write_error = book.close()
    if book.dropped:
        write_error = write_error or f"the disk did not keep up, and {book.dropped} messages were dropped"
    if not keeper.room:
        write_error = write_error or f"there was no room left at {directory}"
    return Recording(book.paths, ticks, missed, {place.name: place.errors for place in places}, write_error)


def at_start(
    recorder: Recorder,
    bags: luggage.Luggage,
    places: list[Station],
    *,
    rate_Hz: float,
    start_ns: int,
    number: int,
    before: Path | None,
) -> None:
    """What stands at the start of a log: the luggage, and every topic, also those on which nothing may ever come."""
    luggage.stow(
        recorder.log,
        bags,
        rate_Hz=rate_Hz,
        start_unix_ns=start_ns + recorder.offset_ns,
        start_monotonic_ns=start_ns,
        part=number + 1,
        before=before.name if before else "",
    )
    for topic in [*(topic for place in places for topic in place.topics), *OWN_TOPICS]:
        recorder.log.declare(topic)


def status_line(
    elapsed_s: float, ticks: int, missed: int, places: list[Station], book: Logbook, keeper: Keeper, *, armed: bool
) -> str:
    """How it goes, in one line for people."""
    bad = [f"{place.name} {place.health.state}" for place in places if place.health.state is not State.OK]
    if book.recording:
        what = f"recording {book.path.name if book.path else 'to memory'}"
    else:
        what = "NOT RECORDING: the card is full" if armed else "waiting for the arm switch"
    trouble = f"{book.error}; " if book.error else ""
    room = "" if keeper.free_bytes < 0 else f", {keeper.free_bytes / 1e9:.1f} GB free"
    return f"{what}, {elapsed_s:.0f} s, {ticks} ticks, {missed} missed{room}; {trouble}{', '.join(bad) or 'all well'}"


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
