"""Forces along a reconstructed trajectory: the common start of all methods that use it.

All quantities are means over the blocks of the trajectory, five a second. The trajectory is passed as states and sensor
errors, so that a method can be repeated along a perturbed trajectory. Forces are divided by mass [m/s^2].
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.trajectory.equations import PREDICTED_FLOW, SENSOR_ERRORS, STATES, NamedArrays, flow
from analysis.trajectory.reconstruction import Trajectory
from flight.aerodynamics import stability_axes
from flight.aircraft import Aircraft
from flight.propeller import Propeller

Array = NDArray[np.float64]

# A propeller table is corrected to T = T_table (1 + thrust_scale + thrust_slope (J - J_REFERENCE)).
J_REFERENCE = 0.5


class FlightForces:
    """Forces of one flight, along the reconstructed trajectory and along perturbed ones.

    block_means : the measurements, (n,) by name     t_s : (n,) centres of the blocks [s]
    """

    def __init__(self, trajectory: Trajectory, aircraft: Aircraft, propeller: Propeller):
        self.block_means = trajectory.block_means
        self.t_s = trajectory.states.index.to_numpy()
        self.aircraft, self.propeller = aircraft, propeller
        self._predicted_flow = NamedArrays(PREDICTED_FLOW, trajectory.predicted_flow.T)

    def forces(self, states: Array, sensor_errors: Array) -> pd.DataFrame:
        """One row per block, for states (n, len(STATES)) and sensor errors (len(SENSOR_ERRORS),).

        CL, CD : from specific force minus the thrust by the propeller table (2.16)
        qS_over_m_mps2 : dynamic pressure times wing area over mass
        thrust_along_V_over_m_mps2 : T cos(alpha) over mass, T by the propeller table
        thrust_beyond_over_m_mps2 : standard deviation of it by the table's continuation beyond its last J
        V, alpha, gamma, bank, climb : true airspeed [m/s], angles relative to the air [rad], rate of climb [m/s]
        Vdot [m/s^2], n [rev/s], J, rho [kg/m^3]
        """
        x, error = NamedArrays(STATES, states.T), NamedArrays(SENSOR_ERRORS, sensor_errors)
        V, alpha, _ = flow(x, self._predicted_flow)
        m, rho = self.aircraft.mass_kg, self.block_means["rho"]
        qS_N = rho * V**2 / 2 * self.aircraft.geometry.wing_area_m2
        n = np.where(self.block_means["n_revps"] > 1, self.block_means["n_revps"], np.nan)
        thrust_N, _ = self.propeller.thrust_and_power(V, n, rho)  # (3.48): J is of the whole airspeed
        ax, az = self.block_means["ax_mps2"] - error.ax_bias, self.block_means["az_mps2"] - error.az_bias
        CL, CD = stability_axes((m * ax - thrust_N) / qS_N, m * az / qS_N, alpha)
        J = V / (n * self.propeller.diameter_m)
        beyond_N = self.propeller.continuation_error(J, 60 * n) * rho * n**2 * self.propeller.diameter_m**4
        columns = {
            "CL": CL,
            "CD": CD,
            "qS_over_m_mps2": qS_N / m,
            "thrust_along_V_over_m_mps2": thrust_N * np.cos(alpha) / m,
            "thrust_beyond_over_m_mps2": beyond_N * np.cos(alpha) / m,
            "J": J,
            "V": V,
            "alpha": alpha,
            "gamma": np.arcsin(np.clip((x.gust_w - x.v_down) / V, -1, 1)),
            "bank": x.phi,
            "climb": -x.v_down,
            "Vdot": np.gradient(V, self.t_s),
            "n": n,
            "rho": rho,
        }
        return pd.DataFrame(columns, index=self.t_s)
