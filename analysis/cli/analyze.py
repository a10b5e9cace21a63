"""The command `analyze`: from a log to the report. Arguments, messages and exit codes only."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from analysis.autopilot_logs.read import firmware_of
from analysis.cli.electrical import OrdinaryFlight, lacks_drag_topics, refuse_daemon_options
from analysis.cli.errors import run
from analysis.performance.request import parse_request, parse_weight
from flight.aircraft import load_aircraft
from flight.errors import InputError
from flight.log_reader import read_log

if TYPE_CHECKING:
    from flight.propeller import Propeller

app = typer.Typer(add_completion=False)


@app.command()
def analyze(
    log: Annotated[
        Path, typer.Argument(help="A log that the daemon recorded, or one of PX4 (.ulg) or ArduPilot (.BIN).")
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Folder for the results; default: LOG without .mcap, plus .report"),
    ] = None,
    aircraft: Annotated[
        Path | None, typer.Option("--aircraft", help="Aircraft file to use instead of the one the log carries.")
    ] = None,
    propeller: Annotated[
        str | None,
        typer.Option(
            "--propeller",
            help="Propeller to use instead of the log's: a name shipped with flightpower, a CSV file of its format,"
            " a PER3 file of APC, or tables of UIUC.",
        ),
    ] = None,
    probe: Annotated[
        Path | None, typer.Option("--probe", help="Probe calibration to use instead of the one the log carries.")
    ] = None,
    zero: Annotated[
        Path | None, typer.Option("--zero", help="Still-air zero of `daq zero` to use instead of the log's.")
    ] = None,
    weight: Annotated[
        str | None,
        typer.Option("--weight", help='Weight in this flight, such as "4.1 kg", instead of the aircraft file\'s.'),
    ] = None,
    runs: Annotated[
        Path | None,
        typer.Option(
            "--runs",
            help="Runs to use: a runs.toml written by an earlier analysis and edited (keep, start, end, kind).",
        ),
    ] = None,
    magnetometer: Annotated[
        Path | None,
        typer.Option("--magnetometer", help="Magnetometer calibration to use instead of the one the log carries."),
    ] = None,
    battery_Wh: Annotated[
        str | None, typer.Option("--battery-Wh", help="Energy of the battery [Wh]; default: that of the aircraft file.")
    ] = None,
    usable: Annotated[
        str | None, typer.Option("--usable", help="Usable share of that energy, 0 to 1; default: 0.8.")
    ] = None,
    weights: Annotated[
        str | None,
        typer.Option(
            "--weights", help='Weights to compute, such as "3.8 kg, 9 lbf"; default: 300 and 600 g more than flown.'
        ),
    ] = None,
    density_altitudes: Annotated[
        str | None,
        typer.Option(
            "--density-altitudes",
            help='Density altitudes to compute, such as "0 m, 5000 ft"; default: 15 °C hotter and 1000 m higher.',
        ),
    ] = None,
    mass: Annotated[str | None, typer.Option("--mass", help='For an autopilot\'s log: mass, such as "9.4 kg".')] = None,
    wing_area: Annotated[
        str | None, typer.Option("--wing-area", help='For an autopilot\'s log: wing area, such as "1.5 m^2".')
    ] = None,
    span: Annotated[str | None, typer.Option("--span", help='For an autopilot\'s log: span, such as "4 m".')] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")] = False,
) -> None:
    """Compute the power required from a log: report.html, results.json, power_required.csv and a table for the field.

    A log of the daemon carries the aircraft file, the propeller table, the calibrations of probe and magnetometer, and
    the zero. Each can be replaced, or given where the log lacks it.
    The curve covers the speeds flown in accelerations and decelerations, with a 95 % interval. The report also has
    endurance and range on a battery, climb and highest speed at full throttle, and the effect of weight and air
    density on these.
    A log of PX4 or ArduPilot, or one without flow angles or motor speed, gives the electrical power of level flight.

    Exit code 0: done. 2: the input cannot be used; one line on stderr says why, and nothing was written.
    """
    stderr = Console(stderr=True, quiet=quiet)
    folder = output or log.with_suffix(".report")
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; give the folder for the results with -o")
    request = parse_request(battery_Wh, usable, weights, density_altitudes)
    weight_N = None if weight is None else parse_weight(weight, "--weight")
    # These matrices are too small to gain from a thread pool, which would slow down every call.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    ordinary = OrdinaryFlight(log, folder, request, mass or weight, wing_area, span, aircraft)
    firmware = firmware_of(log)
    if firmware:
        refuse_daemon_options(log, propeller=propeller, probe=probe, zero=zero, runs=runs, magnetometer=magnetometer)
        with stderr.status("reading the log …") as status:
            print_electrical = ordinary.analyze_autopilot_log(firmware, lambda step: status.update(f"{step} …"))
        if not quiet:
            print_electrical(Console())
        return
    with stderr.status("reading the log …") as status:
        # Wrong input is refused before the numerical libraries are loaded, which takes a second.
        recorded = read_log(log)
        if lacks_drag_topics(recorded):
            print_electrical = ordinary.analyze_daemon_log(recorded, lambda step: status.update(f"{step} …"))
            if not quiet:
                print_electrical(Console())
            return
        given_aircraft = load_aircraft(aircraft) if aircraft else None
        given_propeller = _load_propeller(propeller) if propeller else None
        from analysis.airdata.magnetometer import load_magnetometer
        from analysis.airdata.probe import load_probe
        from analysis.log_contents import Replacements
        from analysis.pipeline import analyze as run_pipeline
        from analysis.report.terminal import print_summary
        from analysis.report.write import write_report, write_run_list
        from analysis.signals.rest import load_zero

        given = Replacements(
            aircraft=given_aircraft,
            propeller=given_propeller,
            probe=load_probe(probe) if probe else None,
            magnetometer=load_magnetometer(magnetometer) if magnetometer else None,
            zero=load_zero(zero) if zero else None,
            weight_N=weight_N,
        )
        analysis = run_pipeline(
            recorded, given, lambda step: status.update(f"{step} …"), request=request, runs_file=runs
        )
        status.update("writing the report …")
        write_report(analysis, folder)
        previous = write_run_list(analysis, folder, log.name, given=runs)
    if previous:
        note = f"note: {folder / 'runs.toml'} was written; the previous file is now {previous.name}"
        stderr.print(note, highlight=False, markup=False)
    if not quiet:
        print_summary(analysis.results, folder / "report.html", Console())


def _load_propeller(name_or_path: str) -> "Propeller":
    from flight.propeller_files import load_propeller

    return load_propeller(name_or_path)


def main() -> None:
    run(app)


if __name__ == "__main__":
    main()
