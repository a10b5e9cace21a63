"""Writing and printing of the results of several flights together, and of a comparison."""

from pathlib import Path
from typing import Any

import msgspec
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from analysis.files import write_file
from analysis.report.answers import HeadlineAnswer
from analysis.report.html_page import HtmlTable
from analysis.report.pooled_page import (
    comparison_answers,
    curve_table,
    differences_table,
    pooled_answers,
    render_comparison,
    render_electrical_flights,
    render_pooled,
)

FLIGHTS_FORMAT = "flightpower-flights-1"
ROWS = 8  # of a table on the terminal


def write_pooled(pooled: dict[str, Any], folder: Path) -> None:
    """Write report.html and results.json. Raises InputError when the folder cannot be written."""
    _write(render_pooled(pooled), pooled, folder)


def write_electrical_flights(flights: list[dict[str, Any]], failures: list[str], folder: Path) -> None:
    """Write report.html and results.json of flights whose electrical power stands side by side, not pooled.

    Raises InputError when the folder cannot be written.
    """
    content = {"format": FLIGHTS_FORMAT, "flights": flights, "failures": failures}
    _write(render_electrical_flights(content), content, folder)


def write_comparison(comparison: dict[str, Any], folder: Path) -> None:
    """Write report.html and results.json. Raises InputError when the folder cannot be written."""
    _write(render_comparison(comparison), comparison, folder)


def print_pooled(pooled: dict[str, Any], page: Path, console: Console) -> None:
    """Print the curve, the answers, warnings, and where the page is."""
    console.print(_table(f"{pooled['aircraft']['title']}: power required", curve_table(pooled, ROWS)))
    _print_answers(console, pooled_answers(pooled))
    outliers = [f"{one['log']} is an outlier: {one['reason']}" for one in pooled["outliers"]]
    for warning in [*pooled["notes"], *outliers, *pooled["left_out"]]:
        _print(console, f"[yellow]note:[/yellow] {escape(warning)}")
    _print(console, f"report: {escape(str(page))}")


def print_comparison(comparison: dict[str, Any], page: Path | None, console: Console) -> None:
    """Print the difference, the answers, and where the page is."""
    title = f"A: {comparison['a']['name']}, B: {comparison['b']['name']}"
    console.print(_table(title, differences_table(comparison["differences"], ROWS)))
    _print_answers(console, comparison_answers(comparison))
    _print(console, escape(comparison["text"]))
    if page:
        _print(console, f"report: {escape(str(page))}")


def _write(page: str, content: dict[str, Any], folder: Path) -> None:
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
