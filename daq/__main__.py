"""The command `daq`: record the tray, check it before flight, take its zero, summarise a log, print an example."""

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

from daq.systemd_notify import ALIVE, READY, STOPPING, is_service, notify
from flight.errors import InputError
from flight.messages import Event

BAD_INPUT, FAILURE = 2, 1
THREAD_STACK_BYTES = 512 * 1024
UNIT_PRIORITY = 50  # CPUSchedulingPriority in systemd/flightpower-daq.service
SWITCH_S = 0.001  # the sampling thread waits at most this long for another computing thread
M_MMAP_THRESHOLD, M_ARENA_MAX = -3, -8  # malloc.h
LARGE_BYTES = 128 * 1024
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4  # sys/mman.h; ONFAULT locks pages when they are first used

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="""Records the sensors of the tray at a fixed rate into a log (MCAP) that `analyze` reads.

    To begin: `daq config --example > tray.toml`, edit it, `daq check --config tray.toml`, then
    `daq run --config tray.toml`; stop with Ctrl-C.

    Exit code: 0 on success, 1 when something failed while running, 2 when input or configuration is wrong or another
    program uses the tray.
    """,
)


@app.command()
def run(
    config: Annotated[Path, typer.Option("--config", "-c", help="The tray file: sensors, buses, rates.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The log; by default the next free log-NNNN.mcap.")
    ] = None,
    duration_s: Annotated[
        float | None,
        typer.Option("--duration", min=0.0, help="Stop after this many seconds."),
    ] = None,
    record_bus: Annotated[
        Path | None,
        typer.Option(help="Also write every bus transaction to this file, to replay it in a test."),
    ] = None,
) -> None:
    """Record until SIGTERM or Ctrl-C, which finish the log. SIGHUP starts a new log.

    A sensor that fails is logged as failed and restarted twice a second; the others are not affected. Events are
    written to stderr and into the log.
    """
    from daq.bus import LinuxBuses
    from daq.bus_recording import BusRecording
    from daq.clock import SystemClock
    from daq.config import load_tray
    from daq.daemon import NoDeviceOpened, check_configuration, record
    from daq.telemetry import TelemetryLink

    tray, buses = load_tray(config), LinuxBuses()
    check_configuration(tray, buses)
    stop, new_file = threading.Event(), threading.Event()
    had_terminal = has_terminal()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    # SIGHUP requests a new file. If the terminal has closed, it ends the recording: nobody could stop it any more.
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

    def on_event(event: Event) -> None:
        terminal.clear()
        show_event(event)

    try:
        recording = record(
            tray,
            buses=buses,
            clock=clock,
            log_path=output,
            until_ns=None if duration_s is None else clock.now_ns() + round(duration_s * 1e9),
            stop=stop,
            new_file=new_file,
            threaded=True,
            listener=link,
            bus_recording=bus_recording,
            report=report,
            on_event=on_event,
        )
    except (NoDeviceOpened, InputError) as error:
        if isinstance(error, InputError) and not is_service():
            raise
        print_error(f"daq: {error}")
        raise typer.Exit(FAILURE) from None
    finally:
        notify(STOPPING)
        terminal.clear()
        if link is not None:
            link.close()
        if bus_recording is not None and (cause := bus_recording.close()):
            print_error(f"daq: the end of the bus recording is missing: {cause}")
    faults = ", ".join(f"{name} {count}" for name, count in recording.errors.items() if count)
    logs = ", ".join(str(path) for path in recording.paths) or "no log"
    print_error(
        f"{logs}: {recording.ticks} ticks, {recording.missed} missed; messages without measurement: {faults or 'none'}"
    )
    if recording.write_error:
        print_error(f"daq: a part of the recording is missing: {recording.write_error}")
        # Not `Exit`: a thread that waits for a failed disk would keep the process alive.
        sys.stderr.flush()
        os._exit(FAILURE)


def print_error(line: str) -> None:
    """Print a line to stderr, which may be closed."""
    try:
        print(line, file=sys.stderr, flush=True)
    except OSError:
        return


def show_event(event: Event) -> None:
    """Print an event. Under systemd the prefix <n> is its priority in the journal (sd-daemon(3))."""
    priority = {"error": "<3>", "warning": "<4>"}.get(event.severity, "<6>")
    print_error(f"{priority if 'JOURNAL_STREAM' in os.environ else ''}{event.text}")


def has_terminal() -> bool:
    """Whether the process has a controlling terminal."""
    try:
        os.close(os.open("/dev/tty", os.O_RDONLY | os.O_NOCTTY))
    except OSError:
        return False
    return True


