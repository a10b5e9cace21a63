"""The energy of a route as text for the terminal."""

from collections.abc import Iterator
from math import isfinite, radians

from flightpower.analysis.missions.mission import course_text
from flightpower.analysis.missions.prediction import LegResult, NoReturn, RouteResult
from flightpower.analysis.records.flight import Interval

HEAD = ("leg", "course", "km", "height m", "m/s", "ground m/s", "min", "Wh", "charge left %", "home safe %")


def lines(result: RouteResult) -> Iterator[str]:
    """Return the table, then conclusions from it."""
    rows = [HEAD, *(_row(leg) for leg in result.legs)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEAD))]
    for row in rows:
        yield "  ".join(
            text.ljust(width) if i == 0 else text.rjust(width)
            for i, (text, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
    yield ""
    yield (
        f"Whole route: {_with_ends(result.time_s, 60, 1)} min, {_with_ends(result.energy_Wh, 1, 1)} Wh,"
        f" {_with_ends(result.charge_left, 0.01, 0)} % of the charge left (95 % intervals)."
    )
    yield f"Probability of ending with the reserve of {100 * result.reserve:.0f} %: {percent(result.probability)}."
    yield _no_return(result.no_return, result.sure)
    yield f"One more kilometer into the wind costs {_with_ends(result.headwind_Wh_per_km, 1, 2)} Wh."
    near = min(result.directions, key=lambda direction: direction.safe_radius_m)
    longest = max(result.directions, key=lambda direction: direction.safe_radius_m)
    yield (
        f"Farthest safe point of return on one charge, without climb: {near.safe_radius_m / 1000:.1f} km out on course"
        f" {course_text(radians(near.course_deg))}, the shortest, {longest.safe_radius_m / 1000:.1f} km on course"
        f" {course_text(radians(longest.course_deg))}, the longest."
    )
    yield (
        f"Airspeeds allowed: {result.slowest_airspeed_mps:.1f} to {result.fastest_airspeed_mps:.1f} m/s (equivalent),"
        " as flown and with the stall margin (--stall)."
    )
    if result.flights:
        yield _pool(result)
    yield from result.notes


def _pool(result: RouteResult) -> str:
    curve = f"Curve of {len(result.flights)} flights together"
    if not result.losses_of:
        return f"{curve}."
    averaged = "all" if len(result.losses_of) == len(result.flights) else ", ".join(result.losses_of)
    return f"{curve}; losses of the power train: mean of {averaged}."


def _row(leg: LegResult) -> tuple[str, ...]:
    return (
        leg.name,
        "" if leg.course_deg is None else course_text(radians(leg.course_deg)),
        f"{leg.distance_m / 1000:.2f}",
        f"{leg.height_m:.0f}",
        f"{leg.airspeed_mps:.1f}",
        "" if leg.ground_speed_mps is None else f"{leg.ground_speed_mps:.1f}",
        _number(leg.time_s.value / 60, 1),
        _number(leg.energy_Wh.value, 2),
        _with_ends(leg.charge_left, 0.01, 0),
        percent(leg.probability_home).removesuffix(" %"),
    )


def percent(probability: float) -> str:
    """Print a fraction of draws to a tenth of a percent, the resolution of the number of draws."""
    if probability >= 1:
        return "> 99.8 %"
    return "< 0.2 %" if probability <= 0 else f"{100 * probability:.1f} %"


def _with_ends(interval: Interval, unit: float, digits: int) -> str:
    """Return text such as "40 (35 to 44)"."""
    value, lo, hi = (_number(value_SI / unit, digits) for value_SI in (interval.value, interval.lo, interval.hi))
    return f"{value} ({lo} to {hi})"


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if isfinite(value) else "-" if value < 0 else "never"


def _no_return(no_return: NoReturn | None, sure: float) -> str:
    if no_return is None:
        return f"The direct way home is safe (at least {100 * sure:.0f} %) from everywhere on the route."
    return (
        f"Point of no return: {no_return.route_m / 1000:.2f} km along the route, on {no_return.leg},"
        f" {no_return.from_home_m / 1000:.2f} km from home; beyond it the direct way home with the reserve is less than"
        f" {100 * sure:.0f} % sure."
    )
