"""Do the flights agree? Each flight against the others, and a test of homogeneity of all.

The estimates of two flights are correlated, since both were drawn to the same prior. For the shared parameters x, each
estimate is v_f - x = a_f e + n_f + sum of c_f: e is the error of the prior's mean, n_f the flight's own error, and c_f
the effect of errors that all flights have in common. Both tests use the covariance of the differences that follows.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from analysis.pooling.flight_statistics import INSTALLATION, POLAR, POOLED, THRUST, FlightStatistics, M
from analysis.pooling.joint import Information, JointEstimate, common_changes, pooled_estimate
from analysis.trajectory.observability import TITLES

Array = NDArray[np.float64]

OUTLIER_LEVEL = 0.05  # probability of naming any of the flights of a homogeneous pool
CONSPICUOUS = 2.5  # standard deviations of a difference that is named as the likely reason
_N_POLAR = len(POLAR)
_REASONS = {
    "alpha_bias": "was the probe or the tray touched?",
    "beta_bias": "was the probe touched?",
    "alpha_scale": "a tube of the probe partly blocked or loose, or another calibration?",
    "V_scale": "a leak or water in the lines of airspeed or static pressure?",
    "air_data_lag": "a tube kinked, exchanged, or with water in it?",
    "thrust_scale": "another or a damaged propeller, or a wrong number of pole pairs?",
    "thrust_slope": "another or a damaged propeller?",
    "thrust_beyond": "another or a damaged propeller?",
}
_THRUST_TITLES = {
    "thrust_scale": "scale of thrust",
    "thrust_slope": "slope of thrust",
    "thrust_beyond": "thrust beyond the propeller's table",
}
_NO_REASON = (
    "no sensor or thrust error stands out: weight, rising or sinking air, or something changed on the aircraft"
    " (surface, gear, flaps)?"
)


class Difference(NamedTuple):
    """One flight less the pool of the others: difference (M,), its covariance (M, M), probability of a larger one."""

    value: Array
    covariance: Array
    p: float

    @property
    def standardized(self) -> Array:
        sigma = np.sqrt(np.diag(self.covariance))
        return np.where(sigma > 0, self.value / np.where(sigma > 0, sigma, 1.0), 0.0)


class Test(NamedTuple):
    """A chi-square test."""

    chi_square: float
    degrees_of_freedom: int
    p: float


def difference_to_pool(flight: FlightStatistics, info: Information, pool: JointEstimate, in_pool: int = -1,
                       informations: Sequence[Information] = (),
                       flights: Sequence[FlightStatistics] = ()) -> Difference:  # fmt: skip
    """The flight's own estimate less the pool.

    in_pool : number of the flight in the pool; -1 where the pool is of other flights
    informations, flights : of the pool
    """
    prior = info.prior_part - pool.prior_part
    covariance = (prior * pool.prior_covariance) @ prior.T
    for i, (W, other) in enumerate(zip(pool.influences, informations, strict=True)):
        own = np.eye(M) - W if i == in_pool else -W
        covariance += own @ other.own_covariance @ own.T
    if in_pool < 0:
        covariance += info.own_covariance
    for name in common_changes([flight, *flights]):
        change = flight.changes.get(name, np.zeros(M)) - np.sum(
            [W @ f.changes.get(name, np.zeros(M)) for W, f in zip(pool.influences, flights, strict=True)], axis=0
        )
        covariance += np.outer(change, change)
    value = flight.values - pool.x
    d, C = value[:_N_POLAR], covariance[:_N_POLAR, :_N_POLAR]
    return Difference(value, covariance, float(chi2.sf(_quadratic(d, C), _N_POLAR)))


def differences_to_others(flights: Sequence[FlightStatistics], informations: Sequence[Information]) -> list[Difference]:
    """Each flight against the pool of all others, of two flights or more."""
    found = []
    for i, (flight, info) in enumerate(zip(flights, informations, strict=True)):
        others, theirs = [*flights[:i], *flights[i + 1 :]], [*informations[:i], *informations[i + 1 :]]
        pool = pooled_estimate(others, theirs)
        found.append(difference_to_pool(flight, info, pool, informations=theirs, flights=others))
    return found


def outliers(flights: Sequence[FlightStatistics], informations: Sequence[Information]) -> dict[int, Difference]:
    """By number, flights that differ from the pool of those that agree; the worst is taken out first.

    The level of each test is OUTLIER_LEVEL over the number of flights. At most half of the flights are named, and none
    of two: which of them is wrong is not known.
    """
    inside, found = list(range(len(flights))), dict[int, Difference]()
    while len(inside) > 2 and 2 * (len(found) + 1) <= len(flights):
        differences = differences_to_others([flights[i] for i in inside], [informations[i] for i in inside])
        worst = min(range(len(inside)), key=lambda j: differences[j].p)
        if differences[worst].p >= OUTLIER_LEVEL / len(flights):
            break
        found[inside[worst]] = differences[worst]
        del inside[worst]
    return found


def polar_covariance(
    flights: Sequence[FlightStatistics], informations: Sequence[Information], pool: JointEstimate
) -> Array:
    """Covariance (3 n, 3 n) of the polars that the n flights estimate alone; common errors make them correlated."""
    k = _N_POLAR
    a = np.concatenate([info.prior_part[:k] for info in informations])
    covariance = np.asarray((a * pool.prior_covariance) @ a.T, dtype=np.float64)
    for name in common_changes(flights):
        change = np.concatenate([flight.changes.get(name, np.zeros(M))[:k] for flight in flights])
        covariance = covariance + np.outer(change, change)
    for i, info in enumerate(informations):
        covariance[k * i : k * (i + 1), k * i : k * (i + 1)] += info.own_covariance[:k, :k]
    return covariance


def homogeneity(flights: Sequence[FlightStatistics], informations: Sequence[Information], pool: JointEstimate) -> Test:
    """Whether the polars of the flights differ by more than their errors: generalized least squares on one polar."""
    n, k = len(flights), _N_POLAR
    covariance = polar_covariance(flights, informations, pool)
    z, X = np.concatenate([flight.values[:k] for flight in flights]), np.tile(np.eye(k), (n, 1))
    scale = np.sqrt(np.diag(covariance))
    factor = np.linalg.cholesky(covariance / np.outer(scale, scale))
    white_z, white_X = np.linalg.solve(factor, z / scale), np.linalg.solve(factor, X / scale[:, None])
    residual = white_z - white_X @ np.linalg.lstsq(white_X, white_z, rcond=None)[0]
    chi_square = float(residual @ residual)
    return Test(chi_square, k * (n - 1), float(chi2.sf(chi_square, k * (n - 1))))


def likely_reason(difference: Difference) -> str:
    """What differs most, apart from the polar, in words."""
    z = difference.standardized
    candidates = [POOLED.index(name) for name in THRUST + INSTALLATION]
    most = max(candidates, key=lambda i: abs(z[i]))
    if abs(z[most]) < CONSPICUOUS:
        return _NO_REASON
    name = POOLED[most]
    title, factor, unit = (_THRUST_TITLES[name], 100.0, "%") if name in _THRUST_TITLES else TITLES[name]
    return (
        f"the {title} differs by {factor * difference.value[most]:+.2g} {unit}, {abs(z[most]):.1f} standard deviations:"
        f" {_REASONS[name]}"
    )


def _quadratic(d: Array, C: Array) -> float:
    scale = np.sqrt(np.diag(C))
    return float(d / scale @ np.linalg.solve(C / np.outer(scale, scale), d / scale))
