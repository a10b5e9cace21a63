"""The answers at the top of the page and of the terminal output: best speeds, endurance, range, full throttle."""

import math
from typing import NamedTuple

from flightpower.analysis.missions.plan_settings import MARGINS
from flightpower.analysis.records.flight import (
    UNKNOWN_SPEED,
    AvailableResult,
    CurveResult,
    Interval,
    Kind,
    PerformanceResult,
    Results,
    SlowestFlown,
    SpeedInterval,
    SpeedReason,
    WithCurves,
)

LEAST_POWER, LEAST_DRAG = "Power required is least there.", "Drag is least there."
BEYOND_TABLE = "Outside the propeller table: an extrapolation."


class HeadlineAnswer(NamedTuple):
    """A question, the answer, and a note on it, in plain text.

    speed_mps : the speed, if the answer is one remark : text after the speed, or the answer if it is not a speed
    """

    question: str
    remark: str
    note: str
    speed_mps: float | None = None

    @property
    def answer(self) -> str:
        return self.remark if self.speed_mps is None else f"{self.speed_mps:.1f} m/s{self.remark}"


def headline_answers(results: WithCurves, use: PerformanceResult | None = None) -> list[HeadlineAnswer]:
    """Return the speeds of best endurance and best range, and the performance at full throttle.

    Without a propeller table that allows performance (`results.use` is None), these are the speeds of least power and
    least drag. Results of electrical power give endurance and range at their best speeds. use: performance of a pool; a
    flight has it in its results
    """
    if results.kind is Kind.ELECTRICAL:
        return best_of_battery(results)
    use = use or (results.use if isinstance(results, Results) else None)
    if use is None:
        main = results.main
        return [
            _optimum(results, "Best endurance", main.least_power_speed or UNKNOWN_SPEED, LEAST_POWER),
            _optimum(results, "Best range", main.best_range_speed or UNKNOWN_SPEED, LEAST_DRAG),
        ]
    return [_endurance(results, use), _range(results, use), _full_throttle(results, use.available)]


def best_of_battery(results: WithCurves) -> list[HeadlineAnswer]:
    """Return speeds of best endurance and range by electrical power; with both values if the battery is known."""
    curve = results.curves[Kind.ELECTRICAL]
    power = {round(p.speed_mps, 6): p for p in curve.points}

    def note(speed_mps: float | None, on_battery: str) -> str:
        point = power.get(round(speed_mps or 0.0, 6))
        taken = f"{point.power_W:.0f} W ({point.power_lo_W:.0f} to {point.power_hi_W:.0f})" if point else ""
        below = " Power may still decrease below this speed: too little slow flight to tell."
        return f"{taken}{on_battery}, in still air.{below if _at_slowest(speed_mps, curve) else ''}"

    endurance = f", {interval_text(curve.endurance_s.times(1 / 60), 'min', 0)}" if curve.endurance_s else ""
    distance = f", {interval_text(curve.range_m.times(1e-3), 'km', 1)}" if curve.range_m else ""
    return [
        HeadlineAnswer(question, end_remark(speed, curve), note(speed.speed_mps, on_battery), speed.speed_mps)
        for question, speed, on_battery in (
            ("Best endurance", curve.least_power_speed or UNKNOWN_SPEED, endurance),
            ("Best range", curve.best_range_speed or UNKNOWN_SPEED, distance),
        )
    ]


def end_remark(best: SpeedInterval, curve: CurveResult) -> str:
    """Return the text after the speed; it names an end of the curve, since the best speed may lie beyond it."""
    if best.inside_flown_range or best.speed_mps is None:
        return optimum_remark(best)
    if _at_slowest(best.speed_mps, curve):
        return ", the slowest of the curve"
    return ", the fastest of the curve" if best.speed_mps == curve.points[-1].speed_mps else optimum_remark(best)


def _at_slowest(speed_mps: float | None, curve: CurveResult) -> bool:
    return speed_mps is not None and bool(curve.points) and speed_mps == curve.points[0].speed_mps


def _optimum(results: WithCurves, question: str, optimum: SpeedInterval, note: str) -> HeadlineAnswer:
    """Return the card of an optimum speed; if that is below the slowest speed flown, the card of the slowest flown."""
    slowest = results.slowest_flown
    if optimum.reason is SpeedReason.BELOW_SLOWEST and slowest:
        return HeadlineAnswer(question, ", the slowest flown", not_slower(results), slowest.speed_mps)
    speed_mps = _known_speed(optimum)
    return HeadlineAnswer(question, optimum_remark(optimum), note + near_stall(results, speed_mps), speed_mps)


def not_slower(results: WithCurves) -> str:
    """Say that no flight was measured below the slowest speed flown, and how far that is from the stall."""
    slowest = results.slowest_flown
    if slowest is None:
        return "Do not fly slower than this: no slower flight was measured."
    margin = stall_margin_percent(slowest)
    stall = f"at least {margin:.0f} % above the stall" if margin else "its margin to the stall is not known"
    text = f"Do not fly slower than {slowest.speed_mps:.1f} m/s: no slower flight was measured; {stall}."
    return text + (near_stall(results, slowest.speed_mps) if margin else "")


