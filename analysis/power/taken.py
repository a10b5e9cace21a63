"""What a method takes as measured, and what it takes from the path.

Every method but the dynamic one deliberately takes something as its sensor gives it: the angle of attack, the pitch
attitude, the airspeed, the propeller's table. Path and dynamic method find the errors of these; so a method that takes
them as they come and then differs shows the fault, and correcting one error at a time shows which it was.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.path.model import SHARED
from analysis.path.reconstruct import PRIOR_SIGMA, Path
from analysis.power.forces import J_REFERENCE, THRUST_SCALE, THRUST_SLOPE, Blocks
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


class Error(NamedTuple):
    value: float
    standard_error: float


def found(blocks: Blocks, path: Path, rows: NDArray[np.bool_], thrust: Mapping[str, Error]) -> dict[str, Error]:
    """Every error of UNKNOWN as path and dynamic method find it. rows: the blocks in which speed changes.

    thrust: of "thrust_scale" and "thrust_slope", as the dynamic method has them.
    """
    of_path = {
        "alpha_bias": ("alpha_bias", 1.0),
        "alpha_scale": ("alpha_scale", 1.0),
        "pitch": ("ax_bias", 1 / g),
        "airspeed_scale": ("V_scale", 1.0),
    }
    errors = {
        name: Error(path.value(key) * unit, path.standard_error(key) * unit) for name, (key, unit) in of_path.items()
    }
    return {**errors, "lag": _lag(blocks, path, rows), **thrust}


def _lag(blocks: Blocks, path: Path, rows: NDArray[np.bool_]) -> Error:
    """By how much airspeed comes late [s]: what it lags behind the path's, against the path's acceleration.

    The path's speed is as quick as the accelerometers that carry it.
    """
    along = blocks.forces(path.states.to_numpy(), path.shared)
    behind = along["V"].to_numpy() - blocks.mean["V_mps"] / (1 + path.value("V_scale"))
    Vdot = along["Vdot"].to_numpy()
    known = rows & np.isfinite(behind) & np.isfinite(Vdot)
    if known.sum() < 20:
        return Error(0.0, UNKNOWN["lag"])
    X = np.column_stack([Vdot[known], np.ones(known.sum())])
    (lag, level), *_ = np.linalg.lstsq(X, behind[known], rcond=None)
    scatter = np.var(behind[known] - X @ (lag, level))
    return Error(float(lag), float(np.sqrt(scatter / (known.sum() * np.var(Vdot[known])))))


def given(blocks: Blocks, states: Array, shared: Array, errors: Mapping[str, float]) -> pd.DataFrame:
    """What a method is given, a row a block; `errors` are taken out of what it takes as measured (none: as it comes).

    From the path of states (n, ·) with errors of its sensors shared (m,): V, alpha, gamma, climb, bank, Vdot, rho, J as
    in `Blocks.forces`; ax, az, specific force, qS, and thrust of the table along body x, over mass [m/s^2].
    As measured: alpha_felt [rad]; theta_felt [rad], attitude levelled by the accelerometer; V_felt [m/s] with qS_felt
    and thrust_felt that go with it; height_felt [m]; static_Pa, temperature_K of the air.
    covered: the share of the block that the propeller's table reaches.
    """
    e = {name: errors.get(name, 0.0) for name in UNKNOWN}
    known = dict(zip(SHARED, shared, strict=True))
    f = blocks.forces(states, shared)
    mean, m = blocks.mean, blocks.aircraft.mass_kg
    V, alpha, Vdot, rho = (f[name].to_numpy() for name in ("V", "alpha", "Vdot", "rho"))
    theta = states[:, 1]
    # Angles are pressures over dynamic pressure: the path's airspeed corrects them too (analysis.path.model).
    alpha_felt = mean["alpha_rad"] + 2 * known["V_scale"] * alpha
    alpha_felt = alpha_felt - e["alpha_bias"] - e["alpha_scale"] * alpha + e["lag"] * np.gradient(alpha, blocks.t_s)
    V_felt = mean["V_mps"] / (1 + e["airspeed_scale"]) + e["lag"] * Vdot
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
        "height_felt": mean["height_m"] + e["lag"] * f["climb"].to_numpy(),
        "static_Pa": mean["static_Pa"],
        "temperature_K": mean["temperature_K"],
        "covered": mean["propeller_covered"],
    }
    return pd.DataFrame(columns, index=f.index)
