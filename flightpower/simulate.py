"""The command line of the simulator: `sim fly`, `sim worlds`, `sim tunnel`, `sim trim`, `sim modes`, `sim plot`.

It connects simulator, fake hardware and daemon, and no module imports it.
"""

import math
import sys
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from zlib import crc32

import typer
from rich.console import Console

from flightpower.flight.aircraft import aircraft_text
from flightpower.flight.command_line import application, run
from flightpower.flight.complete_aircraft import CompleteAircraft, load_complete_aircraft
from flightpower.flight.errors import InputError, StorageError
from flightpower.flight.files import check_new_file, write_file
from flightpower.sim.options import (
    AircraftOption,
    BankOption,
    ClimbOption,
    DateOption,
    HeightOption,
    InstallationOption,
    LikeOption,
    ReplaceFileOption,
    ReplaceOption,
    Report,
    RpmOption,
    SeedOption,
    SpeedOption,
    progress_bar,
)
from flightpower.sim.output_folder import (
    LOG,
    TRAY,
    TRUTH,
    check_output,
    check_probe,
    probe_text,
    whole_or_nothing,
    write_flight,
)

if TYPE_CHECKING:
    from flightpower.hw_fakes.direct_log import Compensation
    from flightpower.hw_fakes.faults import Fault
    from flightpower.hw_fakes.tray import FakeTray, TrayVariant
    from flightpower.sim.sensor_truth import SensorTruth


app = application(help="Simulated flights and wind tunnel: what the sensors would measure, and the truth.")


@app.command(short_help="Fly a plan; write the truth and the log.")
def fly(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="Folder for the truth and the log.")],
    aircraft: AircraftOption = "nexstar",
    plan: Annotated[
        str, typer.Option(metavar="NAME", help="A shipped plan (docs/understand/simulation.md lists them), or a file.")
    ] = "accel-decel",
    errors: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Error budget: bench (the default), none, study, harsh, or a file."),
    ] = None,
    world: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="World that violates the assumptions of the analysis: see `sim worlds`."),
    ] = None,
    seed: SeedOption = 0,
    like: LikeOption = None,
    installation: InstallationOption = None,
    day: DateOption = None,
    probe: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Probe calibration for the log, instead of that of the simulated tunnel."),
    ] = None,
    faults: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Faults of the fake sensors and their times: a file as in docs/understand/fake-tray.md.",
        ),
    ] = None,
    real_time: Annotated[bool, typer.Option("--real-time", help="Record in real time.")] = False,
    status: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="With --real-time: write the state to this file, for `daq status`."),
    ] = None,
    no_hardware: Annotated[
        bool, typer.Option("--no-hardware", help="Write the log directly, without fake sensors and daemon; faster.")
    ] = False,
    recorder: Annotated[
        str | None,
        typer.Option(
            "--as",
            metavar="NAME",
            help="px4, ardupilot or ardupilot-telemetry (.tlog): write that autopilot's log instead of the daemon's.",
        ),
    ] = None,
    log_faults: Annotated[
        str,
        typer.Option(
            "--log-faults", metavar="LIST", help="With --as: traps of real logs, such as landed,dropouts,truncated."
        ),
    ] = "",
    replace: ReplaceOption = False,
) -> None:
    """Fly a plan, write the truth, and record the flight with the daemon, through fake sensors.

    \b
    Examples:
      sim fly -o out/demo
      sim fly --aircraft my.toml --plan full-test-flight --no-hardware -o out
      sim fly --aircraft my.toml --like nexstar --installation may --no-hardware
    """
    from flightpower.hw_fakes.faults import load_faults
    from flightpower.sim.autopilot_log import faults_of, write_autopilot_log
    from flightpower.sim.fly import fly as fly_plan
    from flightpower.sim.plan import load_plan
    from flightpower.sim.sensors import FlightSensorTruth, draw
    from flightpower.sim.sensors.budget import of_installation
    from flightpower.sim.world import world_of

    if no_hardware and (real_time or faults is not None):
        raise InputError("--no-hardware excludes --faults and --real-time")
    if recorder is not None and (real_time or faults is not None):
        raise InputError("--as excludes --faults and --real-time: the daemon does not record an autopilot's log")
    if recorder is not None and day is not None:
        raise InputError("--as excludes --date: autopilots' logs are simulated without one; leave out --date")
    if status is not None and not real_time:
        raise InputError("--status: only a recording in real time has a state to look at; add --real-time")
    traps = faults_of(recorder, log_faults)
    flown_in = world_of(world, errors)
    craft, flight_plan = _aircraft(aircraft, like, installation), flown_in.plan(load_plan(plan), seed)
    schedule = load_faults(faults) if faults is not None else ()
    calibration = probe_text(probe)
    check_output(output, replace)
    check_probe(output, calibration, probe)
    sensor_errors = draw(flown_in.errors, seed)
    if craft.has("installation.name"):
        installation = craft.installation.name
    if installation is not None:
        sensor_errors = of_installation(sensor_errors, draw(flown_in.errors, crc32(installation.encode())))
    with progress_bar("flying") as report:
        flight = fly_plan(craft, flight_plan, seed=seed, deviations=sensor_errors.deviations, progress=report)
    written, sensor_truth = output / LOG, FlightSensorTruth(flight, sensor_errors)
    variant = _tray_variant(craft, day, flight_plan.air.time_of_day_s)
    with whole_or_nothing(output):
        write_flight(output, flight, sensor_errors, flown_in, aircraft=aircraft, calibration=calibration)
        if recorder is not None:
            written = write_autopilot_log(output, recorder, flight, sensor_truth, sensor_errors, faults=traps)
        else:
            with progress_bar("recording", flight.duration_s) as report:
                if no_hardware:
                    _write_without_hardware(output, sensor_truth, seed, variant, craft, report=report)
                else:
                    _record(
                        output, sensor_truth, variant, seed=seed, faults=schedule,
                        real_time=real_time, status=status, report=report,
                    )  # fmt: skip
    print(f"{written}: {flight.duration_s:.0f} s of {craft.title}, {flight_plan.title}", file=sys.stderr)