def near_stall(results: WithCurves, speed_mps: float | None) -> str:
    """Return a sentence with the slowest speed to hold, as in a plan, if a speed is below it; empty otherwise."""
    slowest = results.slowest_flown
    if slowest is None or speed_mps is None:
        return ""
    hold_mps = MARGINS.slowest * MARGINS.hold * _fastest_stall_mps(slowest)
    if speed_mps >= hold_mps:
        return ""
    return f" Hold no speed below {math.ceil(10 * hold_mps) / 10:.1f} m/s."


def _fastest_stall_mps(slowest: SlowestFlown) -> float:
    """Return the speed at the largest lift coefficient that the wing carried; the stall speed is not higher."""
    return slowest.speed_mps * math.sqrt(slowest.lift_coefficient / slowest.largest_lift_coefficient)


def stall_margin_percent(slowest: SlowestFlown) -> int:
    """Return the least margin of speed over the stall, rounded down to whole percents. It follows from the largest lift
    coefficient that the wing carried, with the motor's power at that moment."""
    return math.floor(100 * (slowest.speed_mps / _fastest_stall_mps(slowest) - 1))


def optimum_speed_text(optimum: SpeedInterval, curve: CurveResult | None = None) -> str:
    """Return "13.2 m/s (12.9 to 13.5)", "(up to 13.5)" if the interval has no lower end, or why there is no speed."""
    remark = end_remark(optimum, curve) if curve and curve.points else optimum_remark(optimum)
    return HeadlineAnswer("", remark, "", _known_speed(optimum)).answer


def _known_speed(optimum: SpeedInterval) -> float | None:
    return None if optimum.hi_mps is None else optimum.speed_mps


def optimum_remark(optimum: SpeedInterval) -> str:
    """Return the text after the speed, or why there is no speed."""
    lo, hi = optimum.lo_mps, optimum.hi_mps
    if optimum.speed_mps is None or hi is None:
        reason = optimum.reason or SpeedReason.NO_OPTIMUM
        return f"not found: {reason[0].lower()}{reason[1:-1]}"
    text = f" ({f'{lo:.1f}' if lo else 'up'} to {hi:.1f})"
    return text if optimum.inside_flown_range else text + ", outside the speeds flown: an extrapolation"


def interval_text(interval: Interval, unit: str, digits: int) -> str:
    """Return text such as "13.5 m/s (13.2 to 13.9)"."""
    return f"{interval.value:.{digits}f} {unit} ({interval.lo:.{digits}f} to {interval.hi:.{digits}f})"


def _endurance(results: WithCurves, use: PerformanceResult) -> HeadlineAnswer:
    flown = use.loadings[0]
    note = f"{interval_text(flown.endurance_s.times(1 / 60), 'min', 0)} {_battery(results, use)}."
    if flown.extrapolated:
        note += f" {BEYOND_TABLE}"
    speed = flown.endurance_speed_mps
    if flown.endurance_at_slowest:
        note += f" Power still decreases there. {not_slower(results)}"
    else:
        note += near_stall(results, speed.value)
    remark = _best_speed_remark(speed, flown.endurance_at_slowest, flown.endurance_at_fastest)
    return HeadlineAnswer("Best endurance", remark, note, speed.value)


def _range(results: WithCurves, use: PerformanceResult) -> HeadlineAnswer:
    flown = use.loadings[0]
    note = f"{interval_text(flown.range_m.times(1e-3), 'km', 1)} {_battery(results, use)}, in still air."
    speed = flown.range_speed_mps
    note += f" {not_slower(results)}" if flown.range_at_slowest else near_stall(results, speed.value)
    remark = _best_speed_remark(speed, flown.range_at_slowest, flown.range_at_fastest)
    return HeadlineAnswer("Best range", remark, note, speed.value)


def _full_throttle(results: WithCurves, available: AvailableResult) -> HeadlineAnswer:
    if available.reason:
        return HeadlineAnswer("Full throttle", "not known", available.reason)
    top, climb = available.maximum_speed_mps, available.best_climb_mps
    note = "Climb not known."
    if climb and available.best_climb_speed_mps is not None:
        note = f"Climbs {interval_text(climb, 'm/s', 1)} at {available.best_climb_speed_mps:.0f} m/s."
    if top and available.maximum_speed_extrapolated:
        faster = top.value > results.power_required[-1].speed_mps
        note += " Faster than any speed flown: an extrapolation." if faster else f" {BEYOND_TABLE}"
    remark = f" ({top.lo:.1f} to {top.hi:.1f})" if top else "not found"
    return HeadlineAnswer("Full throttle, level", remark, note, top.value if top else None)


def _battery(results: WithCurves, use: PerformanceResult) -> str:
    text = f"with {battery_text(results)} used"
    return text if use.power_train.measured else text + " (motor assumed, not measured)"


def battery_text(results: WithCurves, between: str = ",") -> str:
    """Return text such as "74 Wh, 80 %": the battery's energy and the share of it that is used."""
    assert results.battery is not None  # called only if endurance is known
    return f"{results.battery.energy_Wh:g} Wh{between} {100 * results.battery.usable:.0f} %"


def _best_speed_remark(speed: Interval, at_slowest: bool, at_fastest: bool) -> str:
    """Return " (13.2 to 13.9)", or name the end of the speeds flown at which, or beyond which, the best speed lies."""
    if at_slowest or at_fastest:
        return f", the {'slowest' if at_slowest else 'fastest'} flown"
    return f" ({speed.lo:.1f} to {speed.hi:.1f})"