class StatusLine:
    """A line on the terminal that is overwritten once a second. Does nothing when stderr is not a terminal."""

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
    """Set up for low latency: no garbage collection of permanent objects, locked memory, small thread stacks."""
    gc.collect()
    gc.freeze()
    threading.stack_size(THREAD_STACK_BYTES)  # all of a thread's stack is locked in memory
    sys.setswitchinterval(SWITCH_S)
    libc = ctypes.CDLL(None)
    if hasattr(libc, "mallopt"):  # glibc
        libc.mallopt(M_ARENA_MAX, 1)  # one heap for all threads, instead of a growing one for each
        # Large blocks are returned to the system when freed; by default, glibc keeps larger and larger ones.
        libc.mallopt(M_MMAP_THRESHOLD, LARGE_BYTES)
    # Fails without the permission (LimitMEMLOCK); then memory is not locked.
    libc.mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT)


def raise_priority() -> None:
    """Use the real-time priority that the systemd unit gives to `run`, if permitted.

    Without it, other programs' load can look like a hanging bus.
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
    """Take the still-air zero of pressure differences and gyroscopes, to be attached to every later log.

    Cover the probe, leave the aircraft at rest with the motor off, everything switched on for some minutes. If the
    readings are not steady, the exit code is 1 and an existing zero is kept.
    """
    from daq.bus import LinuxBuses
    from daq.clock import SystemClock
    from daq.config import load_tray
    from daq.dry_run import dry_run
    from daq.still_air_zero import NotStill, save_zero, zero_from_samples

    tray, clock = load_tray(config), SystemClock()
    prepare_process()
    raise_priority()
    try:
        readings = dry_run(tray, buses=LinuxBuses(), clock=clock, seconds=seconds, threaded=True)
        new = zero_from_samples(readings.samples, ticks=readings.ticks, seconds=seconds, unix_ns=clock.unix_ns())
    except NotStill as error:
        for line in str(error).splitlines():
            typer.echo(f"daq: no zero taken: {line}", err=True)
        raise typer.Exit(FAILURE) from None
    save_zero(new, Path(tray.zero))
    for topic, fields in new.readings.items():
        for name, reading in fields.items():
            typer.echo(f"{topic:16} {name:28} {reading.mean: .5g} ± {reading.standard_deviation:.2g}")
    typer.echo(f"{tray.zero}: attached to every log from now on")


@app.command()
def check(
    config: Annotated[Path, typer.Option("--config", "-c", help="The tray.")],
    seconds: Annotated[float, typer.Option(min=1.0, help="How long to read.")] = 5.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Check whether the tray is fit to fly: read every sensor for a few seconds. Exit code 1 if a check fails.

    Stop the service first: while it records, the exit code is 2.
    """
    from rich.console import Console
    from rich.table import Table

    from daq import tray_check
    from daq.bus import LinuxBuses
    from daq.clock import SystemClock
    from daq.config import load_tray

    tray = load_tray(config)
    prepare_process()
    raise_priority()
    report = tray_check.check_tray(tray, buses=LinuxBuses(), clock=SystemClock(), seconds=seconds, threaded=True)
    if as_json:
        typer.echo(tray_check.as_json(report))
    else:
        table = Table(
            "", "topic", "part", "Hz", "value ± standard deviation", "bus errors", "problem and advice", box=None
        )
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
def info(log: Annotated[Path, typer.Argument(help="A log; may be unfinished.")]) -> None:
    """Summarise a log: topics, rates, failed readings and attachments."""
    from rich.console import Console
    from rich.table import Table

    from daq.log_summary import summarise

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
    check: Annotated[Path | None, typer.Option("--check", help="Check this tray file.")] = None,
    unit: Annotated[Path | None, typer.Option("--unit", help="Print the systemd drop-in for this tray.")] = None,
) -> None:
    """Print an example configuration, check one, or print its systemd drop-in."""
    if unit is not None:
        from daq.config import load_tray
        from daq.systemd_unit import unit_drop_in

        typer.echo(unit_drop_in(load_tray(unit)), nl=False)
        return
    if check is not None:
        from daq.attachments import load_attachments
        from daq.config import load_tray

        tray = load_tray(check)
        load_attachments(tray)
        typer.echo(f"{check}: {len(tray.sensors)} sensors at {tray.rate_Hz:g} Hz")
    elif example:
        typer.echo(resources.files("daq").joinpath("tray.example.toml").read_text("utf-8"), nl=False)
    else:
        raise InputError("daq config: give --example, --check FILE or --unit FILE")


def main() -> None:
    """Entry point. Wrong input gives one line on stderr and exit code 2."""
    try:
        app()
    except InputError as error:
        print(f"daq: {error}", file=sys.stderr)
        sys.exit(BAD_INPUT)


if __name__ == "__main__":
    main()
