"""Values to type into an autopilot that follow from a flight, with their intervals and the versions of the firmware.

Names and units come from the parameter references of PX4 (docs.px4.io) and ArduPilot (ardupilot.org/plane) and from
Settings.md of INAV. Airspeeds are equivalent airspeeds, which the autopilots call calibrated.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from flightpower.analysis.estimation.model import NamedValues
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate
from flightpower.analysis.methods.whole_flight.drag import DragEstimate
from flightpower.analysis.methods.whole_flight.energy_balance import FlightConditions, QuarticPolar, drag_power
from flightpower.analysis.methods.whole_flight.settings import SHARED
from flightpower.analysis.performance.settings import PARAMETERS
from flightpower.analysis.records.flight import (
    UNKNOWN_SPEED,
    AutopilotParameter,
    Interval,
    Kind,
    PerformanceResult,
    Results,
    SpeedInterval,
    WithCurves,
)
from flightpower.analysis.uncertain import Uncertain
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY
from flightpower.flight.units import GRAVITY_MPS2


@dataclass(frozen=True)
class FlightValues:
    """Values that a flight gives for an autopilot; None where it gives none. Airspeeds are equivalent airspeeds [m/s].

    cruise: best range among the speeds flown; cruise_power: power from the battery at cruise [W]; sink: sink at cruise
    with the motor off [m/s]. CD0, B: coefficients of C_D = CD0 + B C_L^2 over the lift coefficients flown.
    wing_loading: 2 W / (rho_0 S) [m^2/s^2]. airspeed_factor: true airspeed over the airspeed shown. logged: the
    autopilot's parameters, by name.
    """

    cruise: Interval
    slowest: Interval
    fastest: Interval
    wing_loading: Interval
    cruise_power: Interval | None = None
    idle_power: Interval | None = None
    sink: Interval | None = None
    CD0: Interval | None = None
    B: Interval | None = None
    airspeed_factor: Interval | None = None
    logged: Mapping[str, float] = field(default_factory=dict)

    @property
    def airspeed_ratio(self) -> Interval | None:
        """Interval of ARSPD_RATIO; indicated airspeed varies as the square root of this parameter."""
        logged, factor = self.logged.get("ARSPD_RATIO"), self.airspeed_factor
        if not logged or factor is None:
            return None
        value, lo, hi = (logged * ratio**2 for ratio in (factor.value, factor.lo, factor.hi))
        return Interval(value=value, lo=lo, hi=hi)


class _Entry(NamedTuple):
    """A parameter of an autopilot. value: field of FlightValues     factor: converts its unit to the parameter's"""

    firmware: str
    name: str
    versions: str
    value: str
    unit: str = "m/s"
    factor: float = 1.0


