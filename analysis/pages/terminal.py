"""Summaries on the terminal for a flight, several flights, a comparison, and a fleet."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from flightpower.analysis.pages.answers import HeadlineAnswer, headline_answers
from flightpower.analysis.pages.fleet_page import airframes_table, doubts, fleet_answers, news_table
from flightpower.analysis.pages.html_page import HtmlTable
from flightpower.analysis.pages.pooled_page import (
    comparison_answers,
    count,
    curve_table,
    differences_table,
    left_out_lines,
    pooled_answers,
)
from flightpower.analysis.pages.sections.summary import verdict_section
from flightpower.analysis.pages.wording import every
from flightpower.analysis.records.fleet import FleetResults
from flightpower.analysis.records.flight import Results
from flightpower.analysis.records.pool import ComparisonResults, Configuration, PooledResults, of_each_kind
from flightpower.flight.units import GRAVITY_MPS2


def print_summary(results: Results, page: Path, console: Console) -> None:
    """Print the curve, the headline answers, the verdict unless it is on stderr, warnings, and where the page is."""
    curve = HtmlTable(
        ("speed, m/s", "power, W", "95 % interval, W"),
        [
            (f"{point.speed_mps:.1f}", f"{point.power_W:.1f}", f"{point.power_lo_W:.1f} to {point.power_hi_W:.1f}")
            for point in every(results.main.points, 8)
        ],
    )
    _print_table(console, f"{results.aircraft.title}: {results.kind.words}", curve)
    _print_answers(console, headline_answers(results))
    if not results.evidence:
        lines = verdict_section(results)
        console.print(f"{lines.heading}{lines.colon} {escape(lines.reasons)}".rstrip(), highlight=False)
    disagreements = (disagreement.text for disagreement in results.disagreements)
    _print_notes(console, [*results.warnings, *results.withheld, *disagreements])
    _print_page(console, page)


def print_pooled(pooled: PooledResults, page: Path, console: Console) -> None:
    """Print the curve, answers, warnings and number of flights for each kind of power, and where the page is."""
    for one_kind in of_each_kind(pooled):
        _print_table(console, f"{one_kind.aircraft.title}: {one_kind.kind.words}", curve_table(one_kind, 8))
        _print_answers(console, [*headline_answers(one_kind, one_kind.performance), *pooled_answers(one_kind)])
        counted = f"{len(one_kind.flights)} pooled, {len(one_kind.left_out)} left out, {len(one_kind.failures)} refused"
        console.print(f"flights: {counted}", highlight=False)
        _print_notes(console, [*one_kind.notes, *_left_out(one_kind)])
    _print_page(console, page)


def _left_out(results: PooledResults | Configuration) -> list[str]:
    return [f"left out: {line}" for line in left_out_lines(results)]


def print_comparison(comparison: ComparisonResults, page: Path | None, console: Console) -> None:
    """Print the difference, the answers, and where the page is."""
    for one_kind in of_each_kind(comparison):
        both_kg = one_kind.test.weight_N / GRAVITY_MPS2
        title = f"A: {one_kind.a.name}, B: {one_kind.b.name}, by {one_kind.kind.words}, both at {both_kg:.2f} kg"
        _print_table(console, title, differences_table(one_kind.differences, 8))
        _print_answers(console, comparison_answers(one_kind))
        console.print(escape(one_kind.text), highlight=False)
        _print_notes(console, [*one_kind.notes, *_left_out(one_kind.a), *_left_out(one_kind.b)])
    if page:
        _print_page(console, page)


def print_fleet(fleet: FleetResults, page: Path | None, console: Console) -> None:
    """Print changes, the airframes, files that could not be read, and where the page is."""
    news = news_table(fleet)
    if news.rows:
        _print_table(console, "what changed", news)
    title = f"{count(len(fleet.airframes), 'airframe')}, {count(fleet.flights, 'flight')}"
    _print_table(console, title, airframes_table(fleet))
    _print_answers(console, fleet_answers(fleet))
    _print_notes(console, [*doubts(fleet), *fleet.notes, *fleet.left_out])
    if page:
        _print_page(console, page)


def _print_table(console: Console, title: str, content: HtmlTable) -> None:
    table = Table(title=escape(title), title_justify="left")
    for heading in content.header:
        table.add_column(heading, justify="right")
    for row in content.rows:
        table.add_row(*row)
    console.print(table)


def _print_answers(console: Console, answers: Sequence[HeadlineAnswer]) -> None:
    for answer in answers:
        console.print(
            f"[bold]{answer.question}: {escape(answer.answer)}[/bold]. {escape(answer.note)}", highlight=False
        )


def _print_notes(console: Console, notes: Iterable[str]) -> None:
    for note in notes:
        console.print(f"[yellow]note:[/yellow] {escape(note)}", highlight=False)


def _print_page(console: Console, page: Path) -> None:
    console.print(f"report: {escape(str(page))}", highlight=False, soft_wrap=True)
