"""The estimate of a flight, repeated for another aircraft file, propeller or air data."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from analysis.airdata.flight_data import FlightData
from analysis.drag import dynamic
from analysis.drag.dynamic import DynamicEstimate
from analysis.drag.estimate import every_method, fallback
from analysis.maneuvers.kinds import Maneuvers
from analysis.polar import Condition
from analysis.trajectory.priors import stated_sigma
from analysis.trajectory.reconstruction import Trajectory, reconstruct
from flight.aircraft import Aircraft
from flight.propeller import Propeller


@dataclass(frozen=True)
class Repetition:
    """Repeats the estimate of a flight with the maneuvers, weight and density of the first one.

    data : the flight's, by `aircraft`     data_of : the flight's data by another aircraft file
    trajectory : by `data`, with a prior standard deviation `alpha_scale_sigma` of the slope of angle of attack
    probe_sigma : the part of it by the calibration of the probe
    prior_factor : of `reconstruct`
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
    prior_factor: ArrayLike = 1.0

    def estimate(self, aircraft: Aircraft, propeller: Propeller, upwash_slope_sigma: float) -> DynamicEstimate:
        """The polar of the power curve.

        upwash_slope_sigma: prior standard deviation of the slope of angle of attack by upwash
        """
        trajectory = self._trajectory_of(aircraft, upwash_slope_sigma)
        if runs := self.maneuvers.level_runs:
            return dynamic.estimate_polar(trajectory, runs, aircraft, propeller)
        return self._without_runs(trajectory, aircraft, propeller)

    def values(self, aircraft: Aircraft, propeller: Propeller, upwash_slope_sigma: float) -> NDArray[np.float64]:
        """The `values` (5,) of `estimate` alone."""
        return self._values(self._trajectory_of(aircraft, upwash_slope_sigma), aircraft, propeller)

    def values_with_air(self, air: pd.DataFrame, propeller: Propeller) -> NDArray[np.float64]:
        """The `values` (5,) by other air data than the flight's, or by these."""
        trajectory, data = self.trajectory, self.data
        if air is not data.table:
            self.progress("repeating the estimate with other air data")
            sigma = self.alpha_scale_sigma
            trajectory = self._reconstructed(air, data, sigma)
        return self._values(trajectory, self.aircraft, propeller)

    def _values(self, trajectory: Trajectory, aircraft: Aircraft, propeller: Propeller) -> NDArray[np.float64]:
        """Without the work for their covariance where the flight has runs."""
        if runs := self.maneuvers.level_runs:
            return dynamic.estimate_values(trajectory, runs, aircraft, propeller)
        return self._without_runs(trajectory, aircraft, propeller).values

    def _without_runs(self, trajectory: Trajectory, aircraft: Aircraft, propeller: Propeller) -> DynamicEstimate:
        maneuvers = self.maneuvers.maneuvers
        others = every_method(trajectory, maneuvers, None, self.flown_CL, aircraft, propeller, self.condition)
        return fallback(others.by_method, trajectory, aircraft, self.log)[0]

    def _trajectory_of(self, aircraft: Aircraft, upwash_slope_sigma: float) -> Trajectory:
        """The trajectory, which does not depend on the propeller; the first one where nothing has changed."""
        self.progress("repeating the estimate with other values for what the aircraft file lacks")
        sigma = math.hypot(self.probe_sigma, upwash_slope_sigma)
        if aircraft is self.aircraft and sigma == self.alpha_scale_sigma:
            return self.trajectory
        data = self.data if aircraft is self.aircraft else self.data_of(aircraft)
        return self._reconstructed(data.table, data, sigma)

    def _reconstructed(self, air: pd.DataFrame, data: FlightData, alpha_scale_sigma: float) -> Trajectory:
        return reconstruct(
            air,
            data.rest,
            stated=stated_sigma(self.aircraft.uncertainty),
            alpha_scale_sigma=alpha_scale_sigma,
            compass=data.compass,
            calibrated=data.calibrated,
            gust_length=self.aircraft.uncertainty.gust_length,
            prior_factor=self.prior_factor,
            log=self.log,
        )
