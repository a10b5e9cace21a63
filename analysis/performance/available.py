"""Power available at full throttle, and what follows from it: highest level speed, rate of climb, ceiling (Fig. 1.2).

Model: at full throttle a brushless motor turns at a speed that falls in proportion to its torque, n = n_0 - c Q, since
the voltage left for its back-EMF falls with its current; just below full throttle n_0 is less in proportion. n_0 and c
are fitted to the flight's own full-throttle stretches, Q being the propeller's table at the measured n; the balance
with the propeller then gives n, thrust and power at any speed and density. Limits: n_0 is that of the battery's charge
in those stretches (an empty battery has less), and of a motor that is neither hotter nor colder; the table knows
Reynolds number by speed of rotation alone, so that thin air's is left out.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag import covariance
from analysis.drag.polar import Condition, speed_at
from analysis.estimation import output_error
from analysis.estimation.data import Segment
from analysis.estimation.model import Model, Parameter
from analysis.performance.balance import climb_of
from analysis.performance.power_train import full_throttle_revps, thrust_and_power
from analysis.performance.propagation import Estimate, Numbers, estimate
from analysis.signals.stretches import stretches
from flight.aircraft import Propulsion
from flight.atmosphere import density, pressure_at, temperature_at
from flight.propeller import PropellerModel

Array = NDArray[np.float64]

FULL_THROTTLE, STEADY_THROTTLE = 0.97, 0.005  # at least this; and within this of the highest that was flown
SETTLING_S = 0.6  # after the stick: the controller's own ramp, and the motor's inertia
SHORTEST_S, NEEDED_S = 1.0, 2.0
SLOWING_SHARE = 0.5  # one standard deviation of the slope that the aircraft file's resistances give
SERVICE_CLIMB_MPS = 0.508  # 100 ft/min
HEIGHTS_M = np.arange(0.0, 11_001.0, 500.0)  # of the standard troposphere
FASTEST = 1.35  # times the fastest speed flown, up to which a highest level speed is sought
SPEEDS = 121


@dataclass(frozen=True)
class FullThrottle:
    """n_0 (`unloaded_revps`) and c (`revps_per_Nm`) with their covariance, and what they were fitted to."""

    numbers: Numbers
    seconds: float
    measured: tuple[tuple[float, float], ...]  # speed [m/s], speed of rotation [rev/s]
    basis: str


def full_throttle(data: pd.DataFrame, propulsion: Propulsion, propeller: PropellerModel) -> FullThrottle | str:
    """The motor at full throttle, or why nothing is known of it.

    data : index t_s, even steps; columns V, n, rho, throttle (0 to 1), covered (by the propeller's table)
    """
    if data["throttle"].isna().all():
        return "The log does not say where the throttle stood."
    step_s = float(data.index[1] - data.index[0])
    # What stands a hundredth below full turns the motor a hundredth slower; so little below, in proportion.
    full = float(data["throttle"].max())
    open_wide = data["throttle"] >= max(FULL_THROTTLE, full - STEADY_THROTTLE)
    open_wide &= data[["V", "n", "rho"]].notna().all(axis=1) & data["covered"]
    segments = []
    for rows in stretches(open_wide.to_numpy()):
        rows = slice(rows.start + round(SETTLING_S / step_s), rows.stop)
        if (rows.stop - rows.start) * step_s < SHORTEST_S:
            continue
        piece = data.iloc[rows]
        V, n, rho, throttle = (piece[name].to_numpy() for name in ("V", "n", "rho", "throttle"))
        _, shaft = propeller.thrust_and_power(V, n, rho)
        torque = shaft / (2 * np.pi * n) + 2 * np.pi * propulsion.propeller_inertia_kgm2 * np.gradient(n, step_s)
        u = {"torque": torque, "throttle": throttle / full, "V": V}
        segments.append(Segment(name=f"{piece.index[0]:.1f} s", t_s=piece.index.to_numpy(), u=u, z={"n": n}))
    seconds = sum(len(segment) * segment.step_s for segment in segments)
    if seconds < NEEDED_S:
        return f"The flight has {seconds:.0f} s of settled full throttle within the propeller's table, too little."
    k = 60 / (2 * np.pi * propulsion.motor_kv_rpm_per_volt)
    slowing = (propulsion.motor_resistance_ohm + propulsion.battery_resistance_ohm) / (2 * np.pi * k**2)
    unloaded = propulsion.motor_kv_rpm_per_volt * propulsion.battery_voltage_V / 60
    fit = output_error.estimate(
        Model(
            name="full throttle",
            inputs=("torque", "throttle"),
            outputs=("n",),
            output_function=lambda x, u, p: (p.unloaded_revps * u.throttle - p.revps_per_Nm * u.torque,),
            parameters=(
                Parameter(name="unloaded_revps", start=unloaded, unit="rev/s"),
                Parameter(name="revps_per_Nm", start=slowing, prior_sigma=SLOWING_SHARE * slowing + 1e-3),
            ),
        ),
        segments,
    )
    every = max(1, round(0.4 / step_s))
    measured = [
        (float(V), float(n))
        for segment in segments
        for V, n in zip(segment.u["V"][::every], segment.z["n"][::every], strict=True)
    ]
    basis = (
        f"From {seconds:.0f} s of full throttle: the motor would turn {60 * fit.values[0]:.0f} rpm unloaded and loses"
        f" {60 * fit.values[1]:.0f} rpm for each N m, with the battery as charged as it was then."
    )
    return FullThrottle(Numbers(fit.names, fit.values, covariance.of_noise(fit)), seconds, tuple(measured), basis)


@dataclass(frozen=True)
class Performance:
    """What full throttle allows at one weight and density; NaN where it does not, or the motor was not known.

    V : (k,) speeds [m/s]     power : available [W]     climb : [m/s]     covered : by the propeller's table
    """

    V: Array
    power: Estimate
    climb: Estimate
    covered: NDArray[np.bool_]
    maximum_speed: Estimate
    best_climb: Estimate
    best_climb_speed: float


def performance(
    row: dict[str, Array], propeller: PropellerModel, at: Condition, flown_CL: tuple[float, float], speeds: int = SPEEDS
) -> Performance:
    """Power available, climb and highest level speed.

    row : nudged numbers (2m + 1, 1): A0, A1, A2, thrust_scale, thrust_slope, alpha_0, alpha_CL, unloaded_revps,
    revps_per_Nm
    """
    slowest, fastest = speed_at(flown_CL[1], at), speed_at(flown_CL[0], at)
    V = np.linspace(slowest, FASTEST * fastest, speeds)
    n, power, climb = _climb(row, propeller, V, at)
    # The highest level speed is where what is left turns from a climb to a descent for the last time.
    maximum = estimate(_last_crossings(V, climb))
    best = int(np.argmax(np.nan_to_num(climb[0], nan=-np.inf)))
    covered = propeller.covers(V / (n[0] * propeller.diameter_m), 60 * n[0])  # type: ignore[attr-defined]
    return Performance(
        V, estimate(power), estimate(climb), covered, maximum, estimate(np.fmax.reduce(climb, axis=1)), float(V[best])
    )


def _climb(row: dict[str, Array], propeller: PropellerModel, V: Array, at: Condition) -> tuple[Array, Array, Array]:
    """Speed of rotation, power available T V cos(alpha) (3.47) and rate of climb V sin(gamma), each (2m + 1, k)."""
    n = full_throttle_revps(
        propeller, V, at.rho, unloaded_revps=row["unloaded_revps"], revps_per_Nm=row["revps_per_Nm"]
    )
    scale, slope = row["thrust_scale"], row["thrust_slope"]
    thrust, _ = thrust_and_power(propeller, V, n, at.rho, thrust_scale=scale, thrust_slope=slope)
    sine, along = climb_of(row, thrust, V, at)
    return n, along * V, V * sine


def _last_crossings(x: Array, rows: Array) -> Array:
    """Where each of `rows` (2m + 1, k), of nudged numbers, falls through zero for the last time.

    To first order where only the estimate does so within x: its interval may reach beyond. NaN where not even that.
    """
    crossings = np.array([_last_crossing(x, row) for row in rows])
    here = crossings[0]
    if np.isfinite(here):
        i = min(int(np.searchsorted(x, here)), len(x) - 1)
        slope = (rows[0, i] - rows[0, i - 1]) / (x[i] - x[i - 1])
        nearby = here - np.array([np.interp(here, x, row) for row in rows]) / slope
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
    row: dict[str, Array],
    propeller: PropellerModel,
    at: Condition,
    flown_CL: tuple[float, float],
    climbs_mps: tuple[float, ...],
) -> list[Estimate]:
    """Density altitudes [m] of the standard atmosphere at which the best climb has fallen to each of `climbs_mps`.

    NaN above the troposphere. Lift coefficients stay those flown; the motor's voltage does not know the height.
    """
    rho = density(pressure_at(HEIGHTS_M), temperature_at(HEIGHTS_M))[:, None]
    CL = np.linspace(flown_CL[1], flown_CL[0], 25)
    there = at._replace(rho=rho)
    V = speed_at(CL, there)
    n_rows = len(row["A0"])
    best = np.empty((n_rows, len(HEIGHTS_M)))
    for i in range(n_rows):
        one = {name: values[i] for name, values in row.items()}
        best[i] = np.fmax.reduce(_climb(one, propeller, V, there)[2], axis=1)
    return [estimate(_last_crossings(HEIGHTS_M, best - climb)) for climb in climbs_mps]
