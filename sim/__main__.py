"""The command line of the simulator: `sim fly`, `sim tunnel`, `sim trim`, `sim modes`, `sim plot`.

It connects simulator, fake hardware and daemon; no module imports it.
"""

import math
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from flight.complete_aircraft import CompleteAircraft, load_complete_aircraft
from flight.errors import InputError

if TYPE_CHECKING:
    from hw_fakes.faults import Fault
    from sim.direct_log_timing import IndividualParts
    from sim.sensor_truth import SensorTruth

Report = Callable[[float], None]  # takes how many seconds are done

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False, help=__doc__)

HIGHEST_OVERSAMPLING = 0x8  # that of a driver at 25 Hz
TRUTH, CURVE, TRAY, LOG = "truth.parquet", "truth_power_required.csv", "tray.toml", "log.mcap"
PX4_LOG, ARDUPILOT_LOG = "log.ulg", "log.BIN"
OUTPUT_FILES = (TRUTH, CURVE, TRAY, LOG, PX4_LOG, ARDUPILOT_LOG)

AircraftOption = Annotated[str, typer.Option(help="Name of a shipped aircraft, or a file.")]
ReplaceOption = Annotated[bool, typer.Option("--replace", help="Overwrite an earlier simulation.")]
SeedOption = Annotated[
    int, typer.Option(min=0, help="Draws turbulence, noise and errors. The same seed gives the same flight.")
]


@app.command()
def fly(
    output: Annotated[Path, typer.Option("--output", "-o", help="Directory for the truth and the log.")],
    aircraft: AircraftOption = "nexstar",
    plan: Annotated[str, typer.Option(help="Name of a shipped plan, or a file.")] = "accel-decel",
    errors: Annotated[str, typer.Option(help="Error budget: bench, none, study, harsh, or a file.")] = "bench",
    seed: SeedOption = 0,
    probe: Annotated[Path | None, typer.Option(help="Probe calibration to put into the log.")] = None,
    faults: Annotated[
        Path | None,
        typer.Option(help="Faults of the fake sensors and their times: a file as in docs/fake-tray.md."),
    ] = None,
    real_time: Annotated[bool, typer.Option("--real-time", help="Record in real time.")] = False,
    no_hardware: Annotated[
        bool, typer.Option("--no-hardware", help="Write the log directly, without fake sensors and daemon; faster.")
    ] = False,
    recorder: Annotated[
        str | None,
        typer.Option("--as", help="px4 or ardupilot: write the log as this autopilot would, not the daemon's."),
    ] = None,
    log_faults: Annotated[
        str, typer.Option("--log-faults", help="With --as px4: traps of real logs, such as landed,dropouts,truncated.")
    ] = "",
    replace: ReplaceOption = False,
) -> None:
    """Fly a plan, write the truth, and record the flight by the daemon through the fake sensors."""
    from hw_fakes.faults import load_faults
    from sim.fly import fly as fly_plan
    from sim.plan import load_plan
    from sim.sensors import FlightSensorTruth, draw, load_budget
    from sim.truth import write_truth

    if no_hardware and (real_time or faults is not None):
        raise InputError("--no-hardware excludes --faults and --real-time")
    traps = _log_faults(recorder, log_faults)
    craft, flight_plan, budget = load_complete_aircraft(aircraft), load_plan(plan), load_budget(errors)
    schedule = load_faults(faults) if faults is not None else ()
    if probe is not None and not probe.is_file():
        raise InputError(f"{probe}: no such file; make a probe calibration with `calibrate probe`")
    _check_output(output, replace)
    drawn = draw(budget, seed)
    with _progress("flying") as report:
        flight = fly_plan(craft, flight_plan, seed=seed, deviations=drawn.deviations, progress=report)
    try:
        output.mkdir(parents=True, exist_ok=True)
        for name in OUTPUT_FILES:
            (output / name).unlink(missing_ok=True)
        metadata = {**flight.metadata, "errors": drawn.as_dict()}
        write_truth(output / TRUTH, flight.truth, metadata, flight.power_required)
        flight.power_required.to_csv(output / CURVE, index=False)
        (output / TRAY).write_text(_tray_text(output, aircraft, craft, probe), "utf-8")
    except OSError as error:
        raise InputError(f"{output}: cannot be written ({error.strerror or error})") from None
    sensor_truth = FlightSensorTruth(flight, drawn)
    if recorder is not None:
        from sim.ardupilot_log import write_ardupilot_log
        from sim.px4_log import write_px4_log

        written = output / (PX4_LOG if recorder == "px4" else ARDUPILOT_LOG)
        if recorder == "px4":
            write_px4_log(written, flight, sensor_truth, drawn, traps)
        else:
            write_ardupilot_log(written, flight, sensor_truth, drawn)
        print(f"{written}: {flight.duration_s:.0f} s of {craft.title}, {flight_plan.title}", file=sys.stderr)
        return
    with _progress("recording", flight.duration_s) as report:
        if no_hardware:
            _write_without_hardware(output, sensor_truth, seed, craft, report)
        else:
            _record(output, sensor_truth, seed, craft, schedule, real_time, report)
    print(f"{output / LOG}: {flight.duration_s:.0f} s of {craft.title}, {flight_plan.title}", file=sys.stderr)


