"""The answers that the page and the terminal begin with: best speeds, endurance, range, full throttle."""

from typing import NamedTuple

from analysis.schema import BELOW_SLOWEST, AvailableResult, Interval, PerformanceResult, Results, SpeedInterval

BEYOND_TABLE = "Outside the propeller table: an extrapolation."


class HeadlineAnswer(NamedTuple):
    """A question, the answer, and a note on it. Plain text; an answer that is a speed begins "13.5 m/s"."""

    question: str
    answer: str
    note: str


def headline_answers(results: Results) -> list[HeadlineAnswer]:
    """Speeds of longest endurance and longest range, and the performance at full throttle.

    Without a propeller table that allows performance (`results.use` is None): speeds of least power and least drag.
    """
    use = results.use
    if use is None:
        return [
            _optimum(results, "Longest endurance", results.minimum_power_speed, "least power required"),
            _optimum(results, "Longest range", results.best_range_speed, "least drag"),
        ]
    return [_endurance(results, use), _range(results, use), _full_throttle(results, use.available)]


def _optimum(results: Results, question: str, optimum: SpeedInterval, note: str) -> HeadlineAnswer:
    """The card of a speed of the curve; where that lies below the slowest flown, the card of the slowest flown."""
    slowest = results.slowest_flown
    if optimum.reason == BELOW_SLOWEST and slowest:
        return HeadlineAnswer(question, f"{slowest.speed_mps:.1f} m/s, the slowest flown", not_slower(results))
    return HeadlineAnswer(question, optimum_speed_text(optimum), note)


def not_slower(results: Results) -> str:
    """What the slowest speed flown means, in sentences; empty where it is not known."""
    slowest = results.slowest_flown
    if slowest is None:
        return "Not slower than this unless you fly slower first. Mind the stall."
    CL, largest = slowest.lift_coefficient, slowest.largest_lift_coefficient
    more = round(100 * (largest / CL - 1))
    reached = f"; the largest one of the flight is {largest:.2f}, {more} % more" if more else ", the flight's largest"
    return (
        f"The slowest speed flown is {slowest.speed_mps:.1f} m/s, at a lift coefficient of {CL:.2f}{reached}."
        " Not slower than this unless you fly slower first. Mind the stall."
    )


def optimum_speed_text(optimum: SpeedInterval) -> str:
    """ "13.2 m/s (12.9 to 13.5)", "(up to 13.5)" where the interval has no lower end, or why there is none."""
    lo, hi = optimum.lo_mps, optimum.hi_mps
    if optimum.speed_mps is None or hi is None:
        reason = optimum.reason or "The curve has no such point."
        return f"not found: {reason[0].lower()}{reason[1:-1]}"
    text = f"{optimum.speed_mps:.1f} m/s ({f'{lo:.1f}' if lo else 'up'} to {hi:.1f})"
    return text if optimum.inside_flown_range else text + ", outside the speeds flown: an extrapolation"


def interval_text(interval: Interval, unit: str, digits: int) -> str:
    """ "13.5 m/s (13.2 to 13.9)"."""
    return f"{interval.value:.{digits}f} {unit} ({interval.lo:.{digits}f} to {interval.hi:.{digits}f})"


def _endurance(results: Results, use: PerformanceResult) -> HeadlineAnswer:
    flown = use.loadings[0]
    note = f"{interval_text(flown.endurance_s.times(1 / 60), 'min', 0)} {_battery(use)}."
    if flown.extrapolated:
        note += f" {BEYOND_TABLE}"
    if flown.endurance_at_slowest:
        note += f" Power still decreases there. {not_slower(results)}"
    speed = _best_speed(flown.endurance_speed_mps, flown.endurance_at_slowest, flown.endurance_at_fastest)
    return HeadlineAnswer("Longest endurance", speed, note)


def _range(results: Results, use: PerformanceResult) -> HeadlineAnswer:
    flown = use.loadings[0]
    note = f"{interval_text(flown.range_m.times(1e-3), 'km', 1)} {_battery(use)}, in still air."
    if flown.range_at_slowest:
        note += f" {not_slower(results)}"
    speed = _best_speed(flown.range_speed_mps, flown.range_at_slowest, flown.range_at_fastest)
    return HeadlineAnswer("Longest range", speed, note)


def _full_throttle(results: Results, available: AvailableResult) -> HeadlineAnswer:
    if available.reason:
        return HeadlineAnswer("Full throttle", "not known", available.reason)
    top, climb = available.maximum_speed_mps, available.best_climb_mps
    note = "Climb not known."
    if climb and available.best_climb_speed_mps is not None:
        note = f"Climbs {interval_text(climb, 'm/s', 1)} at {available.best_climb_speed_mps:.0f} m/s."
    if top and available.maximum_speed_extrapolated:
        faster = top.value > results.power_required[-1].speed_mps
        note += " Faster than was flown: an extrapolation." if faster else f" {BEYOND_TABLE}"
    return HeadlineAnswer("Full throttle, level", interval_text(top, "m/s", 1) if top else "not found", note)


def _battery(use: PerformanceResult) -> str:
    text = f"with {use.battery_energy_Wh:g} Wh, {100 * use.usable:.0f} % used"
    return text if use.power_train.measured else text + " (motor assumed, not measured)"


def _best_speed(speed: Interval, at_slowest: bool, at_fastest: bool) -> str:
    """ "13.5 m/s (13.2 to 13.9)"; at an end of the speeds flown the best speed may lie outside them."""
    if at_slowest or at_fastest:
        return f"{speed.value:.1f} m/s, the {'slowest' if at_slowest else 'fastest'} flown"
    return interval_text(speed, "m/s", 1)
