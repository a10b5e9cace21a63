"""What a method takes as measured, and what it takes from the path.

Every method but the dynamic one deliberately takes something as its sensor gives it: the angle of attack, the pitch
attitude, the airspeed, the propeller's table. Trajectory and dynamic method find their errors; so a method that takes
them as they come and then differs shows the fault, and correcting one error at a time shows which it was.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag.forces import J_REFERENCE, THRUST_SCALE, THRUST_SLOPE, Blocks
from analysis.trajectory.dryden import GaussMarkov
from analysis.trajectory.equations import SENSOR_ERRORS
from analysis.trajectory.priors import PRIOR_SIGMA
from analysis.trajectory.reconstruction import Trajectory
from flight.atmosphere import GRAVITY_MPS2 as g

Array = NDArray[np.float64]

# Each error's standard deviation where nobody has looked for it: what a method that takes it as measured is off by.
UNKNOWN = {
    "alpha_bias": PRIOR_SIGMA["alpha_bias"],
    "alpha_scale": PRIOR_SIGMA["alpha_scale"],
    "pitch": PRIOR_SIGMA["ax_bias"] / g,  # what an accelerometer's bias tilts the attitude by that is levelled by it
    "airspeed_scale": PRIOR_SIGMA["V_scale"],
    "lag": 0.012,  # tubes of 20 ms at most
    "thrust_scale": THRUST_SCALE,
    "thrust_slope": THRUST_SLOPE,
}
# And what a careful installation leaves of it; methods may differ by as much without anything being wrong.
CAREFUL = {
    "alpha_bias": np.radians(0.15),
    "alpha_scale": 0.01,
    "pitch": np.radians(0.15),
    "airspeed_scale": 0.004,
    "lag": 0.008,
    "thrust_scale": 0.01,
    "thrust_slope": 0.03,
}
# The errors that one cause makes.
CAUSES = {
    "angle of attack": ("alpha_bias", "alpha_scale"),
    "pitch attitude": ("pitch",),
    "airspeed": ("airspeed_scale",),
    "air-data lag": ("lag",),
    "propeller table": ("thrust_scale", "thrust_slope"),
}

STILL = GaussMarkov(0.0, 1.0)
LAG_IN_DOUBT_S = 0.3
FEWEST_BLOCKS = 20
ALIKE_BLOCKS = 4  # residuals of neighbouring blocks are alike for so long


class Error(NamedTuple):
    value: float
    standard_error: float


def found(blocks: Blocks, trajectory: Trajectory, rows: NDArray[np.bool_]) -> dict[str, Error]:
    """Every error of UNKNOWN, as path and forces along it show it. rows: the blocks in which speed changes.

    The path believes that air data are hardly late. Here that belief is taken back (a normal prior comes out of a
    normal posterior as it went in), so that a lag beyond what tubes do is found, and is not taken for thrust.
    """
    i = SENSOR_ERRORS.index("air_data_lag")
    shared, covariance = _without_belief(trajectory, i)
    states = trajectory.states.to_numpy() + trajectory.state_sensitivity @ (shared - trajectory.sensor_errors)
    spread = np.sqrt(np.diag(covariance))
    errors = {
        name: Error(float(shared[SENSOR_ERRORS.index(key)] * unit), float(spread[SENSOR_ERRORS.index(key)] * unit))
        for name, (key, unit) in {
            "alpha_bias": ("alpha_bias", 1.0),
            "alpha_scale": ("alpha_scale", 1.0),
            "pitch": ("ax_bias", 1 / g),
            "airspeed_scale": ("V_scale", 1.0),
            "lag": ("air_data_lag", 1.0),
        }.items()
    }
    return errors | _thrust(blocks.forces(states, shared)[rows])


def _without_belief(trajectory: Trajectory, i: int) -> tuple[Array, Array]:
    """The sensors' errors and their covariance, had the path believed of the error i no more than LAG_IN_DOUBT_S."""
    known = np.linalg.inv(trajectory.covariance)
    free = known.copy()
    free[i, i] += 1 / LAG_IN_DOUBT_S**2 - 1 / trajectory.prior_standard_error(SENSOR_ERRORS[i]) ** 2
    covariance = np.linalg.inv(free)
    return covariance @ known @ trajectory.sensor_errors, covariance  # the prior's mean is zero