def _log_faults(recorder: str | None, text: str) -> list[str]:
    """The faults that --log-faults names. Raises InputError for what is unknown, or has no use."""
    from sim.px4_log import FAULTS

    names = [name.strip() for name in text.split(",") if name.strip()]
    if recorder not in (None, "px4", "ardupilot"):
        raise InputError(f"--as {recorder}: not known; give px4 or ardupilot")
    if names and recorder != "px4":
        raise InputError("--log-faults: needs --as px4")
    unknown = [name for name in names if name not in FAULTS]
    if unknown:
        raise InputError(f"--log-faults {', '.join(unknown)}: not known; known: {', '.join(FAULTS)}")
    return names


def _check_output(output: Path, replace: bool) -> None:
    """Raise InputError if writing would replace something else than an earlier simulation."""
    if output.exists() and not output.is_dir():
        raise InputError(f"{output}: not a directory; give another one")
    taken = [name for name in OUTPUT_FILES if (output / name).exists()]
    if not taken:
        return
    if not replace:
        raise InputError(f"{output}: already contains {taken[0]}; give another directory, or --replace")
    if not (output / TRUTH).exists():
        raise InputError(f"{output}: contains a log without {TRUTH}, so not a simulated flight; give another directory")


def _tray_text(output: Path, name: str, craft: CompleteAircraft, probe: Path | None) -> str:
    """The daemon's example tray, changed for this flight. Files it needs are copied, so the directory can be moved."""
    text = resources.files("daq").joinpath("tray.example.toml").read_text("utf-8")
    if Path(name).is_file():
        (output / "aircraft.toml").write_text(craft.text, "utf-8")
        name = "aircraft.toml"
    lines = []
    for line in text.splitlines():
        key = line.lstrip("# ").split("=")[0].strip()
        if key == "aircraft":
            line = f'aircraft = "{name}"'
        elif key == "directory":
            line = 'directory = "."'
        elif key == "probe_calibration" and probe is not None:
            target = output / "probe.json"
            if not (target.exists() and target.samefile(probe)):
                shutil.copyfile(probe, target)
            line = 'probe_calibration = "probe.json"'
        lines.append(line)
    return "\n".join(lines) + "\n"


