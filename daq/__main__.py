"""The command `daq`: record the tray, say whether it is fit to fly, look into a log, print an example tray."""

import ctypes
import gc
import os
import shutil
import signal
import sys
import threading
from importlib import resources
from pathlib import Path
from typing import Annotated

import typer

from daq.notify import ALIVE, READY, STOPPING, notify
from flight.errors import InputError
from flight.messages import Event

BAD_INPUT, FAILURE = 2, 1
THREAD_STACK_BYTES = 512 * 1024
UNIT_PRIORITY = 50  # CPUSchedulingPriority in systemd/flightpower-daq.service
SWITCH_S = 0.001  # the sampling thread waits at most this long for another one that computes
M_MMAP_THRESHOLD, M_ARENA_MAX = -3, -8  # malloc.h
LARGE_BYTES = 128 * 1024
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4  # sys/mman.h; the last: what is touched, not all that is mapped

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="""Records the sensors of the tray on a fixed grid of ticks into a log (MCAP) that `analyze` reads.

    First time: `daq config --example > tray.toml`, edit it, `daq check --config tray.toml`, then
    `daq run --config tray.toml`; stop with Ctrl-C.

    Leaves with 0 when all is well, 1 when something failed while running, 2 when input or configuration is wrong.
    """,
)


@app.command()
def run(
    config: Annotated[Path, typer.Option("--config", "-c", help="The tray: which sensors, where, how fast.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The log; otherwise the next free log-NNNN.mcap.")
    ] = None,
    duration_s: Annotated[
        float | None,
        typer.Option("--duration", min=0.0, help="Stop after this many seconds."),
    ] = None,
    record_bus: Annotated[
        Path | None,
        typer.Option(help="Also write every transaction of the buses to this file, to be played back in a test."),
    ] = None,
) -> None:
    """Record until SIGTERM or Ctrl-C, which finish the file properly. SIGHUP begins a new one.

    A sensor that fails is logged as failed and tried again twice a second; the others go on. Events go to stderr and
    into the log.
    """
    from daq.bus import LinuxBuses
    from daq.bus_recording import BusRecording
    from daq.clock import SystemClock
    from daq.config import load_tray
    from daq.daemon import NothingToRead, record
    from daq.telemetry import TelemetryLink

    tray = load_tray(config)
    stop, new_file = threading.Event(), threading.Event()
    had_terminal = has_terminal()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    # A hang-up asks for a new file, unless it is the terminal that has gone: then nobody could stop us any more.
    signal.signal(signal.SIGHUP, lambda *_: (stop if had_terminal and not has_terminal() else new_file).set())
    clock = SystemClock()
    bus_recording = BusRecording(record_bus, clock) if record_bus else None
    link = TelemetryLink(tray.telemetry, tray) if tray.telemetry else None
    prepare_process()
    terminal = StatusLine()
    ready = False

    def report(line: str) -> None:
        nonlocal ready
        notify(ALIVE if ready else READY, f"STATUS={line}")
        terminal.show(line)
        ready = True

    def tell(event: Event) -> None:
        terminal.clear()
        show(event)

    try:
        recording = record(
            tray,
            buses=LinuxBuses(),
            clock=clock,
            log_path=output,
            until_ns=None if duration_s is None else clock.now_ns() + round(duration_s * 1e9),
            stop=stop,
            new_file=new_file,
            watched=True,
            listener=link,
            bus_recording=bus_recording,
            report=report,
            on_event=tell,
        )
    except NothingToRead as error:
        complain(f"daq: {error}")
        raise typer.Exit(FAILURE) from None
    finally:
        notify(STOPPING)
        terminal.clear()
        if link is not None:
            link.close()
        if bus_recording is not None and (cause := bus_recording.close()):
            complain(f"daq: the end of the bus recording is missing: {cause}")
    faults = ", ".join(f"{name} {count}" for name, count in recording.errors.items() if count)
    logs = ", ".join(str(path) for path in recording.paths) or "no log"
    complain(f"{logs}: {recording.ticks} ticks, {recording.missed} missed; without measurement: {faults or 'none'}")
    if recording.write_error:
        complain(f"daq: a part of the recording is missing: {recording.write_error}")
        # Not `Exit`: a thread that waits for a dead disk must not keep the process.
        sys.stderr.flush()
        os._exit(FAILURE)


