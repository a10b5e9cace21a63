"""Autopilot parameters derived from a flight, as a file that the autopilot's ground station loads.

ArduPilot: `NAME,VALUE`, comments after #. PX4: QGroundControl's table of vehicle, component, name, value and type (9:
float). INAV: `set NAME = VALUE` for its command line, with whole numbers. No airspeed in the file is below the stall
margin.
"""

from collections.abc import Iterator
from enum import StrEnum
from math import ceil
from typing import NamedTuple

import msgspec
import numpy as np

from flightpower.analysis.curve import Condition, speed_at
from flightpower.analysis.performance.autopilot_parameters import INAV, PLANE, PX4, withheld_of
from flightpower.analysis.records.flight import AutopilotParameter, Interval, Results, WithCurves
from flightpower.analysis.records.pool import PooledResults
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY
from flightpower.flight.errors import InputError


class For(StrEnum):
    """The firmware that loads the file."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"
    INAV = "inav"


FIRMWARE = {For.ARDUPILOT: PLANE, For.PX4: PX4, For.INAV: INAV}
SLOWEST = {"FW_AIRSPD_MIN", "AIRSPEED_MIN", "ARSPD_FBW_MIN"}
CRUISE = {"FW_AIRSPD_TRIM", "AIRSPEED_CRUISE", "TRIM_ARSPD_CM", "nav_fw_cruise_speed"}
FASTEST = {"FW_AIRSPD_MAX", "AIRSPEED_MAX", "ARSPD_FBW_MAX"}
NEWER = {"TRIM_ARSPD_CM": "AIRSPEED_CRUISE", "ARSPD_FBW_MIN": "AIRSPEED_MIN", "ARSPD_FBW_MAX": "AIRSPEED_MAX"}
CENTIMETERS = "cm/s"
FASTEST_CLIMB = {For.ARDUPILOT: "TECS_CLMB_MAX", For.PX4: "FW_T_CLMB_MAX"}
FASTEST_SINK = {For.ARDUPILOT: "TECS_SINK_MAX", For.PX4: "FW_T_SINK_MAX"}
WHOLE = {"TRIM_ARSPD_CM", "ARSPD_FBW_MIN", "ARSPD_FBW_MAX"}  # in ArduPlane; INAV has only whole numbers
CRUISE_SINK = {"FW_T_SINK_MIN", "TECS_SINK_MIN"}
CRUISE_POWER = {"cruise_power"}


class StallMargin(NamedTuple):
    """stall_mps : equivalent airspeed; None: that at the largest lift coefficient the wing carried in the flight"""

    stall_mps: float | None = None
    margin: float = 1.2

    def least_mps(self, results: WithCurves) -> tuple[float, str]:
        """Return the slowest equivalent airspeed that an autopilot may be set to fly, and the reason in words.

        If neither stall nor largest lift is known, the slowest speed of the curve is used as the stall speed, as for a
        route.
        """
        condition = Condition(results.test.weight_N, SEA_LEVEL_DENSITY, results.aircraft.wing_area_m2)
        if self.stall_mps is not None:
            stall_mps, what = self.stall_mps, "the stall speed given"
        elif results.slowest_flown is not None:
            stall_mps = float(speed_at(results.slowest_flown.largest_lift_coefficient, condition))
            what = "the speed of the largest lift coefficient flown, as no stall speed is given (--stall)"
        else:
            curve = results.electrical_power or results.power_required
            stall_mps = curve[0].speed_mps / _true_per_equivalent(results) if curve else 0.0
            what = "the slowest of the curve, as no stall speed is given (--stall)"
        least = self.margin * stall_mps
        return least, f"No airspeed is below {least:.4g} m/s: {self.margin:g} times {stall_mps:.4g} m/s, {what}."


def parameter_file(results: Results | PooledResults, firmware: For, stall: StallMargin = StallMargin()) -> str:
    """Return the text of the file. Raises InputError if the firmware gets no parameter, or none leaves a margin."""
    own = [parameter for parameter in results.autopilot_parameters if parameter.firmware == FIRMWARE[firmware]]
    if not own:
        raise InputError(
            f"{results.source}: no parameter of {FIRMWARE[firmware]} follows; the report says what each requires"
        )
    least_mps, reason = stall.least_mps(results)
    cruise_mps = next((parameter.value / _per_mps(parameter) for parameter in own if parameter.name in CRUISE), 0.0)
    unknown_at_cruise: list[str] = []
    if raised := 0.0 < cruise_mps < least_mps:
        own, unknown_at_cruise = _at_raised_cruise(own, results, cruise_mps, least_mps)
    own += [
        _rate(name, firmware, interval, basis)
        for names, interval, basis in (
            (
                FASTEST_CLIMB,
                climb_at_cruise(results, least_mps if raised else None),
                "full throttle at cruise speed, the lower end of its interval",
            ),
            (FASTEST_SINK, sink_at_fastest(results), "drag times airspeed over weight at the fastest flown"),
        )
        if interval is not None and (name := names.get(firmware))
    ]
    written = {parameter.name for parameter in own} | set(unknown_at_cruise)
    lines = [
        f"# {FIRMWARE[firmware]}, from {results.source}, by flightpower {results.software_version}.",
        "# Airspeeds are equivalent (calibrated) ones, rounded up. Compare each value with yours before you load it.",
        f"# {reason}",
        *(line for parameter in _names_used(own) for line in _lines(parameter, firmware, least_mps)),
        *(f"# {name} is withheld: its value at the raised cruise speed is not known." for name in unknown_at_cruise),
        *(f"# {sentence}" for sentence in withheld_of(FIRMWARE[firmware], written)),
    ]
    return "\n".join(lines) + "\n"


def _at_raised_cruise(
    own: list[AutopilotParameter], results: Results | PooledResults, from_mps: float, to_mps: float
) -> tuple[list[AutopilotParameter], list[str]]:
    """Return the parameters with sink and power at the raised cruise speed, and the names of parameters unknown there.

    from_mps, to_mps : equivalent airspeeds. Relative widths of intervals stay the same.
    """
    ratios = [
        (CRUISE_SINK, _power_required_ratio(results, from_mps, to_mps)),
        (CRUISE_POWER, _battery_power_ratio(results, from_mps, to_mps)),
    ]
    by_name = {name: ratio for names, ratio in ratios for name in names}
    moved, unknown = [], []
    for parameter in own:
        ratio = by_name.get(parameter.name, 1.0)
        if ratio is None:
            unknown.append(parameter.name)
            continue
        value, lo, hi = (ratio * end for end in (parameter.value, parameter.lo, parameter.hi))
        moved.append(msgspec.structs.replace(parameter, value=value, lo=lo, hi=hi))
    return moved, unknown


def _power_required_ratio(results: WithCurves, from_mps: float, to_mps: float) -> float | None:
    """Return the same ratio of power required as `_ratio`, from the soaring polar if there is no curve."""
    if results.power_required:
        points = [(point.speed_mps, point.power_W) for point in results.power_required]
        return _ratio(results, points, from_mps, to_mps)
    polar = {parameter.name: parameter.value for parameter in results.autopilot_parameters}
    names = ("SOAR_POLAR_CD0", "SOAR_POLAR_B", "SOAR_POLAR_K")
    if not polar.keys() >= set(names):
        return None
    CD0, B, loading = (polar[name] for name in names)
    before, after = (V**3 * (CD0 + B * (loading / V**2) ** 2) for V in (from_mps, to_mps))  # C_L = K / V^2
    return after / before


def _battery_power_ratio(results: Results | PooledResults, from_mps: float, to_mps: float) -> float | None:
    """Return the ratio of battery power in level flight at two equivalent airspeeds, `to_mps` over `from_mps`."""
    points = [(point.speed_mps, point.power_W) for point in results.electrical_power]
    if not points and results.performance:
        points = [(row.speed_mps, row.battery_W) for row in results.performance.field_table]
    return _ratio(results, points, from_mps, to_mps)


def _true_per_equivalent(results: WithCurves) -> float:
    """Return true airspeed over equivalent airspeed at the density of the results."""
    return float((SEA_LEVEL_DENSITY / results.test.air_density_kgpm3) ** 0.5)


def _ratio(results: WithCurves, points: list[tuple[float, float]], from_mps: float, to_mps: float) -> float | None:
    """Return power at `to_mps` over power at `from_mps`; None if points, (true airspeed, power), lack `to_mps`."""
    to_true = _true_per_equivalent(results)
    V = [speed for speed, _ in points]
    if not points or not V[0] <= to_mps * to_true <= V[-1]:
        return None
    before_W, after_W = np.interp([from_mps * to_true, to_mps * to_true], V, [power_W for _, power_W in points])
    return float(after_W / before_W)


def climb_at_cruise(results: Results | PooledResults, raised_mps: float | None = None) -> Interval | None:
    """Return the rate of climb [m/s] at full throttle and the speed of best range: the lower end of its interval.

    raised_mps : equivalent airspeed of cruise, if it is faster. None if full throttle is not known, or gives no climb.
    """
    use = results.performance
    best = use.available.best_climb_mps if use else None
    if use is None or best is None or not use.loadings or not use.available.power_available:
        return None
    V = [point.speed_mps for point in use.available.power_available]
    cruise_mps = use.loadings[0].range_speed_mps.value
    if raised_mps is not None:
        cruise_mps = raised_mps * _true_per_equivalent(results)
    climb_mps = float(np.interp(cruise_mps, V, use.available.climb_mps))
    low, high = (climb_mps * end / best.value for end in (best.lo, best.hi))
    return Interval(value=low, lo=low, hi=high) if low > 0 else None


def sink_at_fastest(results: WithCurves) -> Interval | None:
    """Return the sink rate [m/s] with the motor off at the fastest speed flown; a faster descent exceeds that speed."""
    if not results.power_required:
        return None
    last, weight_N = results.power_required[-1], results.test.weight_N
    return Interval(value=last.power_W / weight_N, lo=last.power_lo_W / weight_N, hi=last.power_hi_W / weight_N)


def _rate(name: str, firmware: For, interval: Interval, basis: str) -> AutopilotParameter:
    return AutopilotParameter(
        firmware=FIRMWARE[firmware], name=name, versions="all", value=interval.value, lo=interval.lo, hi=interval.hi,
        unit="m/s", basis=basis, logged=None,
    )  # fmt: skip


def _names_used(own: list[AutopilotParameter]) -> Iterator[AutopilotParameter]:
    """Yield parameters; if one has an old and a new name, keep the name that is in the log, or else the new name."""
    logged = {parameter.name for parameter in own if parameter.logged is not None}
    old = {name for name, newer in NEWER.items() if name in logged and newer not in logged}
    for parameter in own:
        replaced = {NEWER[name] for name in old}
        if parameter.name not in replaced and (parameter.name not in NEWER or parameter.name in old):
            yield parameter


def _lines(p: AutopilotParameter, firmware: For, least_mps: float) -> Iterator[str]:
    """Yield comments on interval, reason and margin, then the value."""
    unit = f" {p.unit}" if p.unit else ""
    yield f"# {p.name}: {p.value:.4g} ({p.lo:.4g} to {p.hi:.4g}){unit}: {p.basis}."
    if p.logged is not None:
        yield f"# {p.name} in the log: {p.logged:g}"
    least = least_mps * _per_mps(p)
    value = p.value
    if p.name in FASTEST and value < least:
        raise InputError(
            f"{p.name}: the fastest of the curve, {value:.4g}{unit}, is below the stall margin, {least:.4g}{unit};"
            " fly faster, or give the stall speed with --stall"
        )
    if p.name in SLOWEST | CRUISE and value < least:
        yield f"# {p.name} is raised to the stall margin, {least:.4g}{unit}."
        value = least
        if p.name in CRUISE:
            yield (
                "# Cruise is now the lowest airspeed: best range lies below the margin. The values at cruise speed"
                " are those of the raised speed. If the stall is slower, give --stall."
            )
    written = _up(value, p, firmware) if p.name in SLOWEST | CRUISE | FASTEST else _rounded(value, firmware)
    match firmware:
        case For.INAV:
            yield f"set {p.name} = {written}"
        case For.PX4:
            yield f"1\t1\t{p.name}\t{written}\t9"
        case For.ARDUPILOT:
            yield f"{p.name},{written}"


def _up(value: float, parameter: AutopilotParameter, firmware: For) -> str:
    """Round up, so that rounding never puts an airspeed below its margin."""
    digits = 0 if firmware is For.INAV or parameter.name in WHOLE else 2
    return f"{ceil(10**digits * value - 1e-9) / 10**digits:.{digits}f}"


def _per_mps(parameter: AutopilotParameter) -> float:
    """Return how many of the parameter's units of airspeed make one m/s."""
    return 100.0 if parameter.unit == CENTIMETERS else 1.0


def _rounded(value: float, firmware: For) -> str:
    return f"{value:.0f}" if firmware is For.INAV else f"{value:.5g}"
