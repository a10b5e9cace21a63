"""The errors that make methods disagree: their causes, their prior standard deviations, and estimates for one flight.

Every method except the dynamic one uses some quantity without correction: the angle of attack, the pitch attitude, the
airspeed, or the propeller table. The trajectory, and a regression of the forces along it, estimate their errors.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.methods.forces import FlightForces
from flightpower.analysis.methods.settings import COMPARISON, REGRESSION
from flightpower.analysis.methods.thrust_prior import J_REFERENCE, THRUST, thrust_prior
from flightpower.analysis.records.flight import Cause
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.aircraft import Aircraft, Uncertainty
from flightpower.flight.units import GRAVITY_MPS2 as g

# The errors that belong to each cause.
CAUSES: dict[Cause, tuple[str, ...]] = {
    Cause.ANGLE_OF_ATTACK: ("alpha_bias", "alpha_scale"),
    Cause.PITCH_ATTITUDE: ("pitch",),
    Cause.AIRSPEED: ("airspeed_scale",),
    Cause.AIR_DATA_LAG: ("lag",),
    Cause.PROPELLER_TABLE: THRUST,
}


class ErrorEstimate(NamedTuple):
    value: float
    standard_error: float


def error_prior_sigma(uncertainty: Uncertainty) -> dict[str, float]:
    """Prior standard deviation of each error without calibration. It is the systematic error of a method that does not
    correct this error."""
    return {
        "alpha_bias": uncertainty.angle_of_attack_offset_rad,
        "alpha_scale": uncertainty.angle_of_attack_slope_fraction,
        # An attitude that is leveled by a biased accelerometer is tilted.
        "pitch": uncertainty.accelerometer_offset_mps2 / g,
        "airspeed_scale": uncertainty.airspeed_scale_fraction,
        "lag": uncertainty.air_data_lag_s,
        "thrust_scale": uncertainty.thrust_scale_fraction,
        "thrust_slope": uncertainty.thrust_slope,
    }


def estimate_errors(
    flight_forces: FlightForces, trajectory: Trajectory, rows: NDArray[np.bool_]
) -> dict[str, ErrorEstimate]:
    """Estimate each error of `error_prior_sigma` from the trajectory and the forces along it. rows: blocks of the runs

    The tight prior of the air-data lag in the trajectory is replaced by `COMPARISON.lag_sigma_s` here, so that a large
    lag is estimated as such and not mistaken for a thrust error.
    """
    trajectory = trajectory.with_prior("air_data_lag", COMPARISON.lag_sigma_s)
    estimates = {}
    for name, sensor_error, factor in (
        ("alpha_bias", "alpha_bias", 1.0),
        ("alpha_scale", "alpha_scale", 1.0),
        ("pitch", "ax_bias", 1 / g),
        ("airspeed_scale", "V_scale", 1.0),
        ("lag", "air_data_lag", 1.0),
    ):
        value, standard_error = trajectory.value(sensor_error), trajectory.standard_error(sensor_error)
        estimates[name] = ErrorEstimate(value * factor, standard_error * factor)
    along = flight_forces.forces(trajectory.states.to_numpy(), trajectory.sensor_errors)
    return estimates | _thrust_errors(along[rows], flight_forces.aircraft)


def _thrust_errors(forces: pd.DataFrame, aircraft: Aircraft) -> dict[str, ErrorEstimate]:
    """Estimate errors of the propeller table by a regression of drag on polar and thrust, with priors on thrust."""
    data = forces[["CL", "CL_squared", "CD", "qS_over_m_mps2", "thrust_along_V_over_m_mps2", "J"]].dropna()
    prior = thrust_prior(aircraft)
    if len(data) < REGRESSION.fewest_blocks_of_flight:
        sigma = np.sqrt(np.diag(prior.covariance))
        return {name: ErrorEstimate(float(prior.mean[i]), float(sigma[i])) for i, name in enumerate(THRUST)}
    CL, CL_squared, CD, qS_over_m, thrust_over_m, J = data.to_numpy().T
    X = np.stack(
        [qS_over_m, qS_over_m * CL, qS_over_m * CL_squared, -thrust_over_m, -thrust_over_m * (J - J_REFERENCE)], axis=1
    )
    z = qS_over_m * CD
    theta, *_ = np.linalg.lstsq(X, z, rcond=None)
    variance = float(np.mean((z - X @ theta) ** 2)) * COMPARISON.correlated_blocks
    prior_information, prior_vector = np.zeros((5, 5)), np.zeros(5)
    prior_information[3:, 3:], prior_vector[3:] = prior.information, prior.vector
    C = np.linalg.inv(X.T @ X / variance + prior_information)
    values, errors = C @ (X.T @ z) / variance + C @ prior_vector, np.sqrt(np.diag(C))
    return {name: ErrorEstimate(float(values[i]), float(errors[i])) for i, name in enumerate(THRUST, start=3)}
