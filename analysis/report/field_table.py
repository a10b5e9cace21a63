"""The small table for the field, as Markdown and as CSV; the page shows the same rows."""

import csv
import io
from collections.abc import Sequence

from analysis.schema import Interval, PerformanceResult, Results
from flight.units import GRAVITY_MPS2

SPEEDS = ("speed, m/s", "power required, W", "from the battery, W", "endurance, min", "range, km", "climb, m/s")
LOADINGS = ("", "mass, kg", "endurance, min", "at m/s", "range, km", "at m/s", "top speed, m/s", "climb, m/s")
SLOWER = "Do not fly slower than the slowest flown: no slower flight was measured."
MARK = " *"  # of an extrapolated row


def speed_rows(use: PerformanceResult) -> list[list[str]]:
    """Rows under SPEEDS, at the weight and air density of the flight."""
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
    """Rows under LOADINGS, one for each weight and air density."""
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
    """ "11.6"; "11.6 (slowest)" or "24.0 (fastest)" where it is an end of the speeds flown."""
    end = "\u00a0(slowest)" if at_slowest else "\u00a0(fastest)" if at_fastest else ""  # the line must not break here
    return f"{speed.value:.1f}{end}"


def has_extrapolation(use: PerformanceResult) -> bool:
    """Whether any row bears MARK."""
    return any(row.extrapolated for row in use.field_table) or any(case.extrapolated for case in use.loadings)


def _value_or_dash(interval: Interval | None) -> str:
    return "–" if interval is None else f"{interval.value:.1f}"


def heading(results: Results, use: PerformanceResult) -> str:
    """Aircraft, weight, air density, propeller and battery that the table holds for."""
    return (
        f"{results.aircraft.title}, {results.test.weight_N / GRAVITY_MPS2:.2f} kg,"
        f" air {results.test.air_density_kgpm3:.3f} kg/m³, propeller {results.aircraft.propeller},"
        f" {use.battery_energy_Wh:g} Wh of which {100 * use.usable:.0f} % are used"
    )


def assumption(use: PerformanceResult) -> str:
    """What the battery column assumes; "" where the power train was measured."""
    return "" if use.power_train.measured else use.power_train.basis


def to_markdown(results: Results, use: PerformanceResult) -> str:
    """Both tables with heading and notes."""
    parts = [f"# {heading(results, use)}", _markdown(SPEEDS, speed_rows(use)), _markdown(LOADINGS, loading_rows(use))]
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


def to_csv(results: Results, use: PerformanceResult) -> str:
    """One line for each speed, at the weight and air density of the flight; units in the header."""
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