PX4, PLANE, INAV = "PX4", "ArduPlane", "INAV"
ENTRIES = (
    _Entry(PX4, "FW_AIRSPD_TRIM", "all", "cruise"),
    _Entry(PX4, "FW_AIRSPD_MIN", "all", "slowest"),
    _Entry(PX4, "FW_AIRSPD_MAX", "all", "fastest"),
    _Entry(PX4, "FW_T_SINK_MIN", "all", "sink"),
    _Entry(PX4, "ASPD_SCALE_1", "1.13 and later", "airspeed_factor", ""),
    _Entry(PLANE, "AIRSPEED_CRUISE", "4.5 and later", "cruise"),
    _Entry(PLANE, "TRIM_ARSPD_CM", "up to 4.4", "cruise", "cm/s", 100.0),
    _Entry(PLANE, "AIRSPEED_MIN", "4.5 and later", "slowest"),
    _Entry(PLANE, "ARSPD_FBW_MIN", "up to 4.4", "slowest"),
    _Entry(PLANE, "AIRSPEED_MAX", "4.5 and later", "fastest"),
    _Entry(PLANE, "ARSPD_FBW_MAX", "up to 4.4", "fastest"),
    _Entry(PLANE, "TECS_SINK_MIN", "all", "sink"),
    _Entry(PLANE, "ARSPD_RATIO", "all", "airspeed_ratio", ""),
    _Entry(PLANE, "SOAR_POLAR_CD0", "with soaring", "CD0", ""),
    _Entry(PLANE, "SOAR_POLAR_B", "with soaring", "B", ""),
    _Entry(PLANE, "SOAR_POLAR_K", "with soaring", "wing_loading", "m²/s²"),
    _Entry(INAV, "nav_fw_cruise_speed", "2.0 and later", "cruise", "cm/s", 100.0),
    _Entry(INAV, "cruise_power", "2.0 and later", "cruise_power", "0.01 W", 100.0),
    _Entry(INAV, "idle_power", "2.0 and later", "idle_power", "0.01 W", 100.0),
)
BASIS = {
    "cruise": "best range among the speeds flown",
    "slowest": "the slowest of the curve; how far below it the stall lies is not known",
    "fastest": "the fastest of the curve",
    "sink": "drag times airspeed over weight at cruise speed",
    "airspeed_factor": "airspeed against GPS",
    "airspeed_ratio": "airspeed against GPS, and the logged ratio",
    "CD0": "drag over the lift coefficients flown",
    "B": "drag over the lift coefficients flown",
    "wing_loading": "twice the weight over sea-level density and wing area",
    "cruise_power": "from the battery at cruise speed",
    "idle_power": "from the battery with the motor off",
}
REQUIRES_THROTTLE = "a throttle calibrated against power; read it at cruise speed in level flight."
NO_STALL = "A stall speed cannot be derived: no stall was flown."
ALWAYS_WITHHELD = (
    "FW_THR_TRIM (PX4 1.14 and later; FW_THR_CRUISE before), TRIM_THROTTLE (ArduPlane) and nav_fw_cruise_thr (INAV) do"
    f" not follow: they require {REQUIRES_THROTTLE}",
    NO_STALL,
)
THROTTLE = {PX4: "FW_THR_TRIM (FW_THR_CRUISE before 1.14)", PLANE: "TRIM_THROTTLE", INAV: "nav_fw_cruise_thr"}
WITHOUT = {
    "sink": "drag is not known well enough, or its power exceeds the battery's; {takes} a propeller table and motor"
    " speed, or glides, and the right mass and current.",
    "CD0": "the drag polar is not known well enough, or its power exceeds the battery's; {takes} glides at several"
    " speeds, or a propeller table and motor speed, and the right mass and current.",
    "airspeed_factor": "{takes} an autopilot's airspeed and GPS.",
    "idle_power": "the power with the motor off is too small for this current meter, or not measured.",
    "airspeed_ratio": "{takes} GPS and the ratio that the airspeed was computed with, which ArduPlane logs as a"
    " parameter.",
    "cruise_power": "{takes} the battery's power at cruise speed.",
}
TOGETHER = {"CD0": ("CD0", "B")}  # values that are of use only together


def _withheld(value: str, firmware: str | None = None) -> str:
    """A sentence on why the parameters of a value are withheld, for one firmware or all; empty if there are none."""
    names = [
        entry.name
        for entry in ENTRIES
        if entry.value in TOGETHER.get(value, (value,)) and firmware in (None, entry.firmware)
    ]
    verb, takes = ("are", "they require") if len(names) > 1 else ("is", "it requires")
    return f"{' and '.join(names)} {verb} withheld: {WITHOUT[value].format(takes=takes)}" if names else ""


def withheld_of(firmware: str, written: Collection[str]) -> list[str]:
    """Sentences on the parameters of one firmware that the results cannot give. written: names of the parameters that
    they do give"""
    missing = {entry.value for entry in ENTRIES if entry.firmware == firmware and entry.name not in written}
    withheld = [_withheld(value, firmware) for value in WITHOUT if value in missing]
    return [*withheld, f"{THROTTLE[firmware]} does not follow: it requires {REQUIRES_THROTTLE}", NO_STALL]


def typed_in(values: FlightValues) -> tuple[list[AutopilotParameter], list[str]]:
    """The parameters that follow from a flight, and sentences on those that do not."""
    entered = {name: interval for name in BASIS if (interval := getattr(values, name)) and _is_determined(interval)}
    if not {"CD0", "B"} <= entered.keys():  # one is of no use without the other
        entered = {name: entered[name] for name in entered.keys() - {"CD0", "B"}}
    parameters = [_parameter(entry, entered[entry.value], values.logged) for entry in ENTRIES if entry.value in entered]
    return parameters, [*(_withheld(name) for name in WITHOUT if name not in entered), *ALWAYS_WITHHELD]


