"""Forces along a flight path: what every method that knows the path starts from.

Works on means over the path's blocks, five a second. A path is given by its states and by the errors of the sensors, so
that a method can also be asked what it would say along a slightly different path.
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.trajectory.block_means import block_mean
from analysis.trajectory.equations import PREDICTED_FLOW, SENSOR_ERRORS, STATES, NamedValues, flow
from analysis.trajectory.reconstruction import Trajectory
from flight.aerodynamics import stability_axes
from flight.aircraft import Aircraft
from flight.propeller import Propeller

Array = NDArray[np.float64]

J_REFERENCE = 0.5
THRUST_SCALE, THRUST_SLOPE = 0.018, 0.15  # standard deviations of what a propeller table is wrong by, over J too


class Blocks:
    """The measurements that forces need, as means over the path's blocks.

    mean : name of a column of the table to (n,)     t_s : (n,) centres of the blocks [s]
    """

    def __init__(self, table: pd.DataFrame, trajectory: Trajectory, aircraft: Aircraft, propeller: Propeller):
        """table: as `air_data` leaves it."""
        n = len(trajectory.states)
        self.mean = {name: block_mean(table[name], n) for name in table.columns}
        self.t_s = trajectory.states.index.to_numpy()
        self.aircraft, self.propeller = aircraft, propeller
        self._slow = NamedValues(PREDICTED_FLOW, trajectory.predicted_flow.T)

    def forces(self, states: Array, shared: Array) -> pd.DataFrame:
        """A row a block, along a path of states (n, len(STATES)) with the sensors' errors shared (len(SENSOR_ERRORS),).

        CL, CD : (2.16) with the tabulated thrust taken out      qS, thrust : over mass [m/s^2]; the latter along V
        V, alpha, gamma, bank, climb : through the air [m/s, rad]        Vdot : [m/s^2]        n [rev/s], J, rho
        """
        x, error = NamedValues(STATES, states.T), NamedValues(SENSOR_ERRORS, shared)
        V, alpha, _ = flow(x, self._slow)
        m, rho = self.aircraft.mass_kg, self.mean["rho"]
        qS = rho * V**2 / 2 * self.aircraft.geometry.wing_area_m2
        n = np.where(self.mean["n_revps"] > 1, self.mean["n_revps"], np.nan)
        thrust, _ = self.propeller.thrust_and_power(V, n, rho)  # (3.48): J is of the whole airspeed
        ax, az = self.mean["ax_mps2"] - error.ax_bias, self.mean["az_mps2"] - error.az_bias
        CL, CD = stability_axes((m * ax - thrust) / qS, m * az / qS, alpha)
        columns = {
            "CL": CL,
            "CD": CD,
            "qS": qS / m,
            "thrust": thrust * np.cos(alpha) / m,
            "J": V / (n * self.propeller.diameter_m),
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
