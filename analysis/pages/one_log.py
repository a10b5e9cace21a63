"""The analysis of one log as the command line asks for it: reads the files that options name, writes the report."""

import contextlib
from collections.abc import Callable
from pathlib import Path

from analysis.options import Options, refuse_autopilot_options, refuse_drag_options
from analysis.pages.electrical_log import Done, OrdinaryFlight, gives_electrical_power, lacks_drag_topics
from analysis.pages.lean_imports import import_lean
from analysis.sources.recognize import autopilot_of
from flight.errors import InputError
from flight.files import check_writable
from flight.log_reader import Log, read_log
from flight.units import GRAVITY_MPS2

Progress = Callable[[str], None]


def analyze_log(log: Path, folder: Path, options: Options, progress: Progress, command_line: str = "") -> Done:
    """Write the report of a log into `folder`. command_line: that asked for it, for the report.

    Raises InputError when the log or a file cannot be used; nothing was written then, except for the candidates of a
    flight in which no maneuver gives a curve.
    """
    progress("reading the log")
    if options.mass_kg is not None and options.weight_N is not None:
        raise InputError(f"{log}: --mass and --weight: one quantity in two units; give one of them")
    ordinary = OrdinaryFlight(
        log,
        folder,
        options.request,
        options.weight_N if options.mass_kg is None else options.mass_kg * GRAVITY_MPS2,
        options.wing_area_m2,
        options.span_m,
        options.air_temperature_K,
        options.aircraft,
        options.propeller,
        command_line,
    )
    refuse_folder(log)
    autopilot = autopilot_of(log)
    for_drag = {
        "probe": options.probe,
        "zero": options.zero,
        "runs": options.runs,
        "magnetometer": options.magnetometer,
        "likelihood": options.likelihood or None,
        "transducers": options.transducers,
        "thrust_stand": options.thrust_stand,
        "polar": options.polar,
    }
    if autopilot:
        refuse_drag_options(log, "the log is an autopilot's", **for_drag)
        check_writable(folder / "report.html")
        return ordinary.analyze_autopilot_log(autopilot, progress)
    # Wrong input is refused before the numerical libraries are loaded, which takes a second.
    recorded = _read(log, options.columns)
    check_writable(folder / "report.html")
    if lacks_drag_topics(recorded):
        refuse_drag_options(log, "the log lacks flow angles or motor speed, and gives no drag", **for_drag)
        return ordinary.analyze_daemon_log(recorded, progress)
    if reason := _why_power_only(recorded, options):
        return ordinary.analyze_daemon_log(recorded, progress, reason)
    refuse_autopilot_options(
        log,
        mass=options.mass_kg,
        wing_area=options.wing_area_m2,
        span=options.span_m,
        air_temperature=options.air_temperature_K,
    )
    import_lean()
    given = options.replacements()
    from analysis.maneuvers.runs_file import NoCurve
    from analysis.pages.predicted_polar import read_predicted_polar
    from analysis.pages.terminal import print_summary
    from analysis.pages.write import write_candidates, write_report, write_run_list
    from analysis.pipeline import analyze as run_pipeline

    predicted = read_predicted_polar(options.polar) if options.polar else None
    try:
        analysis = run_pipeline(
            recorded, given, progress, request=options.request, runs_file=options.runs, command_line=command_line,
            by_likelihood=options.likelihood,
        )  # fmt: skip
    except NoCurve as error:
        said = str(error)
        if not options.runs and error.maneuvers.rejected:
            path = write_candidates(error.maneuvers, folder, log.name)
            remedy = f"set keep = true in {path}, where all candidates are with their reasons, and add --runs {path}"
            said = f"{error}; to use a stretch all the same, {remedy}"
        if options.runs or not gives_electrical_power(recorded):
            raise InputError(said) from None
        with contextlib.suppress(InputError):  # what was said of the runs is the cause
            return ordinary.analyze_daemon_log(recorded, progress, f"No drag: {said.removeprefix(f'{log}: ')}.")
        raise InputError(said) from None
    progress("writing the report")
    replaced_report = write_report(analysis, folder, predicted)
    previous_runs = write_run_list(analysis, folder, log.name, given=options.runs)
    results = analysis.results
    return Done(
        results,
        lambda console: print_summary(results, folder / "report.html", console),
        previous_runs,
        replaced_report,
    )


def _read(log: Path, columns: Path | None) -> Log:
    """A log of the daemon, or a table with the map of its columns. Raises InputError."""
    if is_table(log):
        from analysis.sources.table import log_of_table

        return log_of_table(log, columns)
    if columns is not None:
        raise InputError(f"{log}: --columns: only for tables (CSV, Parquet, .mat), and this is none")
    return read_log(log)


def is_table(log: Path) -> bool:
    """Whether a file is a table of columns. Raises InputError when it cannot be read."""
    from analysis.sources.table_file import table_kind

    return log.is_file() and table_kind(log) is not None


def _why_power_only(log: Log, options: Options) -> str:
    """A sentence where a table has the sensors of drag, but not the files, and so gives electrical power; else empty.

    A log of the daemon lacks these files by mistake, and is refused.
    """
    if not gives_electrical_power(log) or not is_table(log.path):
        return ""
    if options.aircraft is None:
        return "No drag: that needs --aircraft FILE, and with a column of motor speed the propeller's table."
    from analysis.air.contents import contents

    try:
        contents(log, options.replacements())
    except InputError as error:
        return f"No drag: {str(error).removeprefix(f'{log.path}: ')}."
    return ""


def refuse_folder(log: Path) -> None:
    """Raises InputError for a folder; names a log in it."""
    if log.is_dir():
        inside = sorted(log.glob("*.mcap"))
        raise InputError(
            f"{log}: cannot be read, it is a folder; give a log, such as {inside[0] if inside else 'log.mcap'}"
        )
