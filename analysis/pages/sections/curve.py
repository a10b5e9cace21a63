"""The power-required curve in numbers, the drag polar, and a comparison of all methods."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from msgspec import UNSET

from flightpower.analysis.methods.interval_sources import Share
from flightpower.analysis.pages.answers import optimum_speed_text
from flightpower.analysis.pages.html_page import HtmlTable
from flightpower.analysis.pages.wording import every, listed_methods, meaning, short_name
from flightpower.analysis.records.flight import UNKNOWN_SPEED, Kind, PitchRateResult, PowerPoint, Results
from flightpower.analysis.results.next_flight import Sources
from flightpower.analysis.settings import FLOWN
from flightpower.flight.atmosphere import FOOT_POUND_PER_SECOND_W
from flightpower.flight.units import FOOT_M


class CurveSection(NamedTuple):
    title: str
    facts: list[tuple[str, str]]  # each a name and a text
    data: str  # the data behind the curve
    table: HtmlTable
    drag: HtmlTable | None  # for a curve of electrical power, if thrust is known
    thrust_basis: str
    parameters: HtmlTable
    stand: str  # thrust on the stand; "" if none was measured


def curve_section(results: Results) -> CurveSection:
    main, words = results.main, results.kind.words
    by_battery = results.kind is Kind.ELECTRICAL
    range_at = optimum_speed_text(main.best_range_speed or UNKNOWN_SPEED, main)
    facts = [
        (f"Least {words} at", optimum_speed_text(main.least_power_speed or UNKNOWN_SPEED, main)),
        ("Best range at" if by_battery else "Least drag at", range_at + _best_range_on_battery(results)),
    ]
    if polar := results.drag_polar:
        best = "–" if polar.maximum_lift_to_drag is None else f"{polar.maximum_lift_to_drag:.1f}"
        sentence = f"C_D0 {polar.CD0:.4f}, Oswald efficiency {polar.oswald_efficiency:.2f}, (L/D)max {best}"
        facts.append(("Drag polar", sentence))
    return CurveSection(
        title="Electrical power and drag" if by_battery else "Power-required curve and drag polar",
        facts=[*facts, ("Data", f"{_data(results)}; estimation {results.verdict}")],
        data=_data(results),
        table=_curve_table(results),
        drag=_drag_table(results) if by_battery else None,
        thrust_basis=results.balance.thrust_basis if results.balance else "",
        parameters=HtmlTable(
            ("parameter", "estimate", "standard error", "unit"),
            [(meaning(p.name), f"{p.value:.5g}", f"{p.standard_error:.2g}", p.unit) for p in results.parameters],
        ),
        stand=_stand(results),
    )


def _stand(results: Results) -> str:
    """Say what thrust at rest was known before the flight, and what the flight's estimate gives."""
    measurements = results.pooling.prior_measurements if results.pooling else UNSET
    ratio = {p.name: p for p in results.parameters}.get("static_thrust_ratio")
    if ratio is None or not measurements:
        return ""
    before = measurements[0]
    return (
        f"Thrust at rest was measured on a stand: {1 + before.value:.3f} ± {before.sigma:.3f} times that of the"
        " propeller table (standard error, with that of the straight line from rest to flight). With this flight it is"
        f" {ratio.value:.3f} ± {ratio.standard_error:.3f}."
    )


def _best_range_on_battery(results: Results) -> str:
    """Say what speed gives best range on the battery, and why, if it is not the speed of least drag."""
    least_drag = results.best_range_speed.speed_mps
    if results.use is None or least_drag is None:
        return ""
    best = results.use.loadings[0].range_speed_mps.value
    if abs(best / least_drag - 1) < FLOWN.nearby:
        return ""
    return f"; best range on the battery at {best:.1f} m/s, where propeller and motor are more efficient"


def _drag_table(results: Results) -> HtmlTable | None:
    """Return drag and shaft power at the speeds of the curve; None if thrust is not known."""
    if not results.power_required:
        return None
    shaft = {p.speed_mps: p for p in results.points(Kind.SHAFT)}
    return HtmlTable(
        ("speed, m/s", "power required, W", "95 % interval, W", "drag, N", "shaft power, W"),
        [
            (
                f"{p.speed_mps:.1f}",
                f"{p.power_W:.0f}",
                f"{p.power_lo_W:.0f} to {p.power_hi_W:.0f}",
                f"{p.power_W / p.speed_mps:.2f}",
                f"{shaft[p.speed_mps].power_W:.0f}" if p.speed_mps in shaft else "",
            )
            for p in every(results.power_required)
        ],
        numbers=True,
    )


def _data(results: Results) -> str:
    """Return the number of runs of each kind, or the length of the flight."""
    if results.balance:
        return f"{results.balance.flown_s / 60:.1f} min in the air"
    kinds = [run.kind for run in results.runs]
    counts = ((kinds.count(kind), kind) for kind in ("acceleration", "deceleration"))
    return " and ".join(f"{n} {kind}{'' if n == 1 else 's'}" for n, kind in counts)


