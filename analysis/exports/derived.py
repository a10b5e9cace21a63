"""Quantities derived along the trajectory, with standard errors: airspeed, flow angle, attitude, thrust, C_L, C_D."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag import consider
from analysis.drag.forces import J_REFERENCE, FlightForces
from analysis.drag.thrust_prior import thrust_prior
from analysis.trajectory.reconstruction import Trajectory
from flight.aircraft import Aircraft
from flight.propeller import Propeller

Array = NDArray[np.float64]
QUANTITIES = ("alpha_rad", "V_mps", "theta_rad", "thrust_N", "C_L", "C_D")
SLOWEST_MPS = 3.0  # below, an airspeed is noise and coefficients are without meaning
ERROR = "_standard_error"


def derived(trajectory: Trajectory, aircraft: Aircraft, propeller: Propeller) -> pd.DataFrame:
    """QUANTITIES and the standard error of each (`alpha_rad_standard_error`), one row per block, index t_s.

    Thrust is that of the propeller table. Standard errors are by repetition along perturbed trajectories (sensor errors
    in each independent direction, and draws of the states' random errors), with the prior standard deviations of the
    propeller table, and with another weight. NaN where the aircraft did not fly, and thrust where the motor stood.
    """
    flight_forces = FlightForces(trajectory, aircraft, propeller)
    states, errors = trajectory.states.to_numpy(), trajectory.sensor_errors
    theta = trajectory.states.columns.get_loc("theta")

    def quantities(flight_forces: FlightForces, states: Array, errors: Array) -> tuple[Array, pd.DataFrame]:
        f = flight_forces.forces(states, errors)
        thrust_N = f["thrust_along_V_over_m_mps2"] * flight_forces.aircraft.mass_kg / np.cos(f["alpha"])
        return np.stack([f["alpha"], f["V"], states[:, theta], thrust_N, f["CL"], f["CD"]], axis=1), f

    nominal, f = quantities(flight_forces, states, errors)
    variance = np.zeros_like(nominal)
    for error in np.linalg.cholesky(trajectory.covariance).T:
        moved, _ = quantities(flight_forces, states + trajectory.state_sensitivity @ error, errors + error)
        variance += (moved - nominal) ** 2
    for draw in trajectory.draws:
        variance += (quantities(flight_forces, states + draw, errors)[0] - nominal) ** 2 / len(trajectory.draws)
    heavier, _ = quantities(consider.heavier(flight_forces), states, errors)
    variance += (heavier - nominal) ** 2
    variance[:, QUANTITIES.index("thrust_N") :] += _by_thrust_table(nominal, f, aircraft)
    flying = nominal[:, 1] > SLOWEST_MPS
    columns = dict(zip(QUANTITIES, np.where(flying[:, None], nominal, np.nan).T, strict=True))
    spread = np.where(flying[:, None], np.sqrt(variance), np.nan)
    columns |= {f"{name}{ERROR}": column for name, column in zip(QUANTITIES, spread.T, strict=True)}
    index = pd.Index(flight_forces.t_s, name="t_s")
    return pd.DataFrame({name: columns[name] for q in QUANTITIES for name in (q, f"{q}{ERROR}")}, index=index)


def _by_thrust_table(nominal: Array, f: pd.DataFrame, aircraft: Aircraft) -> Array:
    """Variances (n, 3) of thrust, C_L and C_D by the errors of the propeller table."""
    alpha, thrust_N = nominal[:, 0], nominal[:, QUANTITIES.index("thrust_N")]
    (scale, both), (_, slope) = thrust_prior(aircraft).second_moment
    from_reference = f["J"].to_numpy() - J_REFERENCE
    beyond_N = f["thrust_beyond_over_m_mps2"].to_numpy() * aircraft.mass_kg / np.cos(alpha)
    variance_N2 = thrust_N**2 * (scale + 2 * both * from_reference + slope * from_reference**2) + beyond_N**2
    qS_N = f["qS_over_m_mps2"].to_numpy() * aircraft.mass_kg
    return np.stack(
        [variance_N2, variance_N2 * (np.sin(alpha) / qS_N) ** 2, variance_N2 * (np.cos(alpha) / qS_N) ** 2], axis=1
    )
