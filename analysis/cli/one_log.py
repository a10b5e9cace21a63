"""The analysis of one log as the command line asks for it: reads the files that options name, writes the report."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from analysis.autopilot_logs.read import firmware_of
from analysis.cli.electrical import (
    Done,
    OrdinaryFlight,
    lacks_drag_topics,
    refuse_autopilot_options,
    refuse_daemon_options,
)
from analysis.cli.lean_imports import import_lean
from analysis.performance.request import Request
from flight.aircraft import load_aircraft
from flight.errors import InputError
from flight.log_reader import read_log
from flight.output_file import check_writable
from flight.units import GRAVITY_MPS2

if TYPE_CHECKING:
    from analysis.log_contents import Replacements

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Options:
    """The options of `analyze` that apply to each log; None where not given."""

    aircraft: Path | None = None
    propeller: str | None = None
    probe: Path | None = None
    zero: Path | None = None
    weight_N: float | None = None
    runs: Path | None = None
    magnetometer: Path | None = None
    transducers: Path | None = None
    thrust_stand: Path | None = None
    request: Request = field(default_factory=Request)
    mass_kg: float | None = None
    wing_area_m2: float | None = None
    span_m: float | None = None
    by_likelihood: bool = False


def analyze_log(log: Path, folder: Path, options: Options, progress: Progress, command_line: str = "") -> Done:
    """Write the report of a log into `folder`. command_line: that asked for it, for the report.

    Raises InputError when the log or a file cannot be used; nothing was written then.
    """
    progress("reading the log")
    ordinary = OrdinaryFlight(
        log,
        folder,
        options.request,
        options.weight_N if options.mass_kg is None else options.mass_kg * GRAVITY_MPS2,
        options.wing_area_m2,
        options.span_m,
        options.aircraft,
        options.propeller,
        command_line,
    )
    refuse_folder(log)
    firmware = firmware_of(log)
    if firmware:
        refuse_daemon_options(
            log,
            probe=options.probe,
            zero=options.zero,
            runs=options.runs,
            magnetometer=options.magnetometer,
            likelihood=options.by_likelihood or None,
            transducers=options.transducers,
            thrust_stand=options.thrust_stand,
        )
        check_writable(folder / "report.html")
        return ordinary.analyze_autopilot_log(firmware, progress)
    # Wrong input is refused before the numerical libraries are loaded, which takes a second.
    recorded = read_log(log)
    check_writable(folder / "report.html")
    if lacks_drag_topics(recorded):
        return ordinary.analyze_daemon_log(recorded, progress)
    refuse_autopilot_options(log, mass=options.mass_kg, wing_area=options.wing_area_m2, span=options.span_m)
    import_lean()
    given = replacements(options)
    from analysis.pipeline import analyze as run_pipeline
    from analysis.report.terminal import print_summary
    from analysis.report.write import write_report, write_run_list

    analysis = run_pipeline(
        recorded, given, progress, request=options.request, runs_file=options.runs, command_line=command_line,
        by_likelihood=options.by_likelihood,
    )  # fmt: skip
    progress("writing the report")
    replaced_report = write_report(analysis, folder)
    previous_runs = write_run_list(analysis, folder, log.name, given=options.runs)
    results = analysis.results
    return Done(
        results,
        lambda console: print_summary(results, folder / "report.html", console),
        previous_runs,
        replaced_report,
    )


def replacements(options: Options) -> "Replacements":
    """What the files given contain. Raises InputError when one of them, or the list of runs, cannot be used."""
    aircraft = load_aircraft(options.aircraft) if options.aircraft else None
    from flight.propeller_files import load_propeller

    propeller = load_propeller(options.propeller) if options.propeller else None
    from analysis.airdata.magnetometer import MAGNETOMETER_FILE
    from analysis.airdata.probe import PROBE_FILE
    from analysis.airdata.transducers import TRANSDUCERS_FILE
    from analysis.ground.thrust_stand import THRUST_STAND_FILE
    from analysis.log_contents import Replacements
    from analysis.maneuvers import runs_file as toml_file
    from analysis.signals.rest import ZERO_FILE

    if options.runs:
        toml_file.load(options.runs)  # a wrong one is refused before anything is computed
    files = {
        "aircraft.toml": options.aircraft,
        "propeller.csv": options.propeller,
        "probe.json": options.probe,
        "magnetometer.json": options.magnetometer,
        "transducers.json": options.transducers,
        "thrust_stand.json": options.thrust_stand,
        "zero.json": options.zero,
    }
    return Replacements(
        aircraft=aircraft,
        propeller=propeller,
        probe=PROBE_FILE.load(options.probe) if options.probe else None,
        magnetometer=MAGNETOMETER_FILE.load(options.magnetometer) if options.magnetometer else None,
        transducers=TRANSDUCERS_FILE.load(options.transducers) if options.transducers else None,
        thrust_stand=THRUST_STAND_FILE.load(options.thrust_stand) if options.thrust_stand else None,
        zero=ZERO_FILE.load(options.zero).by_channel() if options.zero else None,
        weight_N=options.weight_N,
        files={name: str(path) for name, path in files.items() if path is not None},
    )


def refuse_folder(log: Path) -> None:
    """Raises InputError for a folder; names a log in it."""
    if log.is_dir():
        inside = sorted(log.glob("*.mcap"))
        raise InputError(
            f"{log}: cannot be read, it is a folder; give a log, such as {inside[0] if inside else 'log.mcap'}"
        )
