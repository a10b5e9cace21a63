"""The command `daq`: record the tray, check it before flight, take its zero, summarize a log, print an example.

More than 350 lines: options and help of every subcommand are here, and little else.
"""

import os
import signal
import sys
import threading
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import typer

from flightpower.daq.process_setup import prepare_process, raise_priority
from flightpower.daq.systemd_notify import ALIVE, READY, STOPPING, is_service, notify
from flightpower.daq.terminal import StatusLine, has_terminal, print_error, show_event
from flightpower.flight.command_line import ExitCode, Quantity, application
from flightpower.flight.command_line import run as run_command
from flightpower.flight.errors import InputError
from flightpower.flight.messages import Event

LONGEST_CHECK_S = 3600.0
SHOWN_LOGS = 50
SERVICE_STATUS = Path("/run/flightpower/status.json")

app = application(
    help="""Records the sensors of the tray at a fixed rate into a log (MCAP) that `analyze` reads.

    \b
    To begin:
      daq config --example > tray.toml     then edit it
      daq check --config tray.toml         are all sensors there?
      daq run --config tray.toml           stop with Ctrl-C

    Exit code: 0 on success, 1 when something failed while running, 2 when input or configuration is wrong or another
    program uses the tray.
    """,
)


TrayOption = Annotated[
    Path, typer.Option("--config", "-c", metavar="TRAY", help="The tray file: sensors, buses, rates.")
]


@app.command()
def run(
    config: TrayOption,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="The log; by default the next free log-NNNN.mcap."),
    ] = None,
    duration_s: Annotated[
        float | None,
        Quantity("--duration", "s", '"5 min"', least=0.0).as_option('Stop after this many seconds, or "5 min".'),
    ] = None,
    record_bus: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Also write every bus transaction to this file, to replay it in a test."),
    ] = None,
    status: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the state once a second to this file in /run, for `daq status`."),
    ] = None,
) -> None:
    """Record until SIGTERM or Ctrl-C, which close the log. SIGHUP starts a new log.

    A sensor that fails is logged as failed and restarted twice a second; the others are not affected. Events are
    written to stderr and into the log.

    \b
    Examples:
      daq run --config tray.toml
      daq run --config tray.toml --duration "5 min" -o test.mcap
    """
    from flightpower.daq.bus_recording import BusRecording
    from flightpower.daq.clock import SystemClock
    from flightpower.daq.config import load_tray
    from flightpower.daq.crew_light import CrewLight
    from flightpower.daq.daemon import NoDeviceOpened, check_configuration, record
    from flightpower.daq.linux_bus import LinuxBuses
    from flightpower.daq.recording_status import RecordingStatus, StatusFile

    tray, buses = load_tray(config), LinuxBuses()
    check_configuration(tray, buses)
    stop, new_file = threading.Event(), threading.Event()
    had_terminal = has_terminal()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    # SIGHUP requests a new file. If the terminal has closed, it ends the recording, which nobody could stop any more.
    signal.signal(signal.SIGHUP, lambda *_: (stop if had_terminal and not has_terminal() else new_file).set())
    clock = SystemClock()
    bus_recording = BusRecording(record_bus, clock) if record_bus else None
    link = None
    if tray.telemetry:
        from flightpower.daq.telemetry import TelemetryLink

        link = TelemetryLink(tray.telemetry, tray)
    prepare_process()
    light = CrewLight(tray.light, on_press=new_file.set) if tray.light else None
    terminal = StatusLine()
    status_file = StatusFile(status) if status else None
    ready = False

    def report(now: RecordingStatus) -> None:
        nonlocal ready
        notify(ALIVE if ready else READY, f"STATUS={now.line}")
        terminal.show(now.line)
        if status_file is not None:
            status_file.write(now)
        ready = True

    def on_event(event: Event) -> None:
        if status_file is not None:
            status_file.add(event)
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
            light=light,
        )
    except (NoDeviceOpened, InputError) as error:
        if isinstance(error, InputError) and not is_service():
            raise
        print_error(f"daq: {error}")
        raise typer.Exit(ExitCode.FAILURE) from None
    finally:
        notify(STOPPING)
        terminal.clear()
        if link is not None:
            link.close()
        if light is not None:
            light.close()
        if bus_recording is not None and (cause := bus_recording.close()):
            print_error(f"daq: the end of the bus recording is missing: {cause}")
    faults = ", ".join(f"{name} {count}" for name, count in recording.errors.items() if count)
    logs = ", ".join(str(path) for path in recording.paths) or "no log"
    print_error(
        f"{logs}: {recording.ticks} ticks, {recording.missed} missed; messages without measurement: {faults or 'none'}"
    )
    if recording.write_error:
        print_error(f"daq: a part of the recording is missing: {recording.write_error}")
        # Typer's `Exit` is not used, because a thread that waits for a failed disk would keep the process alive.
        sys.stderr.flush()
        os._exit(ExitCode.FAILURE)


