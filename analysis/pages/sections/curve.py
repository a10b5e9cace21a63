"""The power-required curve in numbers, the drag polar, and how all methods compare."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from msgspec import UNSET

from analysis.pages.answers import optimum_speed_text
from analysis.pages.html_page import HtmlTable
from analysis.pages.wording import every, listed_methods, meaning, short_name
from analysis.records.flight import PitchRateResult, PowerPoint, Results
from analysis.settings import FLOWN
from flight.atmosphere import FOOT_POUND_PER_SECOND_W
from flight.units import FOOT_M


class CurveSection(NamedTuple):
    least_power: str
    least_drag: str
    zero_lift_drag: str
    oswald_efficiency: str
    lift_to_drag: str
    runs: str  # how many of which kind
    data: str
    table: HtmlTable
    shared_part: str  # at which speed how much of the interval all runs share; "" where it is not known
    parameters: HtmlTable
    stand: str  # thrust on the stand; "" without one


def curve_section(results: Results) -> CurveSection:
    polar = results.drag_polar
    assert polar is not None  # this page is that of a known drag
    best = polar.maximum_lift_to_drag
    return CurveSection(
        least_power=optimum_speed_text(results.minimum_power_speed),
        least_drag=optimum_speed_text(results.best_range_speed) + _best_range_on_battery(results),
        zero_lift_drag=f"{polar.CD0:.4f}",
        oswald_efficiency=f"{polar.oswald_efficiency:.2f}",
        lift_to_drag="–" if best is None else f"{best:.1f}",
        runs=_run_count(results),
        data=f"{_run_count(results)}; estimation {results.verdict}",
        table=_curve_table(results),
        shared_part=_shared_part(results),
        parameters=HtmlTable(
            ("parameter", "meaning", "estimate", "standard error", "unit"),
            [
                (p.name, meaning(p.name), f"{p.value:.5g}", f"{p.standard_error:.2g}", p.unit)
                for p in results.parameters
            ],
        ),
        stand=_stand(results),
    )


def _stand(results: Results) -> str:
    """What was known of thrust at rest before the flight, and what the flight makes of it."""
    measurements = results.pooling.prior_measurements if results.pooling else UNSET
    found = {p.name: p for p in results.parameters}.get("static_thrust_ratio")
    if found is None or not measurements:
        return ""
    before = measurements[0]
    return (
        f"Thrust at rest was measured on a stand: {1 + before.value:.3f} ± {before.sigma:.3f} times that of the"
        " propeller table (standard error, with that of the straight line from rest to flight). With this flight it is"
        f" {found.value:.3f} ± {found.standard_error:.3f}."
    )


def _best_range_on_battery(results: Results) -> str:
    """The speed of longest range on the battery, where it is not that of least drag, and why."""
    least_drag = results.best_range_speed.speed_mps
    if results.use is None or least_drag is None:
        return ""
    best = results.use.loadings[0].range_speed_mps.value
    if abs(best / least_drag - 1) < FLOWN.nearby:
        return ""
    return f"; longest range on the battery at {best:.1f} m/s, where propeller and motor are more efficient"


def _run_count(results: Results) -> str:
    kinds = [run.kind for run in results.runs]
    counts = ((kinds.count(kind), kind) for kind in ("acceleration", "deceleration"))
    return " and ".join(f"{n} {kind}{'' if n == 1 else 's'}" for n, kind in counts)


def _curve_table(results: Results) -> HtmlTable:
    return HtmlTable(
        ("speed, m/s", "ft/s", "power, W", "95 % interval, W", "ft lbf/s"),
        [
            (
                f"{p.speed_mps:.1f}",
                f"{p.speed_mps / FOOT_M:.0f}",
                f"{p.power_W:.1f}",
                f"{p.power_lo_W:.1f} to {p.power_hi_W:.1f}",
                f"{p.power_W / FOOT_POUND_PER_SECOND_W:.1f}",
            )
            for p in every(results.power_required)
        ],
        numbers=True,
    )


def _shared_part(results: Results) -> str:
    if not results.interval_parts:
        return ""
    middle = results.interval_parts[len(results.interval_parts) // 2]
    whole = math.hypot(middle.systematic_W, middle.noise_W)
    return (
        f"Of ±{whole:.1f} W at {middle.speed_mps:.0f} m/s, ±{middle.systematic_W:.1f} W is common to all runs and does"
        " not shrink with more of them"
    )


class MethodsSection(NamedTuple):
    table: HtmlTable
    disagreements: list[str]
    agree: bool  # methods were compared and no pair disagrees
    cross_check_differs: bool
    points: bool  # a method has points of its own
    pitch_rate: str  # significance of C_Lq; empty where it was not estimated
    says: str  # whether they agree, in a few words


def methods_section(results: Results) -> MethodsSection:
    rows = [
        (
            method.title,
            method.equations,
            ", ".join(short_name(name) for name in method.taken_as_measured),
            *_power_at_ends(method.power_required),
            "; ".join(method.notes),
        )
        for method in listed_methods(results)
    ]
    return MethodsSection(
        HtmlTable(("method", "equations", "taken as measured", "slowest, W", "fastest, W", "notes"), rows),
        [disagreement.text for disagreement in results.disagreements],
        bool(results.methods) and not results.disagreements,
        results.cross_check_differs,
        any(method.points for method in results.methods),
        _pitch_rate(results.pitch_rate),
        f"{len(results.disagreements)} pairs disagree" if results.disagreements else "none disagrees",
    )


def _pitch_rate(found: PitchRateResult | None) -> str:
    if found is None:
        return ""
    ratios = ", ".join(f"{ratio:.2g} in the {run}" for run, ratio in found.signal_to_noise.items())
    differs = "differs significantly" if found.significant else "does not differ significantly"
    return (
        f"Pitch rate over its noise ({found.noise_radps:.4f} rad/s), as variances (4.7): {ratios}. Lift due to pitch"
        f" rate, by maximum likelihood: C_Lq = {found.CLq:.1f} ± {found.standard_error:.1f} (standard error),"
        f" t = {found.t:.1f} (4.4); it {differs} from zero, for which {found.critical_t:.2f} would be needed."
    )


def _power_at_ends(curve: Sequence[PowerPoint]) -> tuple[str, str]:
    """Power with half its 95 % interval at the slowest and at the fastest speed of a curve."""
    if not curve:
        return "no curve", ""
    slow, fast = (
        f"{p.power_W:.0f} ± {(p.power_hi_W - p.power_lo_W) / 2:.0f} at {p.speed_mps:.1f} m/s"
        for p in (curve[0], curve[-1])
    )
    return slow, fast
