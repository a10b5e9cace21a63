"""Do the flights agree? Each flight against the others, and a test of homogeneity of all.

The estimates of two flights are correlated, since both were drawn to the same prior. For the shared parameters x, each
estimate is v_f - x = a_f e + n_f + sum of c_f: e is the error of the prior's mean, n_f the flight's own error, and c_f
the effect of errors that all flights have in common. Both tests use the covariance of the differences that follows.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from analysis.pooling.flight_statistics import INSTALLATION, POLAR, POOLED, THRUST, M
from analysis.pooling.joint import FlightStack, JointEstimate, Prior, take, without_each
from analysis.trajectory.observability import TITLES

Array = NDArray[np.float64]

OUTLIER_LEVEL = 0.05  # probability of naming any of the flights of a homogeneous pool
CONSPICUOUS = 2.5  # standard deviations of a difference that is named as the likely reason
_N_POLAR = len(POLAR)
POLAR_PART, INSTALLATION_PART = slice(0, _N_POLAR), slice(M - len(INSTALLATION), M)
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
    """One flight minus a pool: difference (M,) and its covariance (M, M).

    p, p_installation : probability of a larger difference of the polar, and of the errors of the installation
    """

    value: Array
    covariance: Array
    p: float
    p_installation: float

    @property
    def standardized(self) -> Array:
        sigma = np.sqrt(np.diag(self.covariance))
        return np.where(sigma > 0, self.value / np.where(sigma > 0, sigma, 1.0), 0.0)


class Test(NamedTuple):
    """A chi-square test."""

    chi_square: float
    degrees_of_freedom: int
    p: float


def differences_in_pool(stack: FlightStack, pool: JointEstimate) -> list[Difference]:
    """Each flight minus the pool that it is part of."""
    (W,) = pool.influences
    by_others = np.einsum("fij,fjk,flk->il", W, stack.own_covariance, W, optimize=True)
    # Of flight f less W_f of the same errors: (1 - W) C (1 - W)' instead of W C W'.
    cross = W @ stack.own_covariance
    own = stack.own_covariance - cross - cross.transpose(0, 2, 1)
    common = {name: np.einsum("fij,fj->i", W, change, optimize=True) for name, change in stack.changes.items()}
    return [
        _difference(
            stack.values[i] - pool.x,
            by_others + own[i],
            stack.prior_part[i] - pool.prior_part,
            pool.prior_covariance,
            [change[i] - common[name] for name, change in stack.changes.items()],
        )
        for i in range(len(stack.values))
    ]


def differences_to_others(stack: FlightStack, prior: Prior) -> list[Difference]:
    """Each flight minus the pool of all others, of two flights or more."""
    others = without_each(stack, prior)
    return [
        _difference(
            stack.values[i] - others.x[i],
            stack.own_covariance[i] + others.by_others[i],
            stack.prior_part[i] - others.prior_part[i],
            prior.covariance,
            [change[i] - others.changes[name][i] for name, change in stack.changes.items()],
        )
        for i in range(len(stack.values))
    ]


def _difference(
    value: Array, own: Array, prior_part: Array, prior_covariance: Array, changes: Sequence[Array]
) -> Difference:
    """Of one flight from a pool.

    own : (M, M) covariance by the errors that each flight has of its own     prior_part : (M, M) derivative by an error
    of the prior's mean     changes : (M,) each, by errors that all flights have in common
    """
    covariance = own + prior_part @ prior_covariance @ prior_part.T
    for change in changes:
        covariance = covariance + np.outer(change, change)
    p, p_installation = (
        float(chdtrc(len(value[part]), quadratic_form(value[part], covariance[part, part])))
        for part in (POLAR_PART, INSTALLATION_PART)
    )
    return Difference(value, covariance, p, p_installation)


def outliers(stack: FlightStack, prior: Prior) -> dict[int, Difference]:
    """By number, flights that differ from the pool of those that agree; the worst is taken out first.

    Polar and installation are tested; the level of each test is OUTLIER_LEVEL over the number of tests. At most half of
    the flights are named, and none of two: which of them is wrong is not known.
    """
    n = len(stack.values)
    inside, found = list(range(n)), dict[int, Difference]()
    while len(inside) > 2 and 2 * (len(found) + 1) <= n:
        differences = differences_to_others(take(stack, inside), prior)
        p = [min(difference.p, difference.p_installation) for difference in differences]
        worst = int(np.argmin(p))
        if p[worst] >= OUTLIER_LEVEL / (2 * n):
            break
        found[inside[worst]] = differences[worst]
        del inside[worst]
    return found


def flights_covariance(stack: FlightStack, pool: JointEstimate, part: slice = POLAR_PART) -> Array:
    """Covariance (k n, k n) of k parameters that each of n flights estimates alone; common errors correlate them."""
    n, k = stack.values[:, part].shape
    a = stack.prior_part[:, part].reshape(n * k, M)
    covariance = a @ pool.prior_covariance @ a.T
    for change in stack.changes.values():
        flat = change[:, part].ravel()
        covariance = covariance + np.outer(flat, flat)
    for i in range(n):
        covariance[k * i : k * (i + 1), k * i : k * (i + 1)] += stack.own_covariance[i, part, part]
    return np.asarray(covariance)


def homogeneity(stack: FlightStack, pool: JointEstimate, part: slice = POLAR_PART) -> Test:
    """Whether the flights differ by more than their errors: generalized least squares on common parameters."""
    n, k = stack.values[:, part].shape
    covariance = flights_covariance(stack, pool, part)
    scale = np.sqrt(np.diag(covariance))
    factor = np.linalg.cholesky(covariance / np.outer(scale, scale))
    z = np.linalg.solve(factor, stack.values[:, part].ravel() / scale)
    X = np.linalg.solve(factor, np.tile(np.eye(k), (n, 1)) / scale[:, None])
    residual = z - X @ np.linalg.lstsq(X, z, rcond=None)[0]
    chi_square = float(residual @ residual)
    degrees_of_freedom = k * (n - 1)
    return Test(chi_square, degrees_of_freedom, float(chdtrc(degrees_of_freedom, chi_square)))


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


def quadratic_form(d: Array, C: Array) -> float:
    """d' C^-1 d."""
    scale = np.sqrt(np.diag(C))
    return float(d / scale @ np.linalg.solve(C / np.outer(scale, scale), d / scale))