def _record(
    output: Path,
    sensor_truth: "SensorTruth",
    seed: int,
    craft: CompleteAircraft,
    faults: "tuple[Fault, ...]",
    real_time: bool,
    report: Report,
) -> None:
    from daq.clock import SystemClock
    from daq.config import load_tray
    from daq.daemon import record
    from hw_fakes.clock import SimulatedClock
    from hw_fakes.tray import UTC_AT_START, FakeTray

    clock = SystemClock() if real_time else SimulatedClock(unix_at_start_ns=_believed_unix_ns(UTC_AT_START))
    start_ns = clock.now_ns()
    tray = FakeTray(sensor_truth, clock, seed, pole_pairs=craft.propulsion.pole_pairs, faults=faults)
    record(
        load_tray(output / TRAY),
        buses=tray,
        clock=clock,
        log_path=output / LOG,
        until_ns=start_ns + int(sensor_truth.duration_s * 1e9),
        progress=report,
    )


def _believed_unix_ns(now: datetime) -> int:
    """Unix time [ns] of a Pi without a real-time clock after booting: that of its shutdown a minute ago."""
    return int((now.timestamp() - 60) * 1e9)


def _write_without_hardware(
    output: Path, sensor_truth: "SensorTruth", seed: int, craft: CompleteAircraft, report: Report
) -> None:
    from daq.attachments import load_attachments, write_attachments
    from daq.config import load_tray
    from flight.log_writer import LogWriter
    from hw_fakes.tray import UTC_AT_START
    from sim.direct_log import write_direct_log

    tray = load_tray(output / TRAY)
    start_unix_ns = _believed_unix_ns(UTC_AT_START)
    try:
        with (output / LOG).open("xb") as stream:
            log = LogWriter(stream)
            write_attachments(
                log, load_attachments(tray), rate_Hz=tray.rate_Hz, start_unix_ns=start_unix_ns, start_monotonic_ns=0
            )
            write_direct_log(
                log,
                sensor_truth,
                craft,
                _parts(sensor_truth, seed, craft),
                start_unix_ns=start_unix_ns,
                utc_at_start_ns=int(UTC_AT_START.timestamp() * 1e9),
                progress=report,
            )
            log.finish()
    except OSError as error:
        raise InputError(f"{output / LOG}: cannot be written ({error.strerror or error})") from None


def _parts(sensor_truth: "SensorTruth", seed: int, craft: CompleteAircraft) -> "IndividualParts":
    """Properties of the individual fake parts that affect a log."""
    import numpy as np

    from daq.sensors.ak8963 import sensitivity
    from daq.sensors.ms56xx import MS5611, MS5805, BarometerVariant, TemperatureTrend, compensate
    from hw_fakes.clock import SimulatedClock
    from hw_fakes.ms56xx import FakeMS56xx, pressure_counts, temperature_counts
    from hw_fakes.tray import FakeTray
    from sim.direct_log_timing import BarometerPart, IndividualParts

    tray = FakeTray(sensor_truth, SimulatedClock(), seed)

    def barometer(part: FakeMS56xx, variant: BarometerVariant) -> BarometerPart:
        def counts(pressure_Pa: float, temperature_K: float) -> tuple[int, int]:
            d2 = temperature_counts(part.part, part.prom, temperature_K)
            return pressure_counts(part.part, part.prom, pressure_Pa, d2), d2

        def decoded(d1: int, d2: float) -> tuple[float, float]:
            return compensate(variant, tuple(part.prom), d1, d2)

        return BarometerPart(part.conversion_ns(HIGHEST_OVERSAMPLING), counts, decoded, TemperatureTrend)

    return IndividualParts(
        imu_clock_error=tray.imu.clock_error,
        mag_sensitivity=np.array([sensitivity(int(byte)) for byte in tray.magnetometer.adjustment]),
        barometers={"baro": barometer(tray.baro, MS5611), "static": barometer(tray.static, MS5805)},
        pole_pairs=craft.propulsion.pole_pairs,
    )


@app.command()
def tunnel(
    output: Annotated[Path, typer.Option("--output", "-o", help="CSV file to write.")],
    seed: SeedOption = 0,
    replace: ReplaceOption = False,
) -> None:
    """A simulated wind-tunnel calibration of the five-port probe, as a CSV file."""
    from sim.tunnel import simulated_measurements, write_calibration

    table = simulated_measurements(seed=seed)
    write_calibration(output, table, replace=replace)
    print(f"{output}: {len(table)} points", file=sys.stderr)


