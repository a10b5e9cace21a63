"""Repeats the estimate of a flight with another aircraft file, propeller or air data.

An error in an assumed value, such as the position of the probe, shows in no residual. It acts on all steps from the
synchronized channels on, so all of these are repeated with an error of one standard deviation to get its effect on the
polar. Maneuvers, weight and density stay as in the flight, so nothing else changes.
"""

from dataclasses import replace
from typing import NamedTuple

import pandas as pd

from flightpower.analysis.air.flight_data import FlightData, flight_data
from flightpower.analysis.flight import Reconstructed, trajectory_with
from flightpower.analysis.methods import dynamic
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.methods.methods import fallback, one_method
from flightpower.analysis.trajectory.priors import upwash_slope_sigma
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.propeller import Propeller


class EstimateRerun(NamedTuple):
    """Repeats the analysis of a flight, from the channels to the polar.

    method: name of the method that gives the curve, if it is not the dynamic method
    slope_sigma, an argument of `estimate` and `values`: prior standard deviation of the error in the slope of angle of
        attack that upwash makes
    """

    flight: Reconstructed
    method: str = ""

    def estimate(self, aircraft: Aircraft, propeller: Propeller, slope_sigma: float) -> DynamicEstimate:
        """The polar of the power curve with its covariance."""
        trajectory = self._trajectory(aircraft, slope_sigma)
        if self.method:
            return self._by_another_method(trajectory, aircraft, propeller)
        return dynamic.estimate_polar(trajectory, self.flight.maneuvers.level_runs, aircraft, propeller)

    def values(self, aircraft: Aircraft, propeller: Propeller, slope_sigma: float) -> Array:
        """A0, A1, A2 and the two corrections of thrust (5,), without their covariance."""
        return self._values(self._trajectory(aircraft, slope_sigma), aircraft, propeller)

    def values_with_air(self, air: pd.DataFrame) -> Array:
        """Repeat the estimate with other air data; the flight's own table needs no new trajectory."""
        flight, trajectory = self.flight, self.flight.trajectory
        if air is not flight.table:
            flight.progress("repeating the estimate with other air data")
            trajectory = self._reconstructed(flight.data._replace(table=air), upwash_slope_sigma(flight.aircraft))
        return self._values(trajectory, flight.aircraft, flight.propeller)

    def _values(self, trajectory: Trajectory, aircraft: Aircraft, propeller: Propeller) -> Array:
        """The values (5,) alone. Methods other than the dynamic one need the full estimate for that."""
        if self.method:
            return self._by_another_method(trajectory, aircraft, propeller).values
        return dynamic.estimate_values(trajectory, self.flight.maneuvers.level_runs, aircraft, propeller)

    def _by_another_method(self, trajectory: Trajectory, aircraft: Aircraft, propeller: Propeller) -> DynamicEstimate:
        flight = self.flight
        estimate = one_method(self.method, trajectory, flight.maneuvers.maneuvers, aircraft, propeller)
        return fallback([estimate], trajectory, aircraft, flight.name).estimate

    def _trajectory(self, aircraft: Aircraft, slope_sigma: float) -> Trajectory:
        """The trajectory, which does not depend on the propeller. It is the flight's own if nothing has changed."""
        flight = self.flight
        if aircraft is flight.aircraft and slope_sigma == upwash_slope_sigma(flight.aircraft):
            return flight.trajectory
        flight.progress("repeating the estimate with other values for what the aircraft file lacks")
        data = flight.data
        if aircraft is not flight.aircraft:
            data = flight_data(flight.log, aircraft, flight.propeller, flight.contents.calibrations)
        return self._reconstructed(data, slope_sigma)

    def _reconstructed(self, data: FlightData, slope_sigma: float) -> Trajectory:
        flight = self.flight
        trajectory = trajectory_with(
            flight,
            data,
            prior_factor=flight.prior_factor,
            slope_sigma=slope_sigma,
            as_measured=flight.trajectory.as_measured,
            height_noise=flight.trajectory.height_noise,
        )
        return replace(trajectory, eddies_mps=flight.trajectory.eddies_mps)