def _parameter(entry: _Entry, interval: Interval, logged: Mapping[str, float]) -> AutopilotParameter:
    scaled = interval.times(entry.factor)
    return AutopilotParameter(
        firmware=entry.firmware,
        name=entry.name,
        versions=entry.versions,
        value=scaled.value,
        lo=scaled.lo,
        hi=scaled.hi,
        unit=entry.unit,
        basis=BASIS[entry.value],
        logged=logged.get(entry.name),
    )


def _is_determined(interval: Interval) -> bool:
    ends = np.array([interval.lo, interval.value, interval.hi])
    return bool(
        np.isfinite(ends).all()
        and interval.value > 0
        and interval.hi - interval.lo < 2 * PARAMETERS.widest_share * interval.value
    )


def wing_loading_of(weight_N: float, wing_area_m2: float) -> Interval:
    value = 2 * weight_N / (SEA_LEVEL_DENSITY * wing_area_m2)
    half = NORMAL_95 * SHARED.mass
    return Interval(value=value, lo=value * (1 - half), hi=value * (1 + half))


def around(value: float, half: float, least: float = -np.inf) -> Interval:
    """An interval around a value with half width `half`, whose lower end is at least `least`."""
    return Interval(value=value, lo=max(value - half, least), hi=value + half)


def of_power_required(
    results: WithCurves, use: PerformanceResult | None, CD0: Interval | None = None, B: Interval | None = None
) -> tuple[list[AutopilotParameter], list[str]]:
    """Parameters from the curve of power required, and from battery power if it is known."""
    curve = results.power_required
    if not curve:
        return [], []
    to_equivalent = _equivalent_per_true(results)
    slowest, fastest = curve[0].speed_mps, curve[-1].speed_mps
    cruise_power = None
    if use:
        case = use.loadings[0]
        cruise, power, distance = case.range_speed_mps, case.range_power_W, case.range_m
        share = (distance.value / distance.hi, distance.value / distance.lo) if distance.lo > 0 else (0.0, np.inf)
        cruise_power = Interval(value=power, lo=power * share[0], hi=power * share[1])
    else:
        best = results.best_range_speed
        value = min(max(best.speed_mps or slowest, slowest), fastest)
        cruise = Interval(value=value, lo=best.lo_mps or slowest, hi=best.hi_mps or value)
    value = min(max(cruise.value, slowest), fastest)
    cruise = Interval(value=value, lo=min(max(cruise.lo, slowest), value), hi=max(cruise.hi, value))
    W = results.test.weight_N
    V = [point.speed_mps for point in curve]
    power_W, lo_W, hi_W = (
        float(np.interp(cruise.value, V, [getattr(point, name) for point in curve]))
        for name in ("power_W", "power_lo_W", "power_hi_W")
    )
    values = FlightValues(
        cruise=cruise.times(to_equivalent),
        slowest=around(slowest, 0.0).times(to_equivalent),
        fastest=around(fastest, 0.0).times(to_equivalent),
        wing_loading=wing_loading_of(W, results.aircraft.wing_area_m2),
        cruise_power=cruise_power,
        sink=Interval(value=power_W / W, lo=lo_W / W, hi=hi_W / W),
        CD0=CD0,
        B=B,
    )
    return typed_in(values)


def _equivalent_per_true(results: WithCurves) -> float:
    return float((results.test.air_density_kgpm3 / SEA_LEVEL_DENSITY) ** 0.5)