def at_whole_speeds(points: Sequence[PowerPoint], most: int = 40) -> list[PowerPoint]:
    """Interpolate the curve at whole m/s, at each or every few of them; empty if it spans fewer than two of them."""
    V = [point.speed_mps for point in points]
    speeds_mps = np.arange(math.ceil(min(V, default=0.0)), math.floor(max(V, default=0.0)) + 1)
    if len(speeds_mps) < 2:
        return []
    speeds = speeds_mps[:: math.ceil(len(speeds_mps) / most)].astype(float)
    names = ("power_W", "power_lo_W", "power_hi_W")
    columns = (np.interp(speeds, V, [getattr(point, name) for point in points]).tolist() for name in names)
    return [
        PowerPoint(speed_mps=v, power_W=p, power_lo_W=lo, power_hi_W=hi)
        for v, p, lo, hi in zip(speeds.tolist(), *columns, strict=True)
    ]


def _curve_table(results: Results) -> HtmlTable:
    points = at_whole_speeds(results.main.points) if results.kind is Kind.ELECTRICAL else []
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
            for p in points or every(results.main.points)
        ],
        numbers=True,
    )


ERRORS_IN_COMMON = (
    "errors of the sensors, of the propeller table, of the alignment of the axes and of weight, and air that rises or"
    " sinks"
)


def shares_of_shared(sources: Sources | None, speed_mps: float) -> dict[Share, float]:
    """Return shares of the variance of power at a speed of all sources common to the runs, largest first.

    Sources below half a percent are left out. Empty if the sources cannot be separated.
    """
    if sources is None:
        return {}
    variances = {source: float(part[0]) for source, part in sources(np.array([speed_mps])).items()}
    if Share.SHARED in variances:
        return {}
    total = sum(variances.values())
    common = {source: variance / total for source, variance in variances.items() if source is not Share.NOISE}
    return {source: share for source, share in sorted(common.items(), key=lambda item: -item[1]) if share >= 0.005}


def in_percent(shares: Mapping[Share, float]) -> str:
    """Return text such as "40 % comes from updraft, 9 % from airspeed"."""
    first, *others = (f"from {source}" for source in shares)
    percents = [f"{100 * share:.0f} %" for share in shares.values()]
    rest = (f", {percent} {other}" for percent, other in zip(percents[1:], others, strict=True))
    return f"{percents[0]} comes {first}{''.join(rest)}"


def shared_part(results: Results, sources: Sources | None = None) -> str:
    """Say how much of the interval does not shrink with more data, and why; empty if that is not known."""
    parts = results.main.interval_parts
    if not parts:
        return ""
    middle = parts[len(parts) // 2]
    total_W = math.hypot(middle.systematic_W, middle.noise_W)
    shared = f"Of the ±{total_W:.1f} W at {middle.speed_mps:.0f} m/s, ±{middle.systematic_W:.1f} W is common to"
    if results.kind is Kind.ELECTRICAL:
        return (
            f"{shared} the whole flight, so that a longer flight does not reduce it: airspeed, current meter, mass,"
            " density"
        )
    shares = shares_of_shared(sources, middle.speed_mps)
    causes = f"of the variance, {in_percent(shares)}" if shares else ERRORS_IN_COMMON
    return f"{shared} all runs and does not shrink with more of them: {causes}"


class MethodsSection(NamedTuple):
    table: HtmlTable
    disagreements: list[str]
    agree: bool  # whether methods were compared and no pair disagrees
    cross_check_differs: bool
    points: bool  # whether a method has measured points
    pitch_rate: str  # significance of C_Lq; empty if it was not estimated
    says: str  # whether they agree, in a few words


def methods_section(results: Results) -> MethodsSection | None:
    """Return the section; None if no other method gave a curve."""
    if not results.methods:
        return None
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


def _pitch_rate(rate: PitchRateResult | None) -> str:
    if rate is None:
        return ""
    ratios = ", ".join(f"{ratio:.2g} in the {run}" for run, ratio in rate.signal_to_noise.items())
    differs = "differs significantly" if rate.significant else "does not differ significantly"
    return (
        f"Pitch rate over its noise ({rate.noise_radps:.4f} rad/s), as variances (4.7): {ratios}. Lift due to pitch"
        f" rate, by maximum likelihood: C_Lq = {rate.CLq:.1f} ± {rate.standard_error:.1f} (standard error),"
        f" t = {rate.t:.1f} (4.4); it {differs} from zero, for which {rate.critical_t:.2f} would be needed."
    )


def _power_at_ends(curve: Sequence[PowerPoint]) -> tuple[str, str]:
    """Return power with half its 95 % interval at the slowest and at the fastest speed of a curve."""
    if not curve:
        return "no curve", ""
    slow, fast = (
        f"{p.power_W:.0f} ± {(p.power_hi_W - p.power_lo_W) / 2:.0f} at {p.speed_mps:.1f} m/s"
        for p in (curve[0], curve[-1])
    )
    return slow, fast
