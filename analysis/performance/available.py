"""Power available at full throttle: highest level speed, rate of climb, ceilings (Fig. 1.2).

The motor's model is that of `full_throttle`; with the propeller's table it gives the speed of rotation, thrust and
power at any speed and density. Limit: the table knows Reynolds number by speed of rotation alone; the lower Reynolds
numbers of thin air are left out.

Units: V and climb in m/s, thrust in N, power in W, n in rev/s.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.drag.polar import Condition, speed_at
from analysis.performance.balance import climb_angle
from analysis.performance.propagation import SigmaPoints, UncertainValue, from_sigma_points
from analysis.performance.propeller_speed import corrected_thrust, full_throttle_revps
from flight.atmosphere import density, pressure_at, temperature_at
from flight.propeller import Propeller

Array = NDArray[np.float64]

SERVICE_CLIMB_MPS = 0.508  # 100 ft/min
HEIGHTS_M = np.arange(0.0, 11_001.0, 500.0)  # of the standard troposphere
FASTEST = 1.35  # the highest level speed is sought up to this times the fastest speed flown
SPEEDS, CEILING_SPEEDS = 121, 25


@dataclass(frozen=True)
class FullThrottlePerformance:
    """Full throttle at one weight and density; NaN where the motor does not turn the propeller.

    V : (k,) [m/s]     power : available [W], (k,)     climb : rate of climb [m/s], (k,)
    covered : by the propeller's table, (k,)     maximum_speed, best_climb : [m/s]; NaN where there is none
    """

    V: Array
    power: UncertainValue
    climb: UncertainValue
    covered: NDArray[np.bool_]
    maximum_speed: UncertainValue
    best_climb: UncertainValue
    best_climb_speed: float

    def covers(self, speed_mps: float) -> bool:
        """Whether the propeller's table covers full throttle at a speed."""
        return bool(self.covered[np.argmin(np.abs(self.V - speed_mps))])


def full_throttle_performance(
    parameters: SigmaPoints,
    propeller: Propeller,
    condition: Condition,
    flown_CL: tuple[float, float],
    speeds: int = SPEEDS,
) -> FullThrottlePerformance:
    """Power available, climb and highest level speed.

    parameters : A0, A1, A2, thrust_scale, thrust_slope, alpha_0, alpha_CL, unloaded_revps, revps_per_Nm
    """
    slowest, fastest = speed_at(flown_CL[1], condition), speed_at(flown_CL[0], condition)
    V = np.linspace(slowest, FASTEST * fastest, speeds)
    n, power_W, climb = _climb(parameters, propeller, V, condition)
    best = int(np.argmax(np.nan_to_num(climb[0], nan=-np.inf)))
    return FullThrottlePerformance(
        V=V,
        power=from_sigma_points(power_W),
        climb=from_sigma_points(climb),
        covered=propeller.covers(V / (n[0] * propeller.diameter_m), 60 * n[0]),
        # At the highest level speed the climb turns into a descent for the last time.
        maximum_speed=from_sigma_points(_last_crossings(V, climb)),
        best_climb=from_sigma_points(np.fmax.reduce(climb, axis=1)),
        best_climb_speed=float(V[best]),
    )


def _climb(parameters: SigmaPoints, propeller: Propeller, V: Array, condition: Condition) -> tuple[Array, Array, Array]:
    """n [rev/s], power available T V cos(alpha) [W] (3.47) and rate of climb V sin(gamma) [m/s], each (2m + 1, k)."""
    n = full_throttle_revps(
        propeller,
        V,
        condition.rho,
        unloaded_revps=parameters["unloaded_revps"],
        revps_per_Nm=parameters["revps_per_Nm"],
    )
    correction = {name: parameters[name] for name in ("thrust_scale", "thrust_slope")}
    thrust_N = corrected_thrust(propeller, V, n, condition.rho, **correction)
    sine, along_path_N = climb_angle(parameters, thrust_N, V, condition)
    return n, along_path_N * V, V * sine


def _last_crossings(x: Array, y: Array) -> Array:
    """Where each sigma point's y (2m + 1, k) falls through zero for the last time over x (k,).

    A sigma point that does not cross within x is taken to first order: the estimate's crossing shifted by the
    difference of y over the slope there. NaN where the estimate itself does not cross.
    """
    crossings = np.array([_last_crossing(x, values) for values in y])
    here = crossings[0]
    if np.isfinite(here):
        i = min(int(np.searchsorted(x, here)), len(x) - 1)
        slope = (y[0, i] - y[0, i - 1]) / (x[i] - x[i - 1])
        nearby = here - np.array([np.interp(here, x, values) for values in y]) / slope
        crossings = np.where(np.isfinite(crossings), crossings, nearby)
    return crossings


def _last_crossing(x: Array, y: Array) -> float:
    """Where y falls through zero for the last time, linear between points; NaN if it does not."""
    falls = np.flatnonzero((y[:-1] > 0) & (y[1:] <= 0))
    if not len(falls):
        return np.nan
    i = falls[-1]
    return float(x[i] + (x[i + 1] - x[i]) * y[i] / (y[i] - y[i + 1]))


def ceilings_m(
    parameters: SigmaPoints,
    propeller: Propeller,
    condition: Condition,
    flown_CL: tuple[float, float],
    climbs_mps: tuple[float, ...],
) -> list[UncertainValue]:
    """Density altitudes [m] of the standard atmosphere at which the best climb has fallen to each of `climbs_mps`.

    NaN above the troposphere and below sea level. The climb is the best over the lift coefficients flown; the motor's
    voltage is that of the flight.
    """
    rho = density(pressure_at(HEIGHTS_M), temperature_at(HEIGHTS_M))[:, None]
    CL = np.linspace(flown_CL[1], flown_CL[0], CEILING_SPEEDS)
    conditions = condition._replace(rho=rho)
    V = speed_at(CL, conditions)
    n_points = len(parameters["A0"])
    best = np.empty((n_points, len(HEIGHTS_M)))
    for i in range(n_points):
        point = {name: values[i] for name, values in parameters.items()}
        best[i] = np.fmax.reduce(_climb(point, propeller, V, conditions)[2], axis=1)
    return [from_sigma_points(_last_crossings(HEIGHTS_M, best - climb)) for climb in climbs_mps]