def of_electrical_pool(pool: WithCurves, flights: Sequence[Results]) -> tuple[list[AutopilotParameter], list[str]]:
    """Parameters from the electrical power of several flights together.

    Cruise, slowest and fastest airspeed, and the power at cruise come from the pooled curve. Sink at that cruise, the
    polar, idle power and the airspeed's factor are means over the flights that show them, with mean intervals: it is
    not known which errors the flights share, and the error of a mean never exceeds the mean of the errors.
    """
    curve, best = pool.electrical_power, pool.curves[Kind.ELECTRICAL].best_range_speed or UNKNOWN_SPEED
    V = [point.speed_mps for point in curve]
    cruise = min(max(best.speed_mps or V[0], V[0]), V[-1])
    to_equivalent = _equivalent_per_true(pool)
    of_flights = [_values_of(flight.autopilot_parameters) for flight in flights]
    wing_loading = wing_loading_of(pool.test.weight_N, pool.aircraft.wing_area_m2)

    def mean_of(name: str) -> Interval | None:
        return mean_interval([values[name] for values in of_flights if name in values])

    def airspeed(true_mps: float, name: str) -> Interval:
        """The equivalent airspeed, with the flights' mean relative error of the value `name`."""
        own = mean_of(name)
        share = (own.hi - own.lo) / (2 * own.value) if own else 0.0
        return around(true_mps * to_equivalent, share * true_mps * to_equivalent)

    sinks = [
        values["sink"].times(ratio * _equivalent_per_true(flight) / to_equivalent)
        for values, flight in zip(of_flights, flights, strict=True)
        if "sink" in values and (ratio := _sink_ratio(values, cruise * to_equivalent, wing_loading.value))
    ]
    power_W, lo_W, hi_W = (
        float(np.interp(cruise, V, [getattr(point, name) for point in curve]))
        for name in ("power_W", "power_lo_W", "power_hi_W")
    )
    logged = [{p.name: p.logged for p in flight.autopilot_parameters if p.logged is not None} for flight in flights]
    alike = {name: value for name, value in logged[0].items() if all(each.get(name) == value for each in logged)}
    ratios = {each.get("ARSPD_RATIO") for each in logged}  # the factor refers to airspeed computed with this ratio
    return typed_in(
        FlightValues(
            cruise=Interval(
                value=cruise * to_equivalent,
                lo=min(max(best.lo_mps or V[0], V[0]), cruise) * to_equivalent,
                hi=max((best.hi_mps or cruise) * to_equivalent, airspeed(cruise, "slowest").hi),
            ),
            slowest=airspeed(V[0], "slowest"),
            fastest=airspeed(V[-1], "fastest"),
            wing_loading=wing_loading,
            cruise_power=Interval(value=power_W, lo=lo_W, hi=hi_W),
            idle_power=mean_of("idle_power"),
            sink=mean_interval(sinks),
            CD0=mean_of("CD0"),
            B=mean_of("B"),
            airspeed_factor=mean_of("airspeed_factor") if len(ratios) == 1 else None,
            logged=alike,
        )
    )


def _values_of(parameters: Sequence[AutopilotParameter]) -> dict[str, Interval]:
    """Convert a flight's parameters back to the values of `FlightValues` that they came from, by name."""
    entries = {(entry.firmware, entry.name): entry for entry in ENTRIES}
    values = {}
    for parameter in parameters:
        if entry := entries.get((parameter.firmware, parameter.name)):
            interval = Interval(value=parameter.value, lo=parameter.lo, hi=parameter.hi)
            values[entry.value] = interval.times(1 / entry.factor)
    return values


def mean_interval(intervals: Sequence[Interval]) -> Interval | None:
    """The mean of values and ends, which is right if all errors are shared and too wide otherwise. None without any."""
    if not intervals:
        return None
    value, lo, hi = np.mean([(each.value, each.lo, each.hi) for each in intervals], axis=0).tolist()
    return Interval(value=value, lo=lo, hi=hi)


def _sink_ratio(values: Mapping[str, Interval], to_mps: float, to_loading: float) -> float | None:
    """Ratio of equivalent sink at the given equivalent airspeed [m/s] and wing loading K to a flight's own sink.

    Sink is V C_D / C_L with C_L = K / V^2. None without a polar.
    """
    if not values.keys() >= {"CD0", "B", "cruise", "wing_loading"}:
        return None
    CD0, B, from_mps, from_loading = (values[name].value for name in ("CD0", "B", "cruise", "wing_loading"))
    own, other = (V**3 * (CD0 + B * (K / V**2) ** 2) / K for V, K in ((from_mps, from_loading), (to_mps, to_loading)))
    return other / own