def complain(line: str) -> None:
    """A line on stderr; nobody may be there any more to read it."""
    try:
        print(line, file=sys.stderr, flush=True)
    except OSError:
        return


def show(event: Event) -> None:
    """An event, for the journal: <n> is the priority that systemd takes off again (sd-daemon(3))."""
    priority = {"error": "<3>", "warning": "<4>"}.get(event.severity, "<6>")
    complain(f"{priority if 'JOURNAL_STREAM' in os.environ else ''}{event.text}")


def has_terminal() -> bool:
    """Whether somebody sits at a terminal that we belong to."""
    try:
        os.close(os.open("/dev/tty", os.O_RDONLY | os.O_NOCTTY))
    except OSError:
        return False
    return True


class StatusLine:
    """One line at the bottom of a terminal that is written over once a second; nothing where there is no terminal."""

    def __init__(self) -> None:
        self._on = sys.stderr.isatty()

    def show(self, line: str) -> None:
        self._write(f"\r{line[: shutil.get_terminal_size().columns - 1]}\x1b[K")

    def clear(self) -> None:
        self._write("\r\x1b[K")

    def _write(self, text: str) -> None:
        if self._on:
            try:
                sys.stderr.write(text)
                sys.stderr.flush()
            except OSError:
                self._on = False


def prepare_process() -> None:
    """Keep the collector of reference cycles off what lives for ever, our memory off the swap, and threads small."""
    gc.collect()
    gc.freeze()
    threading.stack_size(THREAD_STACK_BYTES)  # locked memory is used memory
    sys.setswitchinterval(SWITCH_S)
    libc = ctypes.CDLL(None)
    if hasattr(libc, "mallopt"):  # glibc
        libc.mallopt(M_ARENA_MAX, 1)  # one heap for all threads: a heap each would grow with each
        # What is large goes back to the system when it is freed; left to itself, glibc keeps ever larger blocks.
        libc.mallopt(M_MMAP_THRESHOLD, LARGE_BYTES)
    # Refused without the right to (LimitMEMLOCK): then it is not.
    libc.mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT)


