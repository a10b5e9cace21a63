"""Endurance, range and climb: the effect of weight and air density, the table for the field, and the power train."""

from typing import NamedTuple

from analysis.report import field_table
from analysis.report.answers import interval_text
from analysis.report.html_page import HtmlTable
from analysis.report.parameter_meaning import meaning
from analysis.results.schema import PerformanceResult, Results


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