def _thrust(f: pd.DataFrame) -> dict[str, Error]:
    """Errors of the propeller's table, by what tells drag and thrust apart: drag regressed with both of them in it."""
    f = f[["CL", "CD", "qS", "thrust", "J"]].dropna()
    doubt = {name: Error(0.0, UNKNOWN[name]) for name in ("thrust_scale", "thrust_slope")}
    if len(f) < FEWEST_BLOCKS:
        return doubt
    CL, CD, qS, thrust, J = f.to_numpy().T
    X = np.stack([qS, qS * CL, qS * CL**2, -thrust, -thrust * (J - J_REFERENCE)], axis=1)
    z = qS * CD
    theta, *_ = np.linalg.lstsq(X, z, rcond=None)
    variance = float(np.mean((z - X @ theta) ** 2)) * ALIKE_BLOCKS
    prior = np.diag([0, 0, 0, *(1 / UNKNOWN[name] ** 2 for name in doubt)])
    C = np.linalg.inv(X.T @ X / variance + prior)
    values, errors = C @ (X.T @ z) / variance, np.sqrt(np.diag(C))
    return {name: Error(float(values[i]), float(errors[i])) for i, name in enumerate(doubt, start=3)}


def given(
    blocks: Blocks,
    states: Array,
    shared: Array,
    errors: Mapping[str, float],
    gust: GaussMarkov = STILL,
    along: GaussMarkov = STILL,
) -> pd.DataFrame:
    """What a method is given, a row a block; `errors` are taken out of what it takes as measured (none: as it comes).

    From the path of states (n, ·) with errors of its sensors shared (m,): V, alpha, gamma, climb, bank, Vdot, rho, J as
    in `Blocks.forces`; ax, az, specific force, qS, and thrust of the table along body x, over mass [m/s^2].
    As measured: alpha_felt [rad]; theta_felt [rad], attitude levelled by the accelerometer; V_felt [m/s] with qS_felt
    and thrust_felt that go with it, and the same with the path's scale of airspeed taken out (V_late: what is left is
    that it comes late); height_felt [m]; static_Pa, temperature_K of the air.
    covered: the share of the block that the propeller's table reaches; gust_mps, gust_s: standard deviation of vertical
    gusts and how long they last; gust_along_mps, gust_along_s: the same of gusts along the flight.
    """
    e = {name: errors.get(name, 0.0) for name in UNKNOWN}
    known = dict(zip(SENSOR_ERRORS, shared, strict=True))
    f = blocks.forces(states, shared)
    mean, m = blocks.mean, blocks.aircraft.mass_kg
    V, alpha, Vdot, rho = (f[name].to_numpy() for name in ("V", "alpha", "Vdot", "rho"))
    theta = states[:, 1]
    # Angles are pressures over dynamic pressure: the path's airspeed corrects them too (analysis.path.model).
    alpha_felt = mean["alpha_rad"] + 2 * known["V_scale"] * alpha
    alpha_felt = alpha_felt - e["alpha_bias"] - e["alpha_scale"] * alpha + e["lag"] * np.gradient(alpha, blocks.t_s)
    V_felt = mean["V_mps"] / (1 + e["airspeed_scale"]) + e["lag"] * Vdot
    V_late = mean["V_mps"] / (1 + known["V_scale"]) + e["lag"] * Vdot
    tilt = known["ax_bias"] / g - e["pitch"]

    def thrust(V: Array) -> Array:
        n = f["n"].to_numpy()
        table, _ = blocks.propeller.thrust_and_power(V, n, rho)
        J = V / (n * blocks.propeller.diameter_m)
        return table * (1 + e["thrust_scale"] + e["thrust_slope"] * (J - J_REFERENCE)) / m

    S = blocks.aircraft.geometry.wing_area_m2
    columns = {
        **{name: f[name].to_numpy() for name in ("V", "alpha", "gamma", "climb", "bank", "Vdot", "rho", "J")},
        "ax": mean["ax_mps2"] - known["ax_bias"],
        "az": mean["az_mps2"] - known["az_bias"],
        "qS": rho * V**2 / 2 * S / m,
        "thrust": thrust(V),
        "alpha_felt": alpha_felt,
        "theta_felt": theta + tilt / np.cos(theta),
        "V_felt": V_felt,
        "qS_felt": rho * V_felt**2 / 2 * S / m,
        "thrust_felt": thrust(V_felt),
        "V_late": V_late,
        "qS_late": rho * V_late**2 / 2 * S / m,
        "thrust_late": thrust(V_late),
        "height_felt": mean["height_m"] + e["lag"] * f["climb"].to_numpy(),
        "static_Pa": mean["static_Pa"],
        "temperature_K": mean["temperature_K"],
        "covered": mean["propeller_covered"],
        "gust_mps": gust.sigma_mps,
        "gust_s": gust.time_s,
        "gust_along_mps": along.sigma_mps,
        "gust_along_s": along.time_s,
    }
    return pd.DataFrame(columns, index=f.index)


def lifted_mps(given: pd.DataFrame, seconds: float) -> float:
    """Standard deviation of the mean vertical gust over so many seconds [m/s].

    A balance of energy counts what it lifts, W w, as thrust power: the mean of a first-order process of deviation sigma
    and time T is known to sigma sqrt(2 T/seconds).
    """
    return float(given["gust_mps"].iloc[0] * np.sqrt(min(1.0, 2 * given["gust_s"].iloc[0] / seconds)))
