"""The data that all methods work on: quantities along the trajectory, and the same as measured.

A method that takes a quantity as measured differs from the dynamic method by the error of that quantity. The table is
therefore computed several times: without corrections, along perturbed trajectories, with an error of one prior standard
deviation removed, for each error, and with the estimated errors of each cause removed. The last shows which cause makes
two methods disagree.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from analysis.drag.forces import FlightForces
from analysis.drag.sensor_errors import CAUSES, ErrorEstimate, error_prior_sigma
from analysis.ground.thrust_prior import J_REFERENCE
from analysis.maneuvers.kinds import Maneuver
from analysis.trajectory import dryden
from analysis.trajectory.dryden import GaussMarkov
from analysis.trajectory.equations import SENSOR_ERRORS, NamedArrays
from analysis.trajectory.reconstruction import Trajectory
from flight.aircraft import Aircraft
from flight.arrays import Array
from flight.units import GRAVITY_MPS2 as g


@dataclass(frozen=True)
class MethodInputs:
    """The runs of one flight and the tables (of `input_table`) that methods are applied to.

    nominal : along the trajectory, nothing corrected
    trajectory_deviations : along the trajectory perturbed by each independent error of one standard deviation
    error_deviations : with each error of `error_prior_sigma` removed, as if it were one standard deviation
    cause_corrected : with the estimated errors of each of CAUSES removed
    """

    aircraft: Aircraft
    runs: list[Maneuver]
    nominal: pd.DataFrame
    trajectory_deviations: list[pd.DataFrame]
    error_deviations: dict[str, pd.DataFrame]
    cause_corrected: dict[str, pd.DataFrame]


def method_inputs(
    flight_forces: FlightForces, trajectory: Trajectory, runs: list[Maneuver], errors: Mapping[str, ErrorEstimate]
) -> MethodInputs:
    """The tables of one flight. errors: from `estimate_errors`."""
    states, sensor_errors = trajectory.states.to_numpy(), trajectory.sensor_errors
    perturbed = [
        (flight_forces.forces(states + trajectory.state_sensitivity @ error, sensor_errors + error), error)
        for error in np.linalg.cholesky(trajectory.covariance).T
    ]
    sigmas = error_prior_sigma(flight_forces.aircraft.uncertainty)
    flying = np.isfinite(flight_forces.block_means["V_mps"])
    height_m, V = (float(np.nanmedian(flight_forces.block_means[name][flying])) for name in ("height_m", "V_mps"))
    gusts = (
        dryden.vertical(trajectory.gust_mps, height_m, V / trajectory.gust_length).as_gauss_markov(),
        dryden.longitudinal(trajectory.gust_mps, height_m, V / trajectory.gust_length),
    )

    def corrected(removed: Mapping[str, float]) -> pd.DataFrame:
        return input_table(flight_forces, flight_forces.nominal, sensor_errors, removed, gusts)

    return MethodInputs(
        flight_forces.aircraft,
        runs,
        corrected({}),
        [input_table(flight_forces, forces, sensor_errors + error, {}, gusts) for forces, error in perturbed],
        {name: corrected({name: sigma}) for name, sigma in sigmas.items()},
        {cause: corrected({name: errors[name].value for name in names}) for cause, names in CAUSES.items()},
    )


def input_table(
    flight_forces: FlightForces,
    f: pd.DataFrame,
    sensor_errors: Array,
    removed: Mapping[str, float],
    gusts: tuple[GaussMarkov, GaussMarkov],
) -> pd.DataFrame:
    """The data that methods work on, one row per block, with the errors `removed` subtracted from measured quantities.

    f: of `FlightForces.forces`, along a trajectory with sensor errors (len(SENSOR_ERRORS),). From it V, alpha, gamma,
    climb, bank, Vdot, rho, J; specific force ax, az [m/s^2]; qS_over_m_mps2; thrust_x_over_m_mps2, the thrust of the
    table along body x.
    As measured: alpha_measured [rad]; theta_measured [rad], pitch attitude leveled by the accelerometer;
    height_measured [m]; V_measured [m/s], with the qS_over_m and thrust_x_over_m computed from it; static_Pa [Pa],
    temperature_K [K]. lagged: airspeed as measured with its estimated scale error corrected, so that only the error by
    air-data lag remains.
    covered: share of the block within the propeller table.
    Standard deviation and correlation time of vertical gusts (gust_mps, gust_s) and of those along the flight path
    (gust_along_mps, gust_along_s), the same in all rows. gusts: these two.
    """
    vertical_gust, longitudinal_gust = gusts
    e = {name: removed.get(name, 0.0) for names in CAUSES.values() for name in names}
    known = dict(zip(SENSOR_ERRORS, sensor_errors, strict=True))
    ax, az = flight_forces.corrected_force(NamedArrays(SENSOR_ERRORS, sensor_errors))
    mean, m = flight_forces.block_means, flight_forces.aircraft.mass_kg
    V, alpha, theta, Vdot = (f[name].to_numpy() for name in ("V", "alpha", "theta", "Vdot"))
    rho, climb = f["rho"].to_numpy(), f["climb"].to_numpy()
    # Flow angles are pressures over dynamic pressure: the estimated airspeed scale corrects them too.
    alpha_measured = mean["alpha_rad"] + 2 * known["V_scale"] * alpha
    alpha_measured = (
        alpha_measured - e["alpha_bias"] - e["alpha_scale"] * alpha + e["lag"] * np.gradient(alpha, flight_forces.t_s)
    )
    V_measured = mean["V_mps"] / (1 + e["airspeed_scale"]) + e["lag"] * Vdot
    V_lagged = mean["V_mps"] / (1 + known["V_scale"]) + e["lag"] * Vdot
    tilt = known["ax_bias"] / g - e["pitch"]
    n, S = f["n"].to_numpy(), flight_forces.aircraft.geometry.wing_area_m2

    def qS_over_m(V: Array) -> Array:
        return np.asarray(rho * V**2 / 2 * S / m)

    def thrust_over_m(V: Array) -> Array:
        table_N, _ = flight_forces.propeller.thrust_and_power(V, n, rho)
        J = V / (n * flight_forces.propeller.diameter_m)
        return np.asarray(table_N * (1 + e["thrust_scale"] + e["thrust_slope"] * (J - J_REFERENCE)) / m)

    columns = {
        **{name: f[name].to_numpy() for name in ("V", "alpha", "gamma", "climb", "bank", "Vdot", "rho", "J")},
        "ax": ax + flight_forces.cov_az_alpha,  # without the push by gusts
        "az": az,
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
        "gust_mps": vertical_gust.sigma_mps,
        "gust_s": vertical_gust.time_s,
        "gust_along_mps": longitudinal_gust.sigma_mps,
        "gust_along_s": longitudinal_gust.time_s,
    }
    return pd.DataFrame(columns, index=f.index)
