"""What a plan is to answer, as the half width that it makes small."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.drag.polar import Condition, Polar, best_range_lift, minimum_power_lift, power_required, speed_at
from analysis.estimation.intervals import NORMAL_95
from analysis.planning.expected_aircraft import ExpectedAircraft
from analysis.trajectory.equations import SENSOR_ERRORS

Array = NDArray[np.float64]

SPEEDS = 5
INSTALLATION = ("alpha_bias", "alpha_scale", "beta_bias", "V_scale", "air_data_lag")  # common to two flights of a day
MEAN_SHARE = 0.1  # of the mean over speeds, beside the worst speed


class Covariances(NamedTuple):
    """Of the sensor errors (m, m), and of A0, A1, A2 (3, 3): by noise, and by consider terms and floor.

    shared : (3, m) derivative of A0, A1, A2 by the sensor errors
    """

    errors: Array
    noise: Array
    fixed: Array
    shared: Array

    @property
    def polar(self) -> Array:
        """Covariance of A0, A1, A2."""
        return np.asarray(self.noise + self.fixed + self.shared @ self.errors @ self.shared.T)


class Question(NamedTuple):
    """speeds: where half widths are told [m/s]. cost: what the plan makes small [%]."""

    name: str
    title: str
    speeds: Array
    cost: Callable[[Covariances], float]
    half_widths: Callable[[Covariances], Array]  # in % of power, at `speeds`


TITLES = {
    "curve": "the whole power curve",
    "endurance": "power at the speed of longest endurance",
    "range": "power at the speed of longest range",
    "propellers": "the difference of two propellers, flown one after the other",
    "probe": "the calibration of the probe",
}


def question(name: str, expected: ExpectedAircraft, slowest_mps: float, fastest_mps: float) -> Question:
    """One of TITLES, for the speeds that are planned."""
    V = np.linspace(slowest_mps, fastest_mps, SPEEDS)
    center = {"endurance": minimum_power_lift, "range": best_range_lift}.get(name)
    if center is not None:
        best = float(np.clip(speed_at(center(expected.A), condition(expected)), slowest_mps, fastest_mps))
        V = np.unique(np.clip(best * np.array([0.95, 1.0, 1.05]), slowest_mps, fastest_mps))

    def widths_of(found: Covariances) -> Array:
        return half_widths(_of_difference(found) if name == "propellers" else found, expected, V)

    def cost(found: Covariances) -> float:
        if name == "probe":
            return _probe_cost(found.errors)
        widths = widths_of(found)
        return float(np.max(widths) + MEAN_SHARE * np.mean(widths))

    return Question(name, TITLES[name], V, cost, widths_of)


def condition(expected: ExpectedAircraft) -> Condition:
    """Weight and density of the flight."""
    return Condition(expected.aircraft.mass.weight_N, expected.rho, expected.aircraft.geometry.wing_area_m2)


def half_widths(found: Covariances, expected: ExpectedAircraft, V: Array) -> Array:
    """Half widths of the 95 % interval of power [%] at speeds V (n,) [m/s]."""
    power, sigma = power_required(V, Polar(expected.A, found.polar), condition(expected))
    return np.asarray(100 * NORMAL_95 * sigma / power)


def _of_difference(found: Covariances) -> Covariances:
    """Of the difference of two flights like this: errors of the installation are the same in both."""
    errors = found.errors.copy()
    same = [SENSOR_ERRORS.index(error) for error in INSTALLATION]
    errors[same] = errors[:, same] = 0.0
    return found._replace(errors=2 * errors, noise=2 * found.noise, fixed=0 * found.fixed)


def _probe_cost(errors: Array) -> float:
    """95 % half widths of offset [0.1 deg], slope [%] and airspeed scale [%], the root of their mean square."""
    i = [SENSOR_ERRORS.index(name) for name in ("alpha_bias", "alpha_scale", "V_scale")]
    sigma = np.sqrt(np.diag(errors)[i]) * np.array([10 * np.degrees(1), 100, 100])
    return float(NORMAL_95 * np.sqrt(np.mean(sigma**2)))
