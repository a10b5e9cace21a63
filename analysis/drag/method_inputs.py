"""The data that all methods work on: quantities along the trajectory, and the same as measured.

A method that takes a quantity as measured differs from the dynamic method by the error of that quantity. The table is
therefore made several times: as it is, along perturbed trajectories, with each error at its prior size, and with the
estimated errors of each cause removed. The last shows which cause parts two methods.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag.forces import J_REFERENCE, FlightForces
from analysis.drag.sensor_errors import CAUSES, ERROR_PRIOR_SIGMA, ErrorEstimate
from analysis.maneuvers.kinds import Maneuver
from analysis.trajectory import dryden
from analysis.trajectory.dryden import GaussMarkov
from analysis.trajectory.equations import SENSOR_ERRORS, STATES
from analysis.trajectory.reconstruction import Trajectory
from flight.aircraft import Aircraft
from flight.units import GRAVITY_MPS2 as g

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MethodInputs:
    """The runs of one flight and the tables (of `input_table`) that methods are applied to.

    nominal : along the trajectory, nothing corrected
    trajectory_deviations : along the trajectory displaced by each independent error of one standard deviation
    error_deviations : with each error of ERROR_PRIOR_SIGMA assumed to be of that size and removed
    cause_corrected : with the estimated errors of each of CAUSES removed
    """

    aircraft: Aircraft
    runs: list[Maneuver]
    nominal: pd.DataFrame
    trajectory_deviations: list[pd.DataFrame]
    error_deviations: dict[str, pd.DataFrame]
    cause_corrected: dict[str, pd.DataFrame]


def method_inputs(
    blocks: FlightForces, trajectory: Trajectory, runs: list[Maneuver], errors: Mapping[str, ErrorEstimate]
) -> MethodInputs:
    """The tables of one flight. errors: from `estimate_errors`."""
    states, sensor_errors = trajectory.states.to_numpy(), trajectory.sensor_errors
    flying = np.isfinite(blocks.mean["V_mps"])
    height_m, V = (float(np.nanmedian(blocks.mean[name][flying])) for name in ("height_m", "V_mps"))
    vertical = dryden.vertical(trajectory.gust_mps, height_m, V).as_gauss_markov()
    along = dryden.longitudinal(trajectory.gust_mps, height_m, V)

    def corrected(removed: Mapping[str, float]) -> pd.DataFrame:
        return input_table(blocks, states, sensor_errors, removed, vertical, along)

    return MethodInputs(
        blocks.aircraft,
        runs,
        corrected({}),
        [
            input_table(
                blocks, states + trajectory.state_sensitivity @ error, sensor_errors + error, {}, vertical, along
            )
            for error in np.linalg.cholesky(trajectory.covariance).T
        ],
        {name: corrected({name: sigma}) for name, sigma in ERROR_PRIOR_SIGMA.items()},
        {cause: corrected({name: errors[name].value for name in names}) for cause, names in CAUSES.items()},
    )


def input_table(
    blocks: FlightForces,
    states: Array,
    sensor_errors: Array,
    removed: Mapping[str, float],
    vertical: GaussMarkov,
    along: GaussMarkov,
) -> pd.DataFrame:
    """What methods work on, one row per block; the errors `removed` are taken out of what is measured.

    Along the trajectory of states (n, len(STATES)) with sensor errors (len(SENSOR_ERRORS),): V, alpha, gamma, climb,
    bank, Vdot, rho, J as in `FlightForces.forces`; specific force ax, az [m/s^2]; qS_over_m_mps2; thrust_x_over_m_mps2,
    the thrust of the table along body x.
    As measured: alpha_measured [rad]; theta_measured [rad], pitch attitude leveled by the accelerometer;
    height_measured [m]; V_measured [m/s], with the qS_over_m and thrust_x_over_m that follow from it; static_Pa [Pa],
    temperature_K [K]. lagged: airspeed as measured but for its scale, so that only the air-data lag is left in it.
    covered: share of the block within the propeller table.
    Standard deviation and correlation time of vertical gusts (gust_mps, gust_s) and of those along the flight path
    (gust_along_mps, gust_along_s), the same in all rows.
    """
    e = {name: removed.get(name, 0.0) for name in ERROR_PRIOR_SIGMA}
    known = dict(zip(SENSOR_ERRORS, sensor_errors, strict=True))
    f = blocks.forces(states, sensor_errors)
    mean, m = blocks.mean, blocks.aircraft.mass_kg
    V, alpha, Vdot, rho, climb = (f[name].to_numpy() for name in ("V", "alpha", "Vdot", "rho", "climb"))
    theta = states[:, STATES.index("theta")]
    # Flow angles are pressures over dynamic pressure: the estimated airspeed scale corrects them too.
    alpha_measured = mean["alpha_rad"] + 2 * known["V_scale"] * alpha
    alpha_measured = (
        alpha_measured - e["alpha_bias"] - e["alpha_scale"] * alpha + e["lag"] * np.gradient(alpha, blocks.t_s)
    )
    V_measured = mean["V_mps"] / (1 + e["airspeed_scale"]) + e["lag"] * Vdot
    V_lagged = mean["V_mps"] / (1 + known["V_scale"]) + e["lag"] * Vdot
    tilt = known["ax_bias"] / g - e["pitch"]
    n, S = f["n"].to_numpy(), blocks.aircraft.geometry.wing_area_m2

    def qS_over_m(V: Array) -> Array:
        return np.asarray(rho * V**2 / 2 * S / m)

    def thrust_over_m(V: Array) -> Array:
        table_N, _ = blocks.propeller.thrust_and_power(V, n, rho)
        J = V / (n * blocks.propeller.diameter_m)
        return np.asarray(table_N * (1 + e["thrust_scale"] + e["thrust_slope"] * (J - J_REFERENCE)) / m)

    columns = {
        **{name: f[name].to_numpy() for name in ("V", "alpha", "gamma", "climb", "bank", "Vdot", "rho", "J")},
        "ax": mean["ax_mps2"] - known["ax_bias"],
        "az": mean["az_mps2"] - known["az_bias"],
        "qS_over_m_mps2": qS_over_m(V),
        "thrust_x_over_m_mps2": thrust_over_m(V),
        "alpha_measured": alpha_measured,
        "theta_measured": theta + tilt / np.cos(theta),
        "height_measured": mean["height_m"] + e["lag"] * climb,
        "V_measured": V_measured,
        "qS_over_m_measured_mps2": qS_over_m(V_measured),
        "thrust_x_over_m_measured_mps2": thrust_over_m(V_measured),
        "qS_over_m_lagged_mps2": qS_over_m(V_lagged),
        "thrust_x_over_m_lagged_mps2": thrust_over_m(V_lagged),
        "static_Pa": mean["static_Pa"],
        "temperature_K": mean["temperature_K"],
        "covered": mean["propeller_covered"],
        "gust_mps": vertical.sigma_mps,
        "gust_s": vertical.time_s,
        "gust_along_mps": along.sigma_mps,
        "gust_along_s": along.time_s,
    }
    return pd.DataFrame(columns, index=f.index)
