"""Values to type into an autopilot, from the electrical power of level flight and what else its estimate knows."""

from collections.abc import Mapping

import numpy as np

from analysis.electrical.drag import DragEstimate
from analysis.electrical.energy_balance import DragAndEfficiency, FlightConditions, drag_power
from analysis.electrical.estimate import ElectricalEstimate
from analysis.electrical.thrust_balance import aerodynamics
from analysis.estimation.noise import NORMAL_95
from analysis.results.autopilot_parameters import FlightValues, around, wing_loading_of
from analysis.schema import Interval, SpeedInterval
from flight.arrays import Array
from flight.atmosphere import SEA_LEVEL_DENSITY
from flight.units import GRAVITY_MPS2


def flight_values(
    estimate: ElectricalEstimate,
    best_range: SpeedInterval,
    logged: Mapping[str, float],
    drag: DragEstimate | None = None,
) -> FlightValues:
    """What an autopilot can be told of a flight. best_range: among the speeds flown; logged: its parameters.

    Sink and polar are those of the propeller's table where it gives drag (without an idling propeller), or else of the
    electrical balance, with the propeller idling.
    """
    V, c, airspeed = estimate.V_mps, estimate.conditions, estimate.airspeed
    to_equivalent = float(np.sqrt(c.rho / SEA_LEVEL_DENSITY))

    by_density = airspeed.by_gps * estimate.rho_sigma / 2

    def equivalent(speed_mps: float) -> Interval:
        """With the errors of the airspeed and, where GPS shows true airspeed, of density."""
        by_zero = 1 / (c.rho * speed_mps**2)
        by_wind = 0.0 if airspeed.wind_covariance is None else np.trace(airspeed.wind_covariance[:2, :2]) / 2
        variance = np.array([1.0, by_zero]) @ airspeed.covariance @ [1.0, by_zero] + by_wind / speed_mps**2
        share = float(np.sqrt(variance + by_density**2))
        return around(speed_mps * to_equivalent, NORMAL_95 * share * speed_mps * to_equivalent)

    cruise = float(best_range.speed_mps or V[0])
    lo = min(best_range.lo_mps or V[0], cruise)
    hi = max(best_range.hi_mps or cruise, equivalent(cruise).hi / to_equivalent)
    power, half = (float(np.interp(cruise, V, values)) for values in (estimate.power_W, estimate.standard_error_W))
    idle, form = (1.0, DragAndEfficiency.of) if drag is None else (0.0, aerodynamics)
    source = estimate if drag is None else drag

    def sinking(parameters: Array, given: FlightConditions) -> Array:
        drag_W = drag_power(np.array([cruise]), 1.0, idle, form(parameters), given)
        return drag_W / (given.mass_kg * GRAVITY_MPS2)

    def two_term_polar(parameters: Array, given: FlightConditions) -> Array:
        """(2,): the nearest C_D0 + B C_L^2 over the speeds of level flight."""
        qS = given.rho * V**2 / 2 * given.wing_area_m2
        CL = given.mass_kg * GRAVITY_MPS2 / qS
        CD = drag_power(V, 1.0, idle, form(parameters), given) / (qS * V)
        return np.asarray(np.linalg.lstsq(np.stack([np.ones_like(CL), CL**2], axis=1), CD, rcond=None)[0])

    (sink, sink_error), (polar, polar_error) = source.quantity(sinking), source.quantity(two_term_polar)
    scale_half = NORMAL_95 * float(np.sqrt(airspeed.covariance[0, 0] + by_density**2))
    by_gps = airspeed.wind_mps is not None and airspeed.wind is None
    return FlightValues(
        cruise=Interval(value=cruise, lo=float(lo), hi=float(hi)).times(to_equivalent),
        slowest=equivalent(float(V[0])),
        fastest=equivalent(float(V[-1])),
        wing_loading=wing_loading_of(c.mass_kg * GRAVITY_MPS2, c.wing_area_m2),
        cruise_power=around(power, NORMAL_95 * half),
        idle_power=around(c.idle_power_W, NORMAL_95 * c.idle_sigma_W, 0.0),
        sink=around(float(sink[0]), NORMAL_95 * float(sink_error[0])),
        CD0=around(float(polar[0]), NORMAL_95 * float(polar_error[0])),
        B=around(float(polar[1]), NORMAL_95 * float(polar_error[1])),
        airspeed_factor=around(1 / (1 + airspeed.scale), scale_half) if by_gps else None,
        logged=logged,
    )
