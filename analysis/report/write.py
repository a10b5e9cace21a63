"""Writing of the report: HTML page, results as JSON and CSV, trajectory, table for the field."""

from pathlib import Path

from analysis.files import write_file, write_keeping_previous
from analysis.maneuvers.toml_file import to_toml
from analysis.pipeline import Analysis
from analysis.report import field_table, page
from analysis.report.report_figures import figures_by_name, run_fits
from analysis.report.trajectory_csv import trajectory_csv
from analysis.results.files import to_csv, to_json
from analysis.results.previous import replaced


def write_report(analysis: Analysis, folder: Path) -> str:
    """Write report.html, results.json, power_required.csv, path.csv and field_table.md and .csv into `folder`.

    Returns what of another log or of other options they replaced, in a sentence; empty where they replaced nothing.
    Everything is computed before the first file is written. Raises InputError when the folder cannot be written.
    """
    results = analysis.results
    files: dict[str, str | bytes] = {
        "results.json": to_json(results),
        "power_required.csv": to_csv(results),
        "path.csv": trajectory_csv(analysis.trajectory),
    }
    if results.use:
        files["field_table.md"] = field_table.to_markdown(results, results.use)
        files["field_table.csv"] = field_table.to_csv(results, results.use)
    before = replaced(folder, results, files)
    files["report.html"] = page.render(results, figures_by_name(analysis), run_fits(analysis), replaced=before)
    for name, content in files.items():
        write_file(folder / name, content)
    return before


def write_run_list(analysis: Analysis, folder: Path, log_name: str, *, given: Path | None) -> Path | None:
    """Write runs.toml into `folder`; returns where other content that was there is kept, if there was any.

    given: the list of runs that the analysis used. It is not overwritten, since it holds the user's remarks.
    Raises InputError when the file cannot be written.
    """
    path = folder / "runs.toml"
    if given is not None and path.exists() and path.samefile(given):
        return None
    return write_keeping_previous(path, to_toml(analysis.maneuvers, log_name))
