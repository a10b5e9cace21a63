"""Values to type into an autopilot."""

from typing import NamedTuple

from analysis.report.html_page import HtmlTable
from analysis.results.schema import Results

HEADER = ("autopilot", "parameter", "value", "95 % interval", "unit", "firmware", "in the log", "from")
AIRSPEEDS = (
    "Airspeeds are equivalent airspeeds, which autopilots call calibrated. They hold once the airspeed's own error is"
    " corrected. No value lies below the slowest speed flown."
)


class AutopilotSection(NamedTuple):
    parameters: HtmlTable
    airspeeds: str
    withheld: list[str]


def autopilot_section(results: Results) -> AutopilotSection | None:
    """None where nothing follows."""
    if not results.autopilot_parameters:
        return None
    rows = [
        (
            one.firmware,
            one.name,
            _number(one.value),
            f"{_number(one.lo)} to {_number(one.hi)}",
            one.unit,
            one.versions,
            "" if one.logged is None else _number(one.logged),
            one.basis,
        )
        for one in results.autopilot_parameters
    ]
    return AutopilotSection(HtmlTable(HEADER, rows), AIRSPEEDS, results.autopilot_parameters_withheld)


def _number(value: float) -> str:
    """Whole from 100 on, three decimals below 1."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3f}" if abs(value) < 2 else f"{value:.1f}"