def _aircraft(name: str, like: str | None, installation: str | None) -> CompleteAircraft:
    """The aircraft to fly. Raises InputError if its file lacks a key and no model is given to fill it in."""
    from flightpower.sim.like import scaled_from, with_installation

    if like is None:
        craft = load_complete_aircraft(name)
    else:
        craft = scaled_from(*aircraft_text(name), load_complete_aircraft(like))
    return craft if installation is None else with_installation(craft, installation)


def _tray_variant(craft: CompleteAircraft, day: datetime | None, time_of_day_s: float) -> "TrayVariant":
    """The tray aboard an aircraft at this time of day [s, UTC], on this day or the simulator's default day."""
    from flightpower.hw_fakes.tray import UTC_AT_START, TrayVariant

    midnight = day or UTC_AT_START.replace(hour=0, minute=0)
    return TrayVariant(pole_pairs=craft.propulsion.pole_pairs, utc_at_start=midnight + timedelta(seconds=time_of_day_s))


def _record(
    output: Path,
    sensor_truth: "SensorTruth",
    variant: "TrayVariant",
    *,
    seed: int,
    faults: "tuple[Fault, ...]",
    real_time: bool,
    status: Path | None,
    report: Report,
) -> None:
    from flightpower.daq.clock import SystemClock
    from flightpower.daq.config import load_tray
    from flightpower.daq.daemon import record
    from flightpower.daq.recording_status import StatusFile
    from flightpower.hw_fakes.clock import SimulatedClock
    from flightpower.hw_fakes.tray import FakeTray

    clock = SystemClock() if real_time else SimulatedClock(unix_at_start_ns=_believed_unix_ns(variant.utc_at_start))
    start_ns = clock.now_ns()
    tray = FakeTray(sensor_truth, clock, seed, variant=variant, faults=faults)
    status_file = StatusFile(status) if status else None
    try:
        recording = record(
            load_tray(output / TRAY),
            buses=tray,
            clock=clock,
            log_path=output / LOG,
            until_ns=start_ns + int(sensor_truth.duration_s * 1e9),
            progress=report,
            report=status_file.write if status_file else None,
            on_event=status_file.add if status_file else None,
        )
    finally:
        if status is not None:
            status.unlink(missing_ok=True)  # without the file the page says that nothing is recording
    if recording.write_error:
        raise StorageError(f"{output / LOG}: cannot be written ({recording.write_error})")


