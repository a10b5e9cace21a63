"""Endurance, range and climb at several weights and densities, the power train, and values for an autopilot."""

from typing import NamedTuple

from analysis.report import field_table
from analysis.report.answers import interval_text
from analysis.report.html_page import HtmlTable
from analysis.report.wording import meaning
from analysis.schema import PerformanceResult, Results


class PerformanceSection(NamedTuple):
    battery: str
    costs: list[str]
    field_heading: str
    field_assumption: str
    speeds: HtmlTable
    loadings: HtmlTable
    extrapolated: bool  # a line of the tables bears field_table.MARK
    power_train_basis: str
    full_throttle: str
    parameters: HtmlTable


def performance_section(results: Results) -> PerformanceSection | None:
    """None where the propeller table does not allow performance."""
    use = results.use
    if use is None:
        return None
    notes = (use.available.basis, ceilings(use), *use.available.notes, use.available.reason)
    return PerformanceSection(
        battery=f"{use.battery_energy_Wh:g} Wh of which {100 * use.usable:.0f} % are used",
        costs=[*use.costs, *use.too_much],
        field_heading=field_table.heading(results, use),
        field_assumption=field_table.assumption(use),
        speeds=HtmlTable(field_table.SPEEDS, field_table.speed_rows(use), numbers=True),
        loadings=HtmlTable(field_table.LOADINGS, field_table.loading_rows(use), numbers=True),
        extrapolated=field_table.has_extrapolation(use),
        power_train_basis=use.power_train.basis,
        full_throttle=" ".join(note for note in notes if note),
        parameters=HtmlTable(
            ("parameter", "meaning", "estimate", "standard error", "unit"),
            [
                (p.name, meaning(p.name), f"{p.value:.4g}", f"{p.standard_error:.2g}", p.unit)
                for p in use.power_train.parameters
            ],
        ),
    )


def ceilings(use: PerformanceResult) -> str:
    """Service and absolute ceiling in sentences, as far as they are known."""
    service, absolute = use.available.service_ceiling_m, use.available.absolute_ceiling_m
    sentences = []
    if service:
        sentences.append(f"Service ceiling (climb of 0.5 m/s): density altitude {interval_text(service, 'm', 0)}.")
    if absolute:
        sentences.append(f"Absolute ceiling (no climb): density altitude {interval_text(absolute, 'm', 0)}.")
    if sentences:
        sentences.append("The battery may not last that far.")
    return " ".join(sentences)


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
