"""The command `analyze`: from a log to the report. Arguments, messages and exit codes only."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from analysis.autopilot_logs.read import firmware_of
from analysis.cli.electrical import (
    OrdinaryFlight,
    lacks_drag_topics,
    refuse_autopilot_options,
    refuse_daemon_options,
)
from analysis.performance.request import parse_request, parse_weight
from flight.aircraft import load_aircraft
from flight.command_line import application, quantity, run
from flight.errors import InputError
from flight.log_reader import read_log
from flight.output_file import check_writable
from flight.shipped_propellers import shipped_propellers
from flight.units import GRAVITY_MPS2

if TYPE_CHECKING:
    from flight.propeller import Propeller

app = application(no_args_is_help=False)


@app.command()
def analyze(
    log: Annotated[
        Path,
        typer.Argument(
            metavar="LOG",
            help="A log that the daemon recorded, one of other software (docs/log-format.md), or one of PX4 (.ulg) or"
            " ArduPilot (.BIN).",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FOLDER", help="Folder for the results; default: LOG without .mcap, plus .report"
        ),
    ] = None,
    aircraft: Annotated[
        Path | None,
        typer.Option("--aircraft", metavar="FILE", help="Aircraft file to use instead of the one the log carries."),
    ] = None,
    propeller: Annotated[
        str | None,
        typer.Option(
            "--propeller",
            metavar="NAME",
            help="Propeller to use instead of the log's: one shipped with flightpower"
            f" ({', '.join(shipped_propellers())}), a CSV file of its format, a PER3 file of APC, or tables of UIUC.",
        ),
    ] = None,
    probe: Annotated[
        Path | None,
        typer.Option("--probe", metavar="FILE", help="Probe calibration to use instead of the one the log carries."),
    ] = None,
    zero: Annotated[
        Path | None,
        typer.Option("--zero", metavar="FILE", help="Still-air zero of `daq zero` to use instead of the log's."),
    ] = None,
    weight: Annotated[
        str | None,
        typer.Option(
            "--weight",
            metavar="WEIGHT",
            help='Weight in this flight, such as "4.1 kg" or "9 lb", instead of the aircraft file\'s.',
        ),
    ] = None,
    runs: Annotated[
        Path | None,
        typer.Option(
            "--runs",
            metavar="FILE",
            help="Runs to use: a runs.toml written by an earlier analysis and edited (keep, start, end, kind).",
        ),
    ] = None,
    magnetometer: Annotated[
        Path | None,
        typer.Option(
            "--magnetometer",
            metavar="FILE",
            help="Magnetometer calibration to use instead of the one the log carries.",
        ),
    ] = None,
    battery_Wh: Annotated[
        str | None,
        typer.Option(
            "--battery-Wh",
            metavar="ENERGY",
            help='Energy of the battery [Wh], such as 74, or "5000 mAh, 14.8 V"; default: that of the aircraft file.',
        ),
    ] = None,
    usable: Annotated[
        str | None,
        typer.Option("--usable", metavar="SHARE", help="Usable share of that energy; default: 0.8, which is 80%."),
    ] = None,
    weights: Annotated[
        str | None,
        typer.Option(
            "--weights",
            metavar="LIST",
            help='Weights to compute, such as "3.8 kg, 9 lbf"; default: 300 and 600 g more than flown.',
        ),
    ] = None,
    density_altitudes: Annotated[
        str | None,
        typer.Option(
            "--density-altitudes",
            metavar="LIST",
            help='Density altitudes to compute, such as "0 m, 5000 ft"; default: 15 °C hotter and 1000 m higher.',
        ),
    ] = None,
    mass: Annotated[
        float | None,
        typer.Option(
            "--mass",
            metavar="MASS",
            parser=quantity("--mass", "kg", '"9 lb"', above=0, most=1000),
            help='Mass [kg], such as 9.4 or "21 lb", for a log of an autopilot.',
        ),
    ] = None,
    wing_area: Annotated[
        float | None,
        typer.Option(
            "--wing-area",
            metavar="AREA",
            parser=quantity("--wing-area", "m^2", '"5 ft^2"', above=0, most=200),
            help='Wing area [m^2], such as 1.5 or "16 ft^2", for a log of an autopilot.',
        ),
    ] = None,
    span: Annotated[
        float | None,
        typer.Option(
            "--span",
            metavar="LENGTH",
            parser=quantity("--span", "m", '"13 ft"', above=0, most=100),
            help='Span [m], such as 4 or "13 ft", for a log of an autopilot.',
        ),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")] = False,
) -> None:
    """Compute the power required from a log: report.html, results.json, power_required.csv and a table for the field.

    The log carries the aircraft file, the propeller table, the calibrations of probe and magnetometer, and the zero.
    Each can be replaced, or given where the log lacks it.
    The curve covers the speeds flown in accelerations and decelerations, with a 95 % interval. The report also has
    endurance and range on a battery, climb and highest speed at full throttle, and the effect of weight and air
    density on these.
    A log of PX4 or ArduPilot, or one without flow angles or motor speed, gives the electrical power of level flight.

    \b
    Examples:
      analyze log.mcap                               the report is in log.report
      analyze log.mcap --aircraft my.toml -o results
      analyze log.mcap --battery-Wh "5000 mAh, 14.8 V" --usable 70%
      analyze log.mcap --runs log.report/runs.toml   after editing that file
      analyze log.ulg --mass 9.4 --wing-area 1.5 --span 4

    Exit code 0: done. 2: the input cannot be used; one line on stderr says why, and nothing was written.
    """
    stderr = Console(stderr=True, quiet=quiet)
    folder = output or log.parent / f"{log.stem}.report"
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; give the folder for the results with -o")
    request = parse_request(battery_Wh, usable, weights, density_altitudes)
    weight_N = None if weight is None else parse_weight(weight, "--weight")
    # These matrices are too small to gain from a thread pool, which would slow down every call.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    ordinary = OrdinaryFlight(
        log, folder, request, weight_N if mass is None else mass * GRAVITY_MPS2, wing_area, span, aircraft, propeller
    )
    firmware = firmware_of(_not_a_folder(log))
    if firmware:
        refuse_daemon_options(log, probe=probe, zero=zero, runs=runs, magnetometer=magnetometer)
        check_writable(folder / "report.html")
        with stderr.status("reading the log …") as status:
            print_electrical = ordinary.analyze_autopilot_log(firmware, lambda step: status.update(f"{step} …"))
        if not quiet:
            print_electrical(Console())
        return
    with stderr.status("reading the log …") as status:
        # Wrong input is refused before the numerical libraries are loaded, which takes a second.
        recorded = read_log(_not_a_folder(log))
        if lacks_drag_topics(recorded):
            check_writable(folder / "report.html")
            print_electrical = ordinary.analyze_daemon_log(recorded, lambda step: status.update(f"{step} …"))
            if not quiet:
                print_electrical(Console())
            return
        check_writable(folder / "report.html")
        refuse_autopilot_options(log, mass=mass, wing_area=wing_area, span=span)
        given_aircraft = load_aircraft(aircraft) if aircraft else None
        given_propeller = _load_propeller(propeller) if propeller else None
        from analysis.airdata.magnetometer import load_magnetometer
        from analysis.airdata.probe import load_probe
        from analysis.log_contents import Replacements
        from analysis.maneuvers import toml_file
        from analysis.pipeline import analyze as run_pipeline
        from analysis.report.terminal import print_summary
        from analysis.report.write import write_report, write_run_list
        from analysis.signals.rest import load_zero

        if runs:
            toml_file.load(runs)  # a wrong one is refused before anything is computed
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


def _not_a_folder(log: Path) -> Path:
    if log.is_dir():
        inside = sorted(log.glob("*.mcap"))
        raise InputError(
            f"{log}: cannot be read, it is a folder; give a log, such as {inside[0] if inside else 'log.mcap'}"
        )
    return log


def _load_propeller(name_or_path: str) -> "Propeller":
    from flight.propeller_files import load_propeller

    return load_propeller(name_or_path)


def main() -> None:
    run(app, "analyze")


if __name__ == "__main__":
    main()
