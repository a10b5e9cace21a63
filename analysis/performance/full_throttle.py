"""The motor at full throttle, fitted to the flight's full-throttle stretches.

Model: n = n_0 - n_Q Q. The speed of rotation falls in proportion to the motor's torque Q, because the voltage left for
the back-EMF falls with the current. Just below full throttle n_0 is smaller in proportion to the throttle. Q is the
propeller's torque by its table at the measured n, plus the torque that accelerates the rotor.

Limits: n_0 is that of the battery's charge in those stretches (an empty battery has less) and of the motor's
temperature then.

Power available at full throttle: highest level speed, rate of climb, ceilings (Fig. 1.2).

The motor's model is that of `full_throttle`; with the propeller's table it gives the speed of rotation, thrust and
power at any speed and density. Limit: the table knows Reynolds number by speed of rotation alone; the lower Reynolds
numbers of thin air are left out.

Units: V and climb in m/s, thrust in N, power in W, n in rev/s.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag import covariance
from analysis.estimation import output_error
from analysis.estimation.data import Segment
from analysis.estimation.model import Model, Parameter
from analysis.performance.level_flight import climb_angle
from analysis.performance.power_train import corrected_thrust, full_throttle_revps
from analysis.performance.propagation import ParameterVector, SigmaPoints, UncertainValue, from_sigma_points
from analysis.polar import Condition, speed_at
from analysis.signals.smoothing import stretches
from flight.atmosphere import density, pressure_at, temperature_at
from flight.complete_aircraft import CompletePropulsion
from flight.propeller import Propeller

FULL_THROTTLE, STEADY_THROTTLE = 0.97, 0.005  # at least this, and within this of the largest throttle of the flight
SETTLING_S = 0.6  # after the stick moves: ramp of the speed controller and the motor's inertia
SHORTEST_S, NEEDED_S = 1.0, 2.0  # of one stretch, and of all together
SLOPE_SIGMA_SHARE = 0.5  # prior standard deviation of n_Q, as a share of the value by the aircraft file's resistances


@dataclass(frozen=True)
class FullThrottle:
    """The motor at full throttle.

    parameters : n_0 (`unloaded_revps` [rev/s]) and n_Q (`revps_per_Nm` [rev/s/(N m)]); None where they are not known
    basis : what they were fitted to, in words     reason : why they are not known, in words; empty where they are
    """

    parameters: ParameterVector | None
    basis: str = ""
    reason: str = ""


def fit_full_throttle(data: pd.DataFrame, propulsion: CompletePropulsion, propeller: Propeller) -> FullThrottle:
    """Fit n_0 and n_Q to the flight.

    data : index t_s, even steps; columns V [m/s], n [rev/s], rho [kg/m^3], throttle (0 to 1), covered (by the
    propeller's table)
    """
    if data["throttle"].isna().all():
        return FullThrottle(None, reason="The log has no throttle position.")
    step_s = float(data.index[1] - data.index[0])
    segments = _full_throttle_stretches(data, step_s, propulsion, propeller)
    seconds = sum(len(segment) * segment.step_s for segment in segments)
    if seconds < NEEDED_S:
        return FullThrottle(
            None,
            reason=f"The flight has only {seconds:.0f} s of settled full throttle within the propeller's table;"
            f" {NEEDED_S:.0f} s are needed.",
        )
    k = 60 / (2 * np.pi * propulsion.motor_kv_rpm_per_volt)  # torque constant [N m/A]
    slope = (propulsion.motor_resistance_ohm + propulsion.battery_resistance_ohm) / (2 * np.pi * k**2)
    unloaded = propulsion.motor_kv_rpm_per_volt * propulsion.battery_voltage_V / 60
    fit = output_error.estimate(
        Model(
            name="full throttle",
            inputs=("torque", "throttle"),
            outputs=("n",),
            output_function=lambda x, u, p: (p.unloaded_revps * u.throttle - p.revps_per_Nm * u.torque,),
            parameters=(
                Parameter(name="unloaded_revps", start=unloaded, unit="rev/s"),
                Parameter(name="revps_per_Nm", start=slope, prior_sigma=SLOPE_SIGMA_SHARE * slope + 1e-3),
            ),
        ),
        segments,
    )
    basis = (
        f"From {seconds:.0f} s of full throttle: the motor would turn {60 * fit.values[0]:.0f} rpm unloaded and loses"
        f" {60 * fit.values[1]:.0f} rpm for each N m, with the battery as charged as it was then."
    )
    return FullThrottle(ParameterVector(fit.names, fit.values, covariance.of_noise(fit)), basis=basis)


def _full_throttle_stretches(
    data: pd.DataFrame, step_s: float, propulsion: CompletePropulsion, propeller: Propeller
) -> list[Segment]:
    """Stretches at full throttle, without their first SETTLING_S, with the motor's torque [N m]."""
    full = float(data["throttle"].max())
    at_full = data["throttle"] >= max(FULL_THROTTLE, full - STEADY_THROTTLE)
    at_full &= data[["V", "n", "rho"]].notna().all(axis=1) & data["covered"]
    segments = []
    for stretch in stretches(at_full.to_numpy()):
        rows = slice(stretch.start + round(SETTLING_S / step_s), stretch.stop)
        if (rows.stop - rows.start) * step_s < SHORTEST_S:
            continue
        piece = data.iloc[rows]
        V, n, rho, throttle = (piece[name].to_numpy() for name in ("V", "n", "rho", "throttle"))
        _, shaft_W = propeller.thrust_and_power(V, n, rho)
        accelerating_Nm = 2 * np.pi * propulsion.propeller_inertia_kgm2 * np.gradient(n, step_s)
        u = {"torque": shaft_W / (2 * np.pi * n) + accelerating_Nm, "throttle": throttle / full}
        segments.append(Segment(name=f"{piece.index[0]:.1f} s", t_s=piece.index.to_numpy(), u=u, z={"n": n}))
    return segments


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
