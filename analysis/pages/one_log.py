"""Analyzes one log and writes its report into a folder, for commands, the local page, and runs over many logs."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rich.console import Console

from flightpower.analysis.beside import beside
from flightpower.analysis.options import Options
from flightpower.analysis.pages.lean_imports import import_lean
from flightpower.analysis.pipeline import analyze
from flightpower.analysis.sources.open import open_source
from flightpower.flight.files import check_writable

if TYPE_CHECKING:
    from flightpower.analysis.maneuvers.runs_file import NoCurve
    from flightpower.analysis.pages.predicted_polar import PredictedPolar
    from flightpower.analysis.records.flight import Results

Progress = Callable[[str], None]


class Report(NamedTuple):
    """The results that were written, and notes on them."""

    results: "Results"
    print_summary: Callable[[Console], None]
    backup: Path | None = None  # where earlier content of a user-edited file was saved, if any
    replaced_report: str = ""  # how a replaced report differed; empty if none did


def analyze_log(log: Path, folder: Path, options: Options, progress: Progress, command_line: str = "") -> Report:
    """Write the report of a log into `folder`. command_line: the command to name in the report.

    Raises InputError when the log or a file cannot be used; then nothing has been written, except for the list of
    candidates if no maneuver of the flight gives a curve.
    """
    progress("reading the log")
    check_writable(folder / "report.html")
    reading = beside(lambda: open_source(log, options.columns))
    import_lean()
    source = reading()

    def with_candidates(error: "NoCurve") -> str:
        if options.runs or not error.maneuvers.rejected:
            return str(error)
        from flightpower.analysis.pages.write import write_candidates

        path = write_candidates(error.maneuvers, folder, log.name)
        remedy = f"set keep = true in {path}, where all candidates are with their reasons, and add --runs {path}"
        return f"{error}; to use a stretch anyway, {remedy}"

    predicted = _predicted_polar(options)
    analysis = analyze(source, options, progress, command_line=command_line, message_of=with_candidates)
    progress("writing the report")
    from flightpower.analysis.pages.terminal import print_summary
    from flightpower.analysis.pages.write import write_left_out, write_report, write_run_list
    from flightpower.analysis.pipeline.runs import Analysis

    replaced = write_report(analysis, folder, predicted)
    if isinstance(analysis, Analysis):
        backup = write_run_list(analysis, folder, log.name, source=options.runs)
    else:
        backup = write_left_out(analysis, folder)
    page, results = folder / "report.html", analysis.results
    return Report(results, lambda console: print_summary(results, page, console), backup, replaced)


def _predicted_polar(options: Options) -> "PredictedPolar | None":
    if options.polar is None:
        return None
    from flightpower.analysis.pages.predicted_polar import read_predicted_polar

    return read_predicted_polar(options.polar)
