"""The reconstructed trajectory as CSV.

Writing of the report: HTML page, results as JSON and CSV, trajectory, table for the field.

Writing and printing of the results of several flights together, and of a comparison.
"""

from pathlib import Path
from typing import Any

import msgspec
import pandas as pd
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from analysis.files import write_file, write_keeping_previous
from analysis.maneuvers.runs_file import to_toml
from analysis.pipeline import Analysis
from analysis.pooling.results import ComparisonResults, PooledResults
from analysis.report import field_table, page
from analysis.report.answers import HeadlineAnswer
from analysis.report.html_page import HtmlTable
from analysis.report.page import figures_by_name, run_fits
from analysis.report.pooled_page import (
    comparison_answers,
    curve_table,
    differences_table,
    pooled_answers,
    pooled_warnings,
    render_comparison,
    render_electrical_flights,
    render_pooled,
)
from analysis.results.files import to_csv, to_json
from analysis.results.previous import replaced
from analysis.schema import ElectricalFlight
from analysis.trajectory.equations import GUST_FILTER_STATES, STATES
from analysis.trajectory.reconstruction import Trajectory

COLUMNS = {name: f"{name}_mps" for name in STATES}
COLUMNS |= {"phi": "roll_rad", "theta": "pitch_rad", "psi": "yaw_rad", "height": "height_m"}


def trajectory_csv(trajectory: Trajectory) -> str:
    """Every state with its standard error (`…_error`), one line each 0.2 s; units in the header."""
    states = trajectory.states.drop(columns=[*GUST_FILTER_STATES]).rename(columns=COLUMNS)
    errors = trajectory.states_error().drop(columns=[*GUST_FILTER_STATES]).rename(columns=COLUMNS).add_suffix("_error")
    table = pd.concat([states, errors], axis=1).reset_index()
    line = ",".join(["%.6g"] * table.shape[1])
    lines = [",".join(table.columns), *(line % tuple(row) for row in table.to_numpy().tolist()), ""]
    return "\n".join(lines).replace("nan", "")


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


FLIGHTS_FORMAT = "flightpower-flights-1"
ROWS = 8  # of a table on the terminal


def write_pooled(pooled: PooledResults, folder: Path) -> None:
    """Write report.html and results.json. Raises InputError when the folder cannot be written."""
    _write(render_pooled(pooled), pooled, folder)


def write_electrical_flights(flights: list[dict[str, Any]], failures: list[str], folder: Path) -> None:
    """Write report.html and results.json of flights whose electrical power stands side by side, not pooled.

    flights: contents of their results.json. Raises InputError when the folder cannot be written.
    """
    content = {"format": FLIGHTS_FORMAT, "flights": flights, "failures": failures}
    _write(render_electrical_flights(msgspec.convert(flights, list[ElectricalFlight]), failures), content, folder)


def write_comparison(comparison: ComparisonResults, folder: Path) -> None:
    """Write report.html and results.json. Raises InputError when the folder cannot be written."""
    _write(render_comparison(comparison), comparison, folder)


def print_pooled(pooled: PooledResults, page: Path, console: Console) -> None:
    """Print the curve, the answers, warnings, and where the page is."""
    console.print(_table(f"{pooled.aircraft.title}: power required", curve_table(pooled, ROWS)))
    _print_answers(console, pooled_answers(pooled))
    for warning in [*pooled_warnings(pooled), *pooled.left_out]:
        _print(console, f"[yellow]note:[/yellow] {escape(warning)}")
    _print(console, f"report: {escape(str(page))}")


def print_comparison(comparison: ComparisonResults, page: Path | None, console: Console) -> None:
    """Print the difference, the answers, and where the page is."""
    title = f"A: {comparison.a.name}, B: {comparison.b.name}"
    console.print(_table(title, differences_table(comparison.differences, ROWS)))
    _print_answers(console, comparison_answers(comparison))
    _print(console, escape(comparison.text))
    if page:
        _print(console, f"report: {escape(str(page))}")


def _write(page: str, content: object, folder: Path) -> None:
    write_file(folder / "results.json", msgspec.json.format(msgspec.json.encode(content), indent=1))
    write_file(folder / "report.html", page)


def _table(title: str, content: HtmlTable) -> Table:
    table = Table(title=escape(title), title_justify="left")
    for heading in content.header:
        table.add_column(heading, justify="right")
    for row in content.rows:
        table.add_row(*row)
    return table


def _print_answers(console: Console, answers: list[HeadlineAnswer]) -> None:
    for question, answer, note in answers:
        heading = question if question.endswith("?") else f"{question}:"
        _print(console, f"[bold]{escape(heading)} {escape(answer)}[/bold]. {escape(note)}")


def _print(console: Console, text: str) -> None:
    console.print(text, highlight=False)