def _believed_unix_ns(now: datetime) -> int:
    """Unix time [ns] that a Pi without a real-time clock has after booting: the time of its shutdown a minute ago."""
    return int((now.timestamp() - 60) * 1e9)


def _write_without_hardware(
    output: Path,
    sensor_truth: "SensorTruth",
    seed: int,
    variant: "TrayVariant",
    craft: CompleteAircraft,
    *,
    report: Report,
) -> None:
    from flightpower.daq.attachments import load_attachments, write_attachments
    from flightpower.daq.config import load_tray
    from flightpower.flight.log_writer import LogWriter
    from flightpower.hw_fakes.clock import SimulatedClock
    from flightpower.hw_fakes.direct_log import write_direct_log
    from flightpower.hw_fakes.tray import FakeTray

    tray = load_tray(output / TRAY)
    parts = FakeTray(sensor_truth, SimulatedClock(), seed, variant=variant)
    start_unix_ns = _believed_unix_ns(variant.utc_at_start)
    try:
        with (output / LOG).open("xb") as stream:
            log = LogWriter(stream)
            write_attachments(
                log, load_attachments(tray), rate_Hz=tray.rate_Hz, start_unix_ns=start_unix_ns, start_monotonic_ns=0
            )
            write_direct_log(
                log,
                sensor_truth,
                parts,
                craft,
                _compensations(parts),
                start_unix_ns=start_unix_ns,
                progress=report,
            )
            log.finish()
    except OSError as error:
        raise InputError(f"{output / LOG}: cannot be written ({error.strerror or error})") from None


def _compensations(parts: "FakeTray") -> "dict[str, Compensation]":
    """The drivers' compensations of the barometers' counts."""
    from functools import partial

    from flightpower.daq.sensors.ms56xx import MS5611, MS5805, TemperatureTrend, compensate
    from flightpower.hw_fakes.direct_log import Compensation

    return {
        "baro": Compensation(partial(compensate, MS5611, tuple(parts.baro.prom)), TemperatureTrend),
        "static": Compensation(partial(compensate, MS5805, tuple(parts.static.prom)), TemperatureTrend),
    }


@app.command(name="worlds", short_help="List the worlds of `sim fly --world`.")
def list_worlds() -> None:
    """List the worlds of `sim fly --world`, with a sentence each: what the analysis does not assume.

    \b
    Example:
      sim worlds
    """
    from flightpower.sim.world import load_world, worlds

    for name in worlds():
        print(f"{name:20s} {load_world(name).title}")


@app.command(short_help="A simulated wind-tunnel calibration of the probe.")
def tunnel(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="CSV file to write.")],
    seed: SeedOption = 0,
    replace: ReplaceFileOption = False,
) -> None:
    """A simulated wind-tunnel calibration of the five-port probe, as a CSV file for `calibrate probe`.

    \b
    Example:
      sim tunnel -o tunnel.csv
    """
    from flightpower.sim.tunnel import simulated_measurements, write_calibration

    table = simulated_measurements(seed=seed)
    write_calibration(output, table, replace=replace)
    print(f"{output}: {len(table)} points", file=sys.stderr)


