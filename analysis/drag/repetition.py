"""The estimate of a flight, repeated for another aircraft file, propeller or air data."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.from_log import FlightData
from analysis.drag.dynamic import DynamicEstimate
from analysis.drag.estimate import main_polar, main_values
from analysis.drag.polar import Condition
from analysis.maneuvers.kinds import Maneuvers
from analysis.trajectory.reconstruction import Trajectory, reconstruct
from flight.aircraft import Aircraft
from flight.propeller import Propeller


@dataclass(frozen=True)
class Repetition:
    """Repeats the estimate of a flight with the maneuvers, weight and density of the first one.

    data : the flight's, by `aircraft`     data_of : the flight's data by another aircraft file
    trajectory : by `data`, with a prior standard deviation `alpha_scale_sigma` of the slope of angle of attack
    probe_sigma : the part of it by the calibration of the probe
    """

    data: FlightData
    data_of: Callable[[Aircraft], FlightData]
    trajectory: Trajectory
    alpha_scale_sigma: float
    probe_sigma: float
    maneuvers: Maneuvers
    aircraft: Aircraft
    condition: Condition
    flown_CL: tuple[float, float]
    log: str
    progress: Callable[[str], None]

    def estimate(self, aircraft: Aircraft, propeller: Propeller, upwash_slope_sigma: float) -> DynamicEstimate:
        """By `main_polar`; upwash_slope_sigma: prior standard deviation of the slope of angle of attack by upwash."""
        trajectory = self._trajectory_of(aircraft, upwash_slope_sigma)
        return main_polar(trajectory, self.maneuvers, aircraft, propeller, self.condition, self.flown_CL, self.log)

    def values(self, aircraft: Aircraft, propeller: Propeller, upwash_slope_sigma: float) -> NDArray[np.float64]:
        """The `values` (5,) of `estimate` alone, by `main_values`."""
        trajectory = self._trajectory_of(aircraft, upwash_slope_sigma)
        return main_values(trajectory, self.maneuvers, aircraft, propeller, self.condition, self.flown_CL, self.log)

    def values_with_air(self, air: pd.DataFrame, propeller: Propeller) -> NDArray[np.float64]:
        """The `values` (5,) by other air data than the flight's, or by these."""
        trajectory, data = self.trajectory, self.data
        if air is not data.table:
            self.progress("repeating the estimate with other air data")
            sigma = self.alpha_scale_sigma
            trajectory = reconstruct(air, data.rest, alpha_scale_sigma=sigma, compass=data.compass, log=self.log)
        return main_values(
            trajectory, self.maneuvers, self.aircraft, propeller, self.condition, self.flown_CL, self.log
        )

    def _trajectory_of(self, aircraft: Aircraft, upwash_slope_sigma: float) -> Trajectory:
        """The trajectory, which does not depend on the propeller; the first one where nothing has changed."""
        self.progress("repeating the estimate with other values for what the aircraft file lacks")
        sigma = math.hypot(self.probe_sigma, upwash_slope_sigma)
        if aircraft is self.aircraft and sigma == self.alpha_scale_sigma:
            return self.trajectory
        data = self.data if aircraft is self.aircraft else self.data_of(aircraft)
        return reconstruct(data.table, data.rest, alpha_scale_sigma=sigma, compass=data.compass, log=self.log)