def _seconds_option(least: float, text: str) -> Any:
    return Quantity("--seconds", "s", '"1 min"', least=least, most=LONGEST_CHECK_S).as_option(text)


def drivers_line() -> str:
    """A line that lists the drivers that a tray file may name; those of other packages with the name of the package."""
    from flightpower.daq.config import installed_drivers

    drivers = installed_drivers().items()
    return f"drivers: {', '.join(f'{name} ({package})' if package else name for name, package in drivers)}"


@app.command(short_help="Take the still-air zero of pressures and gyroscopes.")
def zero(
    config: TrayOption,
    seconds: Annotated[float, _seconds_option(4, "How long to measure [s].")] = 10.0,
) -> None:
    """Measure the zeros of pressure differences and gyroscopes in still air, to be attached to every later log.

    Cover the probe, leave the aircraft at rest with the motor off, everything switched on for some minutes. If the
    readings are not steady, the exit code is 1 and an existing zero is kept.

    \b
    Example:
      daq zero --config tray.toml
    """
    from flightpower.daq.clock import SystemClock
    from flightpower.daq.config import load_tray
    from flightpower.daq.dry_run import check_devices_here, dry_run
    from flightpower.daq.linux_bus import LinuxBuses
    from flightpower.daq.still_air_zero import NotStill, save_zero, zero_from_samples

    tray, clock = load_tray(config), SystemClock()
    check_devices_here(tray)
    prepare_process()
    raise_priority()
    try:
        readings = dry_run(tray, buses=LinuxBuses(), clock=clock, seconds=seconds, threaded=True)
        new = zero_from_samples(readings.samples, ticks=readings.ticks, seconds=seconds, unix_ns=clock.unix_ns())
    except NotStill as error:
        for line in str(error).splitlines():
            typer.echo(f"daq: no zero taken: {line}", err=True)
        raise typer.Exit(ExitCode.FAILURE) from None
    save_zero(new, Path(tray.zero))
    for topic, fields in new.readings.items():
        for name, reading in fields.items():
            typer.echo(f"{topic:16} {name:28} {reading.mean: .5g} ± {reading.standard_deviation:.2g}")
    typer.echo(f"{tray.zero}: attached to every log from now on")