def flight_values(
    estimate: ElectricalEstimate,
    best_range: SpeedInterval,
    logged: Mapping[str, float],
    drag: DragEstimate | None = None,
) -> FlightValues:
    """The values of a flight that an autopilot can use. best_range: among the speeds flown; logged: its parameters.

    Sink and polar come from the propeller's table if it gives drag; they are then without an idling propeller.
    Otherwise they come from the electrical balance and include it. Both are None if level flight at cruise speed would
    need more power against drag than the motor takes from the battery. In that case mass or current is wrong, or the
    propulsion is simulated.
    """
    V, c, airspeed = estimate.V_mps, estimate.conditions, estimate.airspeed
    to_equivalent = float(np.sqrt(c.rho / SEA_LEVEL_DENSITY))

    by_density = airspeed.by_gps * estimate.rho_sigma / 2

    def equivalent(speed_mps: float) -> Interval:
        """Equivalent airspeed with the errors of airspeed and, if GPS gave the true airspeed, of density."""
        by_zero = 1 / (c.rho * speed_mps**2)
        by_wind = 0.0 if airspeed.mean_wind_covariance is None else np.trace(airspeed.mean_wind_covariance) / 2
        variance = np.array([1.0, by_zero]) @ airspeed.covariance @ [1.0, by_zero] + by_wind / speed_mps**2
        share = float(np.sqrt(variance + by_density**2))
        return around(speed_mps * to_equivalent, NORMAL_95 * share * speed_mps * to_equivalent)

    cruise = float(best_range.speed_mps or V[0])
    lo = min(best_range.lo_mps or V[0], cruise)
    hi = max(best_range.hi_mps or cruise, equivalent(cruise).hi / to_equivalent)
    power, half = (float(np.interp(cruise, V, values)) for values in (estimate.power_W, estimate.standard_error_W))
    source = (drag or estimate).parameters

    def polar_of(p: NamedValues) -> QuarticPolar:
        return QuarticPolar.of(p, p.idle_drag if drag is None else 0.0)

    def sinking(p: NamedValues, conditions: FlightConditions) -> Array:
        drag_W = drag_power(np.array([cruise]), 1.0, 1.0, polar_of(p), conditions)
        return drag_W / (conditions.mass_kg * GRAVITY_MPS2)

    def two_term_polar(p: NamedValues, conditions: FlightConditions) -> Array:
        """C_D0 and B (2,) of the least-squares fit C_D0 + B C_L^2 over the speeds of level flight."""
        qS = conditions.rho * V**2 / 2 * conditions.wing_area_m2
        CL = conditions.mass_kg * GRAVITY_MPS2 / qS
        CD = drag_power(V, 1.0, 1.0, polar_of(p), conditions) / (qS * V)
        return np.asarray(np.linalg.lstsq(np.stack([np.ones_like(CL), CL**2], axis=1), CD, rcond=None)[0])

    (sink,), (CD0, B) = (_intervals(source.quantity(quantity)) for quantity in (sinking, two_term_polar))

    def drag_power_W(p: NamedValues, conditions: FlightConditions) -> Array:
        return drag_power(np.array([cruise]), 1.0, 0.0, QuarticPolar.of(p), conditions)

    (level_W,) = source.quantity(drag_power_W).value
    possible = level_W <= power - c.idle_power_W
    scale_half = NORMAL_95 * float(np.sqrt(airspeed.scale_variance + by_density**2))
    by_gps = airspeed.wind_mps is not None and airspeed.wind is None
    return FlightValues(
        cruise=Interval(value=cruise, lo=float(lo), hi=float(hi)).times(to_equivalent),
        slowest=equivalent(float(V[0])),
        fastest=equivalent(float(V[-1])),
        wing_loading=wing_loading_of(c.mass_kg * GRAVITY_MPS2, c.wing_area_m2),
        cruise_power=around(power, NORMAL_95 * half),
        idle_power=around(c.idle_power_W, NORMAL_95 * c.idle_sigma_W, 0.0),
        sink=sink if possible else None,
        CD0=CD0 if possible else None,
        B=B if possible else None,
        airspeed_factor=around(1 / (1 + airspeed.scale), scale_half) if by_gps else None,
        logged=logged,
    )


def _intervals(values: Uncertain) -> list[Interval]:
    return [around(value, half) for value, half in zip(values.value.tolist(), values.half_width.tolist(), strict=True)]
