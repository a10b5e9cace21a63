"""The runs of the flight, and the stretches that were rejected."""

from typing import NamedTuple

from analysis.report.html_page import HtmlTable
from analysis.results.schema import Results


class FlightSection(NamedTuple):
    runs: HtmlTable
    rejected: HtmlTable | None


def flight_section(results: Results) -> FlightSection:
    runs = [
        (
            run.kind,
            f"{run.start_s:.1f}",
            f"{run.end_s - run.start_s:.1f}",
            f"{run.lowest_speed_mps:.1f} to {run.highest_speed_mps:.1f}",
            f"{run.altitude_change_m:+.1f}",
            "; ".join(run.notes),
        )
        for run in results.runs
    ]
    rejected = [(r.kind, f"{r.start_s:.1f}", f"{r.end_s - r.start_s:.1f}", r.reason) for r in results.rejected]
    return FlightSection(
        HtmlTable(("run", "start, s", "length, s", "speed, m/s", "height change, m", "notes"), runs),
        HtmlTable(("similar to", "start, s", "length, s", "reason"), rejected) if rejected else None,
    )
