"""The sources of the curve's interval: the variance due to each source, with the total variance as their sum.

Errors that no residual shows are independent of all other errors. Errors of sensors and of thrust were estimated from
one flight and are correlated, so the variance removed by knowing one of them exactly depends on which others are known.
Each error gets the mean of this gain over all orders in which they could become known (Shapley 1953; for variances Owen
2014, SIAM/ASA J. Uncertainty Quantification 2, 245-251). These shares are never negative and add up. Noise of the runs
is the variance that is left when all errors are known.
"""

from collections import defaultdict
from collections.abc import Iterable
from enum import StrEnum
from itertools import combinations
from math import comb

import numpy as np

from flightpower.analysis.curve import POLAR, Condition, polar_part, power_gradient
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods.assumed_values import ASSUMED_VALUES
from flightpower.analysis.methods.consider import JointEstimate
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.methods.rejected_assumptions import Assumption
from flightpower.analysis.uncertain import variances
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array


class Share(StrEnum):
    """Sources of the curve's interval, as named in the report."""

    NOISE = "noise of the runs"
    AIRSPEED = "airspeed"
    ANGLE_OF_ATTACK = "angle of attack"
    ACCELEROMETER = "accelerometer"
    PROPELLER = "thrust of the propeller"
    WEIGHT = "weight"
    DENSITY = "air density"
    UPDRAFT = "updraft"
    TRANSDUCERS = "pressure transducers"
    AIRCRAFT_FILE = "keys missing in the aircraft file"
    POLAR_SHAPE = "shape of the drag polar"
    OTHER_SENSORS = "other sensor errors"
    SHARED = "errors common to all runs"


OF_SENSOR_ERROR = {
    "V_scale": Share.AIRSPEED, "q_c_zero": Share.AIRSPEED,
    "alpha_bias": Share.ANGLE_OF_ATTACK, "alpha_scale": Share.ANGLE_OF_ATTACK,
    "dp_alpha_zero": Share.ANGLE_OF_ATTACK, "alpha_per_g": Share.ANGLE_OF_ATTACK,
    "ax_bias": Share.ACCELEROMETER, "ay_bias": Share.ACCELEROMETER, "az_bias": Share.ACCELEROMETER,
    "updraft": Share.UPDRAFT, "ax_vibration": Share.ACCELEROMETER, "az_vibration": Share.ACCELEROMETER,
    "probe_ahead": Share.AIRCRAFT_FILE, "ax_scale": Share.ACCELEROMETER, "az_scale": Share.ACCELEROMETER,
}  # fmt: skip
OF_CHANGE = {
    covariance.UPDRAFT: Share.UPDRAFT, covariance.WEIGHT: Share.WEIGHT, covariance.DENSITY: Share.DENSITY,
    str(Assumption.THRUST_TABLE): Share.PROPELLER, str(Assumption.MOTOR_SPEED): Share.PROPELLER,
    str(Assumption.PARABOLIC_POLAR): Share.POLAR_SHAPE,
} | {f"{assumed.key} {i}": Share.AIRCRAFT_FILE for i, assumed in enumerate(ASSUMED_VALUES)}  # fmt: skip


def variance_by_source(
    estimate: DynamicEstimate, aircraft: Aircraft, condition: Condition, V: Array
) -> dict[Share, Array]:
    """Variance (n,) of power required [W^2] at true airspeeds V (n,) [m/s] by source, without sources of no effect.

    For a curve from another method than the dynamic one, only noise and errors common to all runs are separated.
    """
    gradient = power_gradient(V, condition)
    if estimate.joint is None:
        noise, shared = (variances(gradient, polar_part(part)) for part in (estimate.noise, estimate.systematic))
        return {Share.NOISE: noise, Share.SHARED: shared}
    joint = estimate.joint
    by_source: dict[Share, Array] = defaultdict(lambda: np.zeros(len(V)))
    polar = joint.parameters.at([joint.names.index(name) for name in POLAR])
    for name, change in polar.shared.items():
        if name == covariance.DENSITY:  # kept for comparing flights; converted to this flight's density here
            change = covariance.at_nominal_density(polar.value + change, aircraft) - polar.value
        by_source[OF_CHANGE.get(name, Share.TRANSDUCERS)] += (gradient @ change) ** 2
    for source, shares in shares_of_correlated(joint, gradient).items():
        by_source[source] += shares
    total = variances(gradient, estimate.polar.covariance)
    by_source[Share.NOISE] = np.maximum(total - np.sum(list(by_source.values()), axis=0), 0.0)
    return {source: by_source[source] for source in Share if np.any(by_source.get(source, 0.0))}


def shares_of_correlated(joint: JointEstimate, gradient: Array) -> dict[Share, Array]:
    """Variance (n,) that belongs to each source among the errors of `joint` other than A0, A1, A2.

    gradient : (n, 3) derivative of a quantity with respect to A0, A1, A2
    """
    members: dict[Share, list[int]] = defaultdict(list)
    k = len(joint.weighting_covariance)
    n = len(POLAR)
    for i, name in enumerate(joint.names[n:], start=n):
        members[Share.PROPELLER if i < k else OF_SENSOR_ERROR.get(name, Share.OTHER_SENSORS)].append(i)

    C = joint.parameters.own
    sigma = np.sqrt(np.diag(C))
    sigma[sigma == 0] = 1.0
    correlation = C / np.outer(sigma, sigma)
    power = gradient * sigma[:n]

    def explained(sources: Iterable[Share]) -> Array:
        """The variance (n,) that would be removed if the errors of these sources were known exactly."""
        rows = [i for source in sources for i in members[source]]
        with_them, own = power @ correlation[:n, rows], correlation[np.ix_(rows, rows)]
        return np.asarray(np.sum(with_them * np.linalg.lstsq(own, with_them.T, rcond=None)[0].T, axis=1))

    every = frozenset(members)
    by_known = {
        frozenset(subset): explained(subset) for n in range(len(every) + 1) for subset in combinations(members, n)
    }
    orders = [1 / (len(every) * comb(len(every) - 1, n)) for n in range(len(every))]
    return {
        source: np.sum(
            [
                orders[len(subset)] * (by_known[subset | {source}] - value)
                for subset, value in by_known.items()
                if source not in subset
            ],
            axis=0,
        )
        for source in members
    }
