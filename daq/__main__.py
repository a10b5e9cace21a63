"""The command `daq`: record the tray, say whether it is fit to fly, look into a log, print an example tray."""

import ctypes
import gc
import os
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
MCL_CURRENT, MCL_FUTURE = 1, 2  # sys/mman.h

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
) -> None:
    """Record until SIGTERM, Ctrl-C or the end of the session; each finishes the file properly.

    A sensor that fails is logged as failed and tried again twice a second; the others go on. Events go to stderr and
    into the log.
    """
    from daq.bus import LinuxBuses
    from daq.clock import SystemClock
    from daq.config import load_tray
    from daq.daemon import NothingToRead, record

    tray = load_tray(config)
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda *_: stop.set())
    clock = SystemClock()
    prepare_process()
    ready = False

    def progress(elapsed_s: float) -> None:
        nonlocal ready
        notify(ALIVE if ready else READY, f"STATUS=recording, {elapsed_s:.0f} s")
        ready = True

    try:
        recording = record(
            tray,
            buses=LinuxBuses(),
            clock=clock,
            log_path=output,
            until_ns=None if duration_s is None else clock.now_ns() + round(duration_s * 1e9),
            stop=stop,
            progress=progress,
            on_event=show,
        )
    except NothingToRead as error:
        typer.echo(f"daq: {error}", err=True)
        raise typer.Exit(FAILURE) from None
    finally:
        notify(STOPPING)
    faults = ", ".join(f"{name} {count}" for name, count in recording.errors.items() if count)
    summary = f"{recording.path}: {recording.ticks} ticks, {recording.missed} missed"
    typer.echo(f"{summary}; without measurement: {faults or 'none'}", err=True)
    if recording.write_error:
        typer.echo(f"daq: the end of the log is missing: {recording.write_error}", err=True)
        raise typer.Exit(FAILURE)


def show(event: Event) -> None:
    """An event, for the journal: <n> is the priority that systemd takes off again (sd-daemon(3))."""
    priority = {"error": "<3>", "warning": "<4>"}.get(event.severity, "<6>")
    print(f"{priority if 'JOURNAL_STREAM' in os.environ else ''}{event.text}", file=sys.stderr, flush=True)


def prepare_process() -> None:
    """Keep the collector of reference cycles off what lives for ever, and our memory off the swap."""
    gc.collect()
    gc.freeze()
    ctypes.CDLL(None).mlockall(MCL_CURRENT | MCL_FUTURE)  # refused without the right to (LimitMEMLOCK): then it is not


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

    report = checking.examine(load_tray(config), buses=LinuxBuses(), clock=SystemClock(), seconds=seconds)
    if as_json:
        typer.echo(checking.as_json(report))
    else:
        table = Table("", "topic", "Hz", "value ± scatter", "trouble, and what to do", box=None)
        for line in report.lines:
            mark = {True: "[green]ok", False: "[bold red]BAD", None: "[yellow]?"}[line.ok]
            trouble = "\n".join(filter(None, (line.trouble, line.advice)))
            table.add_row(mark, line.topic, f"{line.rate_Hz:.1f}", "\n".join(filter(None, line.values)), trouble)
        console = Console()
        console.print(table)
        console.print(
            f"{report.missed} ticks missed, {report.late_ms:.1f} ms late at worst; "
            f"room for {report.free_s / 3600:.1f} h of log"
        )
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
) -> None:
    """Print an example configuration, or check one."""
    if check is not None:
        from daq import luggage
        from daq.config import load_tray

        tray = load_tray(check)
        luggage.pack(tray)
        typer.echo(f"{check}: {len(tray.sensors)} sensors at {tray.rate_Hz:g} Hz")
    elif example:
        typer.echo(resources.files("daq").joinpath("tray.example.toml").read_text("utf-8"), nl=False)
    else:
        raise InputError("daq config: give --example or --check FILE")


def main() -> None:
    """Entry point: wrong input is one line on stderr and exit code 2."""
    try:
        app()
    except InputError as error:
        print(f"daq: {error}", file=sys.stderr)
        sys.exit(BAD_INPUT)


if __name__ == "__main__":
    main()
