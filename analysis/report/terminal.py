"""The summary of an analysis on the terminal."""

from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from analysis.report.answers import headline_answers
from analysis.schema import Results

CURVE_ROWS = 8


def print_summary(results: Results, page: Path, console: Console) -> None:
    """Print the curve, the headline answers, warnings, and where the page is."""
    console.print(_curve_table(results))
    for question, answer, note in headline_answers(results):
        console.print(f"[bold]{question}: {escape(answer)}[/bold]. {escape(note)}", highlight=False)
    for warning in [*results.warnings, *(disagreement.text for disagreement in results.disagreements)]:
        console.print(f"[yellow]note:[/yellow] {escape(warning)}", highlight=False)
    console.print(f"report: {escape(str(page))}")


def _curve_table(results: Results) -> Table:
    table = Table(title=f"{escape(results.aircraft.title)}: power required", title_justify="left")
    for heading in ("speed, m/s", "power, W", "95 % interval, W"):
        table.add_column(heading, justify="right")
    for point in results.power_required[:: len(results.power_required) // CURVE_ROWS or 1]:
        interval = f"{point.power_lo_W:.1f} to {point.power_hi_W:.1f}"
        table.add_row(f"{point.speed_mps:.1f}", f"{point.power_W:.1f}", interval)
    return table
