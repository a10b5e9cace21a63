"""Endurance, range and climb at several weights and densities, the power train, and values for an autopilot."""

import csv
import io
from collections.abc import Sequence
from typing import NamedTuple

from flightpower.analysis.pages.answers import battery_text, interval_text
from flightpower.analysis.pages.html_page import HtmlTable
from flightpower.analysis.pages.sections import performance as field_table
from flightpower.analysis.pages.wording import meaning
from flightpower.analysis.records.flight import Interval, PerformanceResult, WithCurves
from flightpower.flight.units import GRAVITY_MPS2


class PerformanceSection(NamedTuple):
    battery: str
    costs: list[str]
    field_heading: str
    field_assumption: str
    speeds: HtmlTable
    loadings: HtmlTable
    extrapolated: bool  # whether a line of the tables has field_table.MARK
    power_train_basis: str
    efficiency_points: str
    full_throttle: str
    parameters: HtmlTable


def performance_section(results: WithCurves, use: PerformanceResult | None) -> PerformanceSection | None:
    """Return the section; None if the propeller table does not allow performance."""
    if use is None:
        return None
    notes = (use.available.basis, ceilings(use), *use.available.notes, use.available.reason)
    return PerformanceSection(
        battery=f"{battery_text(results, ' of which')} are used",
        costs=[*use.costs, *use.too_much],
        field_heading=field_table.heading(results),
        field_assumption=field_table.assumption(use),
        speeds=HtmlTable(field_table.SPEEDS, field_table.speed_rows(use), numbers=True),
        loadings=HtmlTable(field_table.LOADINGS, field_table.loading_rows(use), numbers=True),
        extrapolated=field_table.has_extrapolation(use),
        power_train_basis=use.power_train.basis,
        efficiency_points=EFFICIENCY_POINTS if use.power_train.points else "",
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
    """State service and absolute ceiling, as far as they are known."""
    service, absolute = use.available.service_ceiling_m, use.available.absolute_ceiling_m
    sentences = []
    if service:
        sentences.append(f"Service ceiling (climb of 0.5 m/s): density altitude {interval_text(service, 'm', 0)}.")
    if absolute:
        sentences.append(f"Absolute ceiling (no climb): density altitude {interval_text(absolute, 'm', 0)}.")
    if sentences:
        sentences.append("The battery may not last that far.")
    return " ".join(sentences)


EFFICIENCY_POINTS = " Circles: means over a few seconds of steady or slowly changing flight, climbing or not."
IN_LOG = "in the log"
HEADER = ("autopilot", "parameter", "value", "95 % interval", "unit", "firmware", IN_LOG, "from")
AIRSPEEDS = (
    "Airspeeds are equivalent airspeeds, which autopilots call calibrated. They hold once the airspeed's own error is"
    " corrected. No value lies below the slowest of the curve. `flightpower parameters` writes the file: it raises the"
    " lowest airspeed and cruise to 1.2 times the stall speed (--stall, or else the slowest of the curve), and gives"
    " sink and power at that cruise."
)


class AutopilotSection(NamedTuple):
    parameters: HtmlTable
    airspeeds: str
    withheld: list[str]


def autopilot_section(results: WithCurves) -> AutopilotSection | None:
    """Return the section; None if no parameter follows."""
    if not results.autopilot_parameters:
        return None
    logged = any(parameter.logged is not None for parameter in results.autopilot_parameters)
    rows = [
        (
            parameter.firmware,
            parameter.name,
            _number(parameter.value),
            f"{_number(parameter.lo)} to {_number(parameter.hi)}",
            parameter.unit,
            parameter.versions,
            *(("" if parameter.logged is None else _number(parameter.logged),) if logged else ()),
            parameter.basis,
        )
        for parameter in results.autopilot_parameters
    ]
    header = [name for name in HEADER if logged or name != IN_LOG]
    return AutopilotSection(HtmlTable(header, rows), AIRSPEEDS, results.autopilot_parameters_withheld)


def _number(value: float) -> str:
    """Format a number: no decimals from 100 up, three decimals below 1."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3f}" if abs(value) < 2 else f"{value:.1f}"


SPEEDS = ("speed, m/s", "power required, W", "from the battery, W", "endurance, min", "range, km", "climb, m/s")


LOADINGS = ("", "mass, kg", "endurance, min", "at m/s", "range, km", "at m/s", "top speed, m/s", "climb, m/s")


SLOWER = "Do not fly slower than the slowest flown: no slower flight was measured."


MARK = " *"  # marks an extrapolated row


def speed_rows(use: PerformanceResult) -> list[list[str]]:
    """Return rows under SPEEDS, at the weight and air density of the flight."""
    return [
        [
            f"{row.speed_mps:.0f}{MARK if row.extrapolated else ''}",
            f"{row.power_required_W:.0f}",
            f"{row.battery_W:.0f}",
            f"{row.endurance_s / 60:.0f}",
            f"{row.range_m / 1000:.1f}",
            "–" if row.climb_mps is None else f"{row.climb_mps:.1f}",
        ]
        for row in use.field_table
    ]


def loading_rows(use: PerformanceResult) -> list[list[str]]:
    """Return rows under LOADINGS, one for each weight and air density."""
    return [
        [
            f"{case.title}{MARK if case.extrapolated else ''}",
            f"{case.weight_N / GRAVITY_MPS2:.2f}",
            f"{case.endurance_s.value / 60:.0f}",
            _best_speed(case.endurance_speed_mps, case.endurance_at_slowest, case.endurance_at_fastest),
            f"{case.range_m.value / 1000:.1f}",
            _best_speed(case.range_speed_mps, case.range_at_slowest, case.range_at_fastest),
            _value_or_dash(case.maximum_speed_mps),
            _value_or_dash(case.best_climb_mps),
        ]
        for case in use.loadings
    ]


def _best_speed(speed: Interval, at_slowest: bool, at_fastest: bool) -> str:
    """Return "11.6", or "11.6 (slowest)" or "24.0 (fastest)" at an end of the speeds flown."""
    end = "\u00a0(slowest)" if at_slowest else "\u00a0(fastest)" if at_fastest else ""  # no line break here
    return f"{speed.value:.1f}{end}"


def has_extrapolation(use: PerformanceResult) -> bool:
    """Whether any row is marked with MARK."""
    return any(row.extrapolated for row in use.field_table) or any(case.extrapolated for case in use.loadings)


def _value_or_dash(interval: Interval | None) -> str:
    return "–" if interval is None else f"{interval.value:.1f}"


def heading(results: WithCurves) -> str:
    """Return aircraft, weight, air density, propeller and battery for which the table is valid."""
    return (
        f"{results.aircraft.title}, {results.test.weight_N / GRAVITY_MPS2:.2f} kg,"
        f" air {results.test.air_density_kgpm3:.3f} kg/m³, propeller {results.aircraft.propeller},"
        f" {battery_text(results, ' of which')} are used"
    )


def assumption(use: PerformanceResult) -> str:
    """Say what the battery column assumes; "" if the power train was measured."""
    return "" if use.power_train.measured else use.power_train.basis


def to_markdown(results: WithCurves, use: PerformanceResult) -> str:
    """Return both tables with heading and notes."""
    parts = [f"# {heading(results)}", _markdown(SPEEDS, speed_rows(use)), _markdown(LOADINGS, loading_rows(use))]
    if has_extrapolation(use):
        parts.append("\\* outside the propeller table: an extrapolation.")
    parts += use.too_much
    parts.append(
        "Level flight in still air, true airspeed. Climb and top speed at full throttle."
        f" Slowest, fastest: of the speeds flown. {SLOWER}"
    )
    if assumption(use):
        parts.append(assumption(use))
    return "\n\n".join(parts) + "\n"


def _markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] + ["---:"] * (len(header) - 1), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def to_csv(results: WithCurves, use: PerformanceResult) -> str:
    """Return a line for each speed, at the weight and air density of the flight; units are in the header."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names = ("speed_mps", "power_required_W", "battery_W", "endurance_s", "range_m", "climb_mps")
    writer.writerow(["weight_N", "air_density_kgpm3", *names, "extrapolated"])
    for row in use.field_table:
        numbers = [getattr(row, name) for name in names]
        cells = ["" if number is None else f"{number:.5g}" for number in numbers]
        condition = (f"{results.test.weight_N:.5g}", f"{results.test.air_density_kgpm3:.5g}")
        writer.writerow([*condition, *cells, "true" if row.extrapolated else "false"])
    return out.getvalue()
