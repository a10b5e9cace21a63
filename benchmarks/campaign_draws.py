"""Draws campaigns from the statistics of flown flights, to extend the results of a few flights to many campaigns.

Errors of installation and thrust are drawn from the study's budget once per campaign. The estimates of each flight are
drawn from the covariance that its analysis states, with the effect of the prior. Such draws cannot show whether that
covariance is right; `benchmarks/campaigns.py` shows it by the coverage of the flown flights.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.flights.flight_statistics import POOLED, FlightStatistics, M
from flightpower.analysis.flights.joint import OWN_CHANGES, stacked
from flightpower.analysis.flights.joint_pool import JointPool
from flightpower.analysis.flights.pool import pool
from flightpower.sim.sensors.budget import load_budget

Array = NDArray[np.float64]

MORE_DRAG = 0.03


class Draws:
    """Draws campaigns from flights of one weather."""

    def __init__(self, flights: Sequence[FlightStatistics], polar: Array, seed: int):
        """polar: (3,), the true one. flights: each with a named installation"""
        stack = stacked(flights)
        self.flights, self.polar, self._rng = flights, polar, np.random.default_rng(seed)
        self._own, self._normal_matrix = np.linalg.inv(stack.gain), stack.normal_matrix
        day_changes = [
            [change for name, change in flight.parameters.shared.items() if name in OWN_CHANGES] for flight in flights
        ]
        by_changes = np.stack([sum((np.outer(c, c) for c in some), np.zeros((M, M))) for some in day_changes])
        values, vectors = np.linalg.eigh(stack.own_covariance - by_changes)  # the budget contains none of these changes
        self._root = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]

    def shared(self) -> Array:
        """Draw from the study's budget the parameters that all flights of one campaign share."""
        s, uniform = load_budget("study").systematic, self._rng.uniform
        tilt = s.imu_misalignment_rad
        errors = {
            "thrust_scale": uniform(-s.thrust_scale, s.thrust_scale),
            "thrust_slope": uniform(-s.thrust_slope_J, s.thrust_slope_J),
            "thrust_beyond": 0.0,
            "alpha_bias": uniform(-s.alpha_offset_rad, s.alpha_offset_rad) + uniform(-tilt, tilt),
            "alpha_scale": uniform(-s.alpha_scale, s.alpha_scale),
            "beta_bias": uniform(-s.beta_offset_rad, s.beta_offset_rad) + uniform(-tilt, tilt),
            "V_scale": uniform(-s.V_scale, s.V_scale),
            "air_data_lag": uniform(0.0, s.lag_s),
        }
        return np.concatenate([self.polar, [errors[name] for name in POOLED[3:]]])

    def pool(self, shared: Array, number: int) -> JointPool:
        """Pool `number` flights, drawn with replacement, with new errors of the day."""
        flights = []
        for i in self._rng.integers(len(self.flights), size=number):
            flight = self.flights[i]
            expected = self._own[i] @ (self._normal_matrix[i] @ shared + flight.prior_vector)
            noise = self._root[i] @ self._rng.standard_normal(len(shared))
            flights.append(flight._replace(values=expected + noise, installation="drawn"))
        return pool(flights)


def with_more_drag(shared: Array) -> Array:
    """Return the parameters for configuration B, which has more drag."""
    return np.concatenate([(1 + MORE_DRAG) * shared[:3], shared[3:]])