@app.command(short_help="Trimmed flight: angle of attack, controls, motor, power.")
def trim(
    *,
    aircraft: AircraftOption = "nexstar",
    height: HeightOption = 100.0,
    climb: ClimbOption = 0.0,
    bank: BankOption = 0.0,
    speed: SpeedOption = None,
    rpm: RpmOption = None,
) -> None:
    """Trimmed flight over the range of airspeeds: angle of attack, controls, motor, power.

    Any two of airspeed, climb and motor speed give the third. Values may have units: --speed "30 kt".

    \b
    Examples:
      sim trim --aircraft my.toml
      sim trim --speed 15 --climb 2
    """
    from flightpower.sim.plant import plant_of
    from flightpower.sim.tables import trim_table
    from flightpower.sim.trim import Trimmer

    trimmer = Trimmer(plant_of(load_complete_aircraft(aircraft)), height)
    motor_revps = None if rpm is None else rpm / 60
    table = trim_table(trimmer, bank_rad=math.radians(bank), climb_mps=climb, speed_mps=speed, motor_revps=motor_revps)
    console = Console()
    console.print(table)
    console.print(f"stall {trimmer.V_stall:.2f} m/s, highest level speed {trimmer.V_max:.2f} m/s")


@app.command(name="modes", short_help="Short period, phugoid, dutch roll, roll and spiral.")
def show_modes(
    aircraft: AircraftOption = "nexstar",
    height: HeightOption = 100.0,
    speed: SpeedOption = None,
) -> None:
    """Short period, phugoid, dutch roll, roll and spiral about level trim; by default at 1.6 times the stall speed.

    \b
    Example:
      sim modes --aircraft nexstar --speed 15
    """
    from flightpower.sim.plant import plant_of
    from flightpower.sim.tables import modes_table
    from flightpower.sim.trim import Trimmer

    trimmer = Trimmer(plant_of(load_complete_aircraft(aircraft)), height)
    V = speed if speed is not None else 1.6 * trimmer.V_stall
    Console().print(modes_table(trimmer, V))


@app.command()
def plot(
    truth: Annotated[Path, typer.Argument(metavar="TRUTH", help="truth.parquet of a simulated flight, or its folder.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="HTML file to write.")],
    replace: ReplaceFileOption = False,
) -> None:
    """Plot a flight: speed, height, angles, controls, power. Needs plotly, from the extra [plot].

    \b
    Example:
      sim plot out/demo -o flight.html
    """
    from flightpower.sim.plot import figure
    from flightpower.sim.truth import read_truth

    check_new_file(output, replace=replace)
    table, metadata = read_truth(truth / TRUTH if truth.is_dir() else truth)
    chart = figure(table, metadata)
    write_file(output, chart.to_html(include_plotlyjs=True))
    print(f"{output}: {len(table)} samples", file=sys.stderr)


# Errors with a value for each axis or sensor, by the name (with its unit) of their size in a budget.
BY_AXIS = {
    "accel_bias_mps2": "accel_bias", "accel_scale": "accel_scale", "gyro_bias_radps": "gyro_bias",
    "gyro_scale": "gyro_scale", "hard_iron_T": "hard_iron", "soft_iron": "soft_iron", "zero_Pa": "zero",
    "zero_drift_Pa": "zero_drift", "zero_cooling_Pa": "zero_cooling", "zero_step_Pa": "zero_step",
    "absolute_Pa": "absolute",
}  # fmt: skip


@app.command()
def errors(
    truth: Annotated[Path, typer.Argument(metavar="TRUTH", help="truth.parquet of a simulated flight, or its folder.")],
) -> None:
    """Print the true errors of a simulated flight, in SI units.

    \b
    Example:
      sim errors out/turned
    """
    from flightpower.sim.truth import read_truth

    _, metadata = read_truth(truth / TRUTH if truth.is_dir() else truth)
    recorded_errors = metadata["errors"]
    by_axis = {name: recorded_errors[BY_AXIS[name]] for name in BY_AXIS if recorded_errors["values"][name]}
    alone = {name: value for name, value in recorded_errors["values"].items() if value and name not in BY_AXIS}
    for name, value in {**alone, **by_axis}.items():
        print(f"{name} = {value}")


def main() -> None:
    """Entry point: a wrong input gives one line on stderr and exit code 2."""
    run(app, "sim", "sim")


if __name__ == "__main__":
    main()