def step_ahead() -> None:
    """Take the real-time priority that the unit gives to `run`, where that is allowed.

    Otherwise what else the machine does would look like a bus that hangs.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(UNIT_PRIORITY))
    except OSError:
        return


@app.command()
def zero(
    config: Annotated[Path, typer.Option("--config", "-c", help="The tray.")],
    seconds: Annotated[float, typer.Option(min=4.0, help="How long to measure.")] = 10.0,
) -> None:
    """Take the still-air zero of pressure differences and gyroscopes; it travels in every log from then on.

    The probe covered, the aircraft at rest, the motor off, everything switched on for some minutes. Leaves with 1, and
    keeps an older zero as it was, when it was not still.
    """
    from daq.bus import LinuxBuses
    from daq.clock import SystemClock
    from daq.config import load_tray
    from daq.survey import survey
    from daq.zero import NotStill, measure, save

    tray, clock = load_tray(config), SystemClock()
    prepare_process()
    step_ahead()
    try:
        found = survey(tray, buses=LinuxBuses(), clock=clock, seconds=seconds, watched=True)
        new = measure(found.samples, ticks=found.ticks, seconds=seconds, unix_ns=clock.unix_ns())
    except NotStill as error:
        for line in str(error).splitlines():
            typer.echo(f"daq: no zero: {line}", err=True)
        raise typer.Exit(FAILURE) from None
    save(new, Path(tray.zero))
    for topic, fields in new.readings.items():
        for name, reading in fields.items():
            typer.echo(f"{topic:16} {name:28} {reading.mean: .5g} ± {reading.standard_deviation:.2g}")
    typer.echo(f"{tray.zero}: travels in every log from now on")


@app.command()
def check(
    config: Annotated[Path, typer.Option("--config", "-c", help="The tray.")],
    seconds: Annotated[float, typer.Option(min=1.0, help="How long to look.")] = 5.0,
    as_json: Annotated[bool, typer.Option("--json", help="For machines.")] = False,
) -> None:
    """Is the tray fit to fly? Reads every sensor for a few seconds; leaves with 1 when something is wrong.

    Stop the service first: two readers on one bus disturb each other.
    """
    from rich.console import Console
    from rich.table import Table

    from daq import check as checking
    from daq.bus import LinuxBuses
    from daq.clock import SystemClock
    from daq.config import load_tray

    tray = load_tray(config)
    prepare_process()
    step_ahead()
    report = checking.examine(tray, buses=LinuxBuses(), clock=SystemClock(), seconds=seconds, watched=True)
    if as_json:
        typer.echo(checking.as_json(report))
    else:
        table = Table("", "topic", "part", "Hz", "value ± scatter", "bus errors", "trouble, and what to do", box=None)
        for line in report.lines:
            mark = {True: "[green]ok", False: "[bold red]BAD", None: "[yellow]?"}[line.ok]
            trouble = "\n".join(filter(None, (line.trouble, line.advice)))
            values = "\n".join(filter(None, line.values))
            table.add_row(mark, line.topic, line.identity, f"{line.rate_Hz:.1f}", values, str(line.bus_errors), trouble)
        console = Console()
        console.print(table)
        for fact in report.facts:
            mark = "[green]ok " if fact.ok else "[bold red]BAD"
            console.print(f" {mark}[/] {fact.text}", highlight=False)
        console.print("[bold green]fit to fly" if report.fit else "[bold red]not fit to fly")
    if not report.fit:
        raise typer.Exit(FAILURE)


@app.command()
def info(log: Annotated[Path, typer.Argument(help="A log, finished or torn.")]) -> None:
    """What is in a log: its topics, their rates and how many readings failed, and what travels along."""
    from rich.console import Console
    from rich.table import Table

    from daq.summary import summarise

    summary = summarise(log)
    console = Console()
    for line in summary.lines:
        console.print(line, highlight=False)
    table = Table("topic", "messages", "Hz", "without measurement", box=None)
    for row in summary.topics:
        table.add_row(row.topic, str(row.messages), f"{row.rate_Hz:.1f}", row.failures or "-")
    console.print(table)


@app.command()
def config(
    example: Annotated[bool, typer.Option("--example", help="Print an example tray with every sensor.")] = False,
    check: Annotated[Path | None, typer.Option("--check", help="Say whether this tray file is right.")] = None,
    unit: Annotated[Path | None, typer.Option("--unit", help="Print what systemd has to know of this tray.")] = None,
) -> None:
    """Print an example configuration, or check one."""
    if unit is not None:
        from daq.config import load_tray
        from daq.unit import drop_in

        typer.echo(drop_in(load_tray(unit)), nl=False)
        return
    if check is not None:
        from daq import luggage
        from daq.config import load_tray

        tray = load_tray(check)
        luggage.pack(tray)
        typer.echo(f"{check}: {len(tray.sensors)} sensors at {tray.rate_Hz:g} Hz")
    elif example:
        typer.echo(resources.files("daq").joinpath("tray.example.toml").read_text("utf-8"), nl=False)
    else:
        raise InputError("daq config: give --example, --check FILE or --unit FILE")


def main() -> None:
    """Entry point: wrong input is one line on stderr and exit code 2."""
    try:
        app()
    except InputError as error:
        print(f"daq: {error}", file=sys.stderr)
        sys.exit(BAD_INPUT)


if __name__ == "__main__":
    main()