@app.command(short_help="Check whether the tray is fit to fly.")
def check(
    config: TrayOption,
    seconds: Annotated[float, _seconds_option(1, "How long to read [s].")] = 5.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Check whether the tray is fit to fly: read every sensor for a few seconds. Exit code 1 if a check fails.

    Stop the service first: while it records, the exit code is 2.

    \b
    Example:
      daq check --config tray.toml
    """
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from flightpower.daq import tray_check
    from flightpower.daq.clock import SystemClock
    from flightpower.daq.config import load_tray
    from flightpower.daq.dry_run import check_devices_here
    from flightpower.daq.linux_bus import LinuxBuses

    tray = load_tray(config)
    check_devices_here(tray)
    prepare_process()
    raise_priority()
    report = tray_check.check_tray(tray, buses=LinuxBuses(), clock=SystemClock(), seconds=seconds, threaded=True)
    tray_check.save(report, tray)
    if as_json:
        typer.echo(tray_check.as_json(report))
    else:
        table = Table("", "topic", "part", "Hz", "value ± standard deviation", "bus errors", box=None)
        table.columns[2].overflow = "fold"  # device names are shown in full
        problems: dict[str, list[str]] = {}  # sensors by advice, which several sensors of one bus may share
        for line in report.lines:
            mark = {True: "[green]ok", False: "[bold red]BAD", None: "[yellow]?"}[line.ok]
            values = escape("\n".join(filter(None, line.values)))
            table.add_row(mark, line.topic, escape(line.identity), f"{line.rate_Hz:.1f}", values, str(line.bus_errors))
            if line.trouble or line.advice:
                named = f"{line.topic} ({line.trouble})" if line.trouble else line.topic
                problems.setdefault(line.advice, []).append(named)
        console = Console()
        console.print(table)
        for advice, topics in problems.items():
            console.print("     " + escape(": ".join(filter(None, (", ".join(topics), advice)))), highlight=False)
        for fact in report.facts:
            mark = "[green]ok " if fact.ok else "[bold red]BAD"
            console.print(f" {mark}[/] {escape(fact.text)}", highlight=False)
        console.print(f"     {escape(drivers_line())}", highlight=False)
        console.print("[bold green]fit to fly" if report.fit else "[bold red]not fit to fly")
    if not report.fit:
        raise typer.Exit(ExitCode.FAILURE)


@app.command()
def info(log: Annotated[Path, typer.Argument(metavar="LOG", help="A log, finished or not.")]) -> None:
    """Summarize a log: topics, rates, failed readings and attachments.

    \b
    Example:
      daq info log-0001.mcap
    """
    from rich.console import Console
    from rich.table import Table

    from flightpower.daq.log_summary import summarize

    summary = summarize(log)
    console = Console()
    for line in summary.lines:
        console.print(line, highlight=False, markup=False)
    table = Table("topic", "messages", "Hz", "without measurement", box=None)
    for row in summary.topics:
        table.add_row(row.topic, str(row.messages), f"{row.rate_Hz:.1f}", row.failures or "-")
    console.print(table)


@app.command("list", short_help="List the logs of a folder.")
def list_(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Where the logs are.")] = Path(
        "/var/lib/flightpower"
    ),
    every: Annotated[bool, typer.Option("--all", help=f"All logs, not the latest {SHOWN_LOGS}.")] = False,
) -> None:
    """List the latest logs of a folder: start, length, size, and whether each is complete.

    Times are those of the satellites, UTC. A ? marks the system clock, which is wrong where there is no network.

    \b
    Example:
      daq list /var/lib/flightpower
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from flightpower.daq.log_list import list_logs
    from flightpower.daq.log_names import all_logs

    table = Table("log", "begin (UTC)", "min", "MB", "state", box=None)
    for log in list_logs(folder, latest=None if every else SHOWN_LOGS):
        begin = "-" if log.begin is None else f"{log.begin:%Y-%m-%d %H:%M}{'' if log.by_satellites else ' ?'}"
        length = f"{log.duration_s / 60:.1f}" if log.begin else "-"
        table.add_row(Text(log.path.name), begin, length, f"{log.bytes / 1e6:.1f}", log.state)
    none = f"{folder}: no log (.mcap) is in it; give the folder of the logs"
    Console().print(table if table.rows else none, highlight=False, soft_wrap=not table.rows)
    if table.rows and (left := len(all_logs(folder)) - table.row_count) > 0:
        Console().print(f"{left} earlier logs are not shown; --all lists them", highlight=False)


@app.command(short_help="Serve a page that shows the state of the daemon.")
def status(
    config: TrayOption,
    file: Annotated[
        Path, typer.Option(metavar="FILE", help="The file that `daq run --status` writes.")
    ] = SERVICE_STATUS,
    listen: Annotated[str, typer.Option(metavar="HOST:PORT", help="Where to serve it.")] = "127.0.0.1:8080",
) -> None:
    """Serve a page for the phone: recording, sensors, events, logs, last zero and check. The page is read-only.

    The address is printed; anyone who can reach it can read the page. Needs the extra `status` of the package.

    \b
    Examples:
      daq status --config tray.toml --listen 0.0.0.0:8080
      daq status --config out/tray.toml --file out/status.json

    The second serves what `sim fly --real-time --status out/status.json -o out` writes.
    """
    from flightpower.daq.config import load_tray
    from flightpower.daq.status_page import serve, sources_of

    host, _, port = listen.rpartition(":")
    if not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise InputError(f"--listen {listen}: write HOST:PORT, such as 0.0.0.0:8080")
    serve(sources_of(load_tray(config), file), host, int(port), show=lambda lines: print(lines, flush=True))


@app.command(short_help="Print an example tray file, or check one.")
def config(
    example: Annotated[bool, typer.Option("--example", help="Print an example tray with every sensor.")] = False,
    check: Annotated[Path | None, typer.Option("--check", metavar="FILE", help="Check this tray file.")] = None,
    unit: Annotated[
        Path | None, typer.Option("--unit", metavar="FILE", help="Print the systemd drop-in for this tray.")
    ] = None,
) -> None:
    """Print an example configuration, check one, or print its systemd drop-in.

    \b
    Examples:
      daq config --example > tray.toml
      daq config --check tray.toml
    """
    if unit is not None:
        from flightpower.daq.config import load_tray
        from flightpower.daq.systemd_unit import unit_drop_in

        typer.echo(unit_drop_in(load_tray(unit)), nl=False)
        return
    if check is not None:
        from flightpower.daq.attachments import load_attachments
        from flightpower.daq.config import check_places, load_tray
        from flightpower.daq.driver_factory import check_drivers

        tray = load_tray(check)
        check_places(tray, str(check))
        check_drivers(tray, load_attachments(tray).aircraft)
        typer.echo(f"{check}: {len(tray.sensors)} sensors at {tray.rate_Hz:g} Hz")
        typer.echo(drivers_line())
    elif example:
        typer.echo(resources.files("flightpower.daq").joinpath("tray.example.toml").read_text("utf-8"), nl=False)
    else:
        raise InputError("give --example, --check FILE or --unit FILE")


def main() -> None:
    """Entry point. Wrong input gives one line on stderr and exit code 2."""
    run_command(app, "daq", "daq")


if __name__ == "__main__":
    main()
