"""The prior of thrust: errors of the propeller table, and thrust at rest from a stand.

The table's thrust is corrected by the factor 1 + thrust_scale + thrust_slope (J - J_REFERENCE). The priors of the two
errors are independent. A stand measures this factor at J = 0, which is a linear combination of the two errors, so their
joint prior is then a normal distribution with correlation.
"""

import math
from typing import NamedTuple

import numpy as np

from flightpower.analysis.estimation.model import PriorMeasurement
from flightpower.analysis.settings import EVIDENCE
from flightpower.flight.aircraft import Aircraft, Uncertainty
from flightpower.flight.arrays import Array
from flightpower.flight.propeller import J_REFERENCE as J_REFERENCE

THRUST = ("thrust_scale", "thrust_slope")  # thrust is the table's times 1 + scale + slope (J - J_REFERENCE)
STAND = "thrust on the stand"


class ThrustPrior(NamedTuple):
    """Normal prior of (thrust_scale, thrust_slope).

    mean, covariance : (2,) and (2, 2)     information : (2, 2), the inverse     vector : (2,), information times mean
    """

    mean: Array
    covariance: Array
    information: Array
    vector: Array

    @property
    def second_moment(self) -> Array:
        """Second moment (2, 2) about zero, which is the uncertainty of a table that is not corrected by the mean."""
        return self.covariance + np.outer(self.mean, self.mean)


def stand_measurements(aircraft: Aircraft) -> tuple[PriorMeasurement, ...]:
    """The measurement on a stand, if any. Its error includes the error of a straight line from rest to flight."""
    measured = aircraft.static_thrust_excess
    if measured is None:
        return ()
    value, sigma = measured
    return (
        PriorMeasurement(
            name=STAND,
            coefficients=(("thrust_scale", 1.0), ("thrust_slope", -J_REFERENCE)),
            value=value,
            sigma=sigma,
        ),
    )


def stand_information(aircraft: Aircraft) -> Array:
    """Information (2, 2) about (thrust_scale, thrust_slope) from the stand; zero if there is none."""
    information = np.zeros((2, 2))
    for measurement in stand_measurements(aircraft):
        row = measurement.row(THRUST)
        information += np.outer(row, row)
    return information


def thrust_prior(aircraft: Aircraft) -> ThrustPrior:
    """The joint prior of the errors of thrust."""
    uncertainty = aircraft.uncertainty
    sigma = np.array([uncertainty.thrust_scale_fraction, uncertainty.thrust_slope])
    mean, vector = np.zeros(2), np.zeros(2)
    with np.errstate(divide="ignore"):  # an error stated as zero means a known value
        covariance, information = np.diag(sigma**2), np.diag(1 / sigma**2) + stand_information(aircraft)
    for measurement in stand_measurements(aircraft):
        row, value = measurement.row(THRUST), measurement.value / measurement.sigma
        gain = covariance @ row / (row @ covariance @ row + 1)
        mean = mean + gain * (value - row @ mean)
        covariance = covariance - np.outer(gain, row @ covariance)
        vector = vector + row * value
    return ThrustPrior(mean, covariance, information, vector)


def stand_conflict(ratio: float, error: float, uncertainty: Uncertainty) -> str:
    """A sentence if a stand's ratio of thrust to the table is further from one than priors allow; else empty."""
    scale, slope = uncertainty.thrust_scale_fraction, J_REFERENCE * uncertainty.thrust_slope
    expected = math.hypot(scale, slope, error, uncertainty.thrust_curvature_fraction)
    z = (ratio - 1) / expected
    if abs(z) <= EVIDENCE.contradiction:
        return ""
    return (
        f"thrust at rest differs from the table by {z:+.1f} of the standard deviations assumed"
        f" ({100 * expected:.1f} %): check the propeller, its table, the number of pole pairs and the load cell, or"
        " state a larger [uncertainty] thrust_scale and thrust_slope"
    )