@app.command()
def trim(
    aircraft: AircraftOption = "nexstar",
    height: Annotated[float, typer.Option(help="Above the ground [m].")] = 100.0,
    climb: Annotated[float, typer.Option(help="Rate of climb [m/s].")] = 0.0,
    bank: Annotated[float, typer.Option(help="Bank of a level turn [deg].")] = 0.0,
    speed: Annotated[float | None, typer.Option(help="One airspeed [m/s] instead of the whole range.")] = None,
    rpm: Annotated[
        float | None, typer.Option(help="Motor speed: gives the climb at --speed, or the speed at --climb.")
    ] = None,
) -> None:
    """Trimmed flight over the range of airspeeds: angle of attack, controls, motor, power.

    Any two of airspeed, climb and motor speed give the third.
    """
    from sim.plant import plant_of
    from sim.tables import trim_table
    from sim.trim import Trimmer

    trimmer = Trimmer(plant_of(load_complete_aircraft(aircraft)), height)
    motor_revps = None if rpm is None else rpm / 60
    table = trim_table(trimmer, bank_rad=math.radians(bank), climb_mps=climb, speed_mps=speed, motor_revps=motor_revps)
    console = Console()
    console.print(table)
    console.print(f"stall {trimmer.V_stall:.2f} m/s, highest level speed {trimmer.V_max:.2f} m/s")


@app.command(name="modes")
def show_modes(
    aircraft: AircraftOption = "nexstar",
    height: Annotated[float, typer.Option(help="Above the ground [m].")] = 100.0,
    speed: Annotated[float | None, typer.Option(help="Airspeed [m/s]; 1.6 times the stall speed otherwise.")] = None,
) -> None:
    """Short period, phugoid, dutch roll, roll and spiral about level trim."""
    from sim.plant import plant_of
    from sim.tables import modes_table
    from sim.trim import Trimmer

    trimmer = Trimmer(plant_of(load_complete_aircraft(aircraft)), height)
    V = speed if speed is not None else 1.6 * trimmer.V_stall
    Console().print(modes_table(trimmer, V))


@app.command()
def plot(
    truth: Annotated[Path, typer.Argument(help="truth.parquet of a simulated flight, or its directory.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="HTML file to write.")],
    replace: ReplaceOption = False,
) -> None:
    """Plot a flight: speed, height, angles, controls, power. Needs plotly, from the extra [analysis]."""
    from sim.plot import figure
    from sim.truth import read_truth

    if output.exists() and not replace:
        raise InputError(f"{output}: already exists; give another name, or --replace")
    table, metadata = read_truth(truth / TRUTH if truth.is_dir() else truth)
    drawn = figure(table, metadata)
    try:
        drawn.write_html(output, include_plotlyjs=True)
    except OSError as error:
        raise InputError(f"{output}: cannot be written ({error.strerror or error})") from None
    print(f"{output}: {len(table)} samples", file=sys.stderr)


@contextmanager
def _progress(what: str, total_s: float | None = None) -> Iterator[Report]:
    """A function that takes the seconds done; it shows a progress bar on stderr after two seconds."""
    bar = Progress(
        TextColumn(what),
        BarColumn(),
        TextColumn("{task.completed:.0f} s"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    task = bar.add_task(what, total=total_s)
    begun, shown = time.monotonic(), False

    def report(seconds: float) -> None:
        nonlocal shown
        if not shown and time.monotonic() - begun > 2:
            bar.start()
            shown = True
        bar.update(task, completed=seconds)

    try:
        yield report
    finally:
        if shown:
            bar.stop()


def main() -> None:
    """Entry point: a wrong input gives one line on stderr and exit code 2."""
    try:
        app()
    except InputError as error:
        print(f"sim: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
