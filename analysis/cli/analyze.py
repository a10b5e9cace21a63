"""`analyze log.mcap`: the command on the laptop."""

import os
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from analysis.cli.errors import run
from analysis.files import write_kept
from analysis.performance.request import parse_request, parse_weight
from flight.aircraft import load_aircraft
from flight.errors import InputError
from flight.log_reader import read_log

app = typer.Typer(add_completion=False)


@app.command()
def analyze(
    log: Annotated[Path, typer.Argument(help="A log that the daemon recorded.")],
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
            help="Propeller to use instead of the log's: a shipped name, our CSV, APC's PER3 file, or UIUC tables.",
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
            "--runs", help="Runs to use: the runs.toml that an analysis wrote, edited (keep, start, end, kind)."
        ),
    ] = None,
    magnetometer: Annotated[
        Path | None,
        typer.Option("--magnetometer", help="Magnetometer calibration to use instead of the one the log carries."),
    ] = None,
    battery_Wh: Annotated[
        str | None, typer.Option("--battery-Wh", help="Energy of the battery [Wh]; default: the aircraft file's.")
    ] = None,
    usable: Annotated[
        str | None, typer.Option("--usable", help="Share of that energy to fly with, 0 to 1; default: 0.8.")
    ] = None,
    weights: Annotated[
        str | None,
        typer.Option("--weights", help='Weights to answer for, such as "3.8 kg, 9 lbf"; default: 300 and 600 g more.'),
    ] = None,
    density_altitudes: Annotated[
        str | None,
        typer.Option(
            "--density-altitudes",
            help='Density altitudes to answer for, such as "0 m, 5000 ft"; default: 15 °C hotter, 1000 m higher.',
        ),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but errors.")] = False,
) -> None:
    """From a log to power required: report.html, results.json, power_required.csv, and a table for the field.

    A log of the daemon carries all it needs: the aircraft file, the propeller table, the calibrations of probe and
    magnetometer, the zero. Each of these can be replaced, or given where the log lacks it.
    The curve is drawn over the speeds flown in accelerations and decelerations, with a 95 % interval. With it come
    endurance and range on a battery, climb and highest speed at full throttle, and what more weight or thinner air
    costs.

    Exit code 0: done. 2: the input cannot be used; one line on stderr says why, and nothing was written.
    """
    errors = Console(stderr=True, quiet=quiet)
    folder = output or log.with_suffix(".report")
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; give the folder for the results with -o")
    request = parse_request(battery_Wh, usable, weights, density_altitudes)
    weight_N = None if weight is None else parse_weight(weight, "--weight")
    # A thread pool helps none of these small matrices and costs the start of every call.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with errors.status("reading the log …") as status:
        # What can be refused is refused before the second that the numerical libraries take to load.
        recorded, override = read_log(log), load_aircraft(aircraft) if aircraft else None
        other = _propeller(propeller) if propeller else None
        from analysis.airdata.magnetometer import load_magnetometer
        from analysis.airdata.probe import load_probe
        from analysis.log_contents import Replacements
        from analysis.maneuvers.toml_file import to_toml
        from analysis.pipeline import analyze as run_pipeline
        from analysis.report.write import write_report
        from analysis.signals.rest import load_zero

        def say(text: str) -> None:
            status.update(text + " …")

        given = Replacements(
            aircraft=override,
            propeller=other,
            probe=load_probe(probe) if probe else None,
            magnetometer=load_magnetometer(magnetometer) if magnetometer else None,
            zero=load_zero(zero) if zero else None,
            weight_N=weight_N,
        )
        analysis = run_pipeline(recorded, given, say, request=request, runs_file=runs)
        status.update("drawing the report …")
        write_report(analysis, folder)
        listed = folder / "runs.toml"
        of_hand = runs is not None and listed.exists() and listed.samefile(runs)  # with the remarks of who edited it
        kept = None if of_hand else write_kept(listed, to_toml(analysis.maneuvers, log.name))
    if kept:
        errors.print(f"note: {listed} is new; what stood there before is {kept.name}", highlight=False)
    if not quiet:
        _print_summary(analysis.results, folder)


def _propeller(name_or_path: str):
    from flight.propeller_files import load_propeller

    return load_propeller(name_or_path)


def _print_summary(results, folder: Path) -> None:
    from analysis.report.page import answers_in_words

    console = Console()
    curve = Table(title=f"{results.aircraft.title}: power required", title_justify="left")
    for heading in ("speed, m/s", "power, W", "95 % interval, W"):
        curve.add_column(heading, justify="right")
    for point in results.power_required[:: len(results.power_required) // 8 or 1]:
        interval = f"{point.power_lo_W:.1f} to {point.power_hi_W:.1f}"
        curve.add_row(f"{point.speed_mps:.1f}", f"{point.power_W:.1f}", interval)
    console.print(curve)
    for question, answer, note in answers_in_words(results):
        console.print(f"[bold]{question}: {answer}[/bold]. {note}", highlight=False)
    for warning in [*results.warnings, *(one.text for one in results.disagreements)]:
        console.print(f"[yellow]note:[/yellow] {warning}", highlight=False)
    console.print(f"report: {folder / 'report.html'}")


def main() -> None:
    run(app)


if __name__ == "__main__":
    main()
