"""Do the flights agree? Each flight against the others, a test of homogeneity of all, and trends.

The estimates of two flights are correlated, since both were drawn to the same prior. For the shared parameters x, each
estimate is v_f - x = a_f e + n_f + sum of c_f: e is the error of the prior's mean, n_f the flight's own error, and c_f
the effect of errors that all flights have in common. Both tests use the covariance of the differences that follows.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc
from scipy.stats import norm

from analysis.pooling.flight_statistics import INSTALLATION_ERRORS, POLAR, POOLED, FlightStatistics, M
from analysis.pooling.joint import FlightStack, PooledEstimate, Prior, take, without_each
from analysis.pooling.results import Trend, TrendQuantity
from analysis.pooling.settings import POOLING
from analysis.settings import EVIDENCE

Array = NDArray[np.float64]

_N_POLAR = len(POLAR)
POLAR_PART, INSTALLATION_PART = slice(_N_POLAR), slice(-len(INSTALLATION_ERRORS), None)


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
    """A chi-square test. p : probability of a larger value if nothing differs"""

    chi_square: float
    degrees_of_freedom: int
    p: float

    @property
    def differs(self) -> bool:
        """Whether something differs, with at most `EVIDENCE.false_alarms` of false alarms."""
        return self.p < EVIDENCE.false_alarms


class LikelyCause(NamedTuple):
    """Why a flight differs from others: `parameter` of POOLED, its difference in SI and in standard deviations."""

    parameter: str
    difference: float
    standard_deviations: float


def differences_in_pool(stack: FlightStack, pool: PooledEstimate) -> list[Difference]:
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

    Polar and installation are tested, each at the level `EVIDENCE.false_alarms` over the number of tests. At most half
    of the flights are named, and none of two: which of them is wrong is not known.
    """
    n = len(stack.values)
    agreeing, differing = list(range(n)), dict[int, Difference]()
    while len(agreeing) > 2 and 2 * (len(differing) + 1) <= n:
        differences = differences_to_others(take(stack, agreeing), prior)
        p = [min(difference.p, difference.p_installation) for difference in differences]
        worst = int(np.argmin(p))
        if p[worst] >= EVIDENCE.false_alarms / (2 * n):
            break
        differing[agreeing[worst]] = differences[worst]
        del agreeing[worst]
    return differing


def mounted_anew(stack: FlightStack, prior: Prior) -> frozenset[int]:
    """Numbers of the flights that deny having one installation: those that differ, or all where the others differ, too.

    stack: of the flights as their files say
    """
    if len(stack.values) < 2 or not homogeneity(stack, prior, INSTALLATION_PART).differs:
        return frozenset()
    n = len(stack.values)
    level = EVIDENCE.false_alarms / (2 * n)
    moved = {i for i, difference in outliers(stack, prior).items() if difference.p_installation < level}
    others = [i for i in range(n) if i not in moved]
    if moved and not homogeneity(take(stack, others), prior, INSTALLATION_PART).differs:
        return frozenset(moved)
    return frozenset(range(n))


def flights_covariance(stack: FlightStack, prior: Prior, part: slice = POLAR_PART) -> Array:
    """Covariance (k n, k n) of k parameters that each of n flights estimates alone; common errors correlate them."""
    n, k = stack.values[:, part].shape
    a = stack.prior_part[:, part].reshape(n * k, M)
    covariance = a @ prior.covariance @ a.T
    for change in stack.changes.values():
        flat = change[:, part].ravel()
        covariance = covariance + np.outer(flat, flat)
    for i in range(n):
        covariance[k * i : k * (i + 1), k * i : k * (i + 1)] += stack.own_covariance[i, part, part]
    return np.asarray(covariance)


def homogeneity(stack: FlightStack, prior: Prior, part: slice = POLAR_PART) -> Test:
    """Whether the flights differ by more than their errors: generalized least squares on common parameters."""
    n, k = stack.values[:, part].shape
    covariance = flights_covariance(stack, prior, part)
    scale = np.sqrt(np.diag(covariance))
    factor = np.linalg.cholesky(covariance / np.outer(scale, scale))
    z = np.linalg.solve(factor, stack.values[:, part].ravel() / scale)
    X = np.linalg.solve(factor, np.tile(np.eye(k), (n, 1)) / scale[:, None])
    residual = z - X @ np.linalg.lstsq(X, z, rcond=None)[0]
    chi_square = float(residual @ residual)
    degrees_of_freedom = k * (n - 1)
    return Test(chi_square, degrees_of_freedom, float(chdtrc(degrees_of_freedom, chi_square)))


def likely_cause(difference: Difference) -> LikelyCause | None:
    """The correction of thrust or error of the installation that differs most, in standard deviations.

    None where none is conspicuous.
    """
    z = difference.standardized
    most = max(range(_N_POLAR, M), key=lambda i: abs(z[i]))
    if abs(z[most]) < EVIDENCE.contradiction:
        return None
    return LikelyCause(POOLED[most], float(difference.value[most]), float(abs(z[most])))


def quadratic_form(d: Array, C: Array) -> float:
    """d' C^-1 d."""
    scale = np.sqrt(np.diag(C))
    return float(d / scale @ np.linalg.solve(C / np.outer(scale, scale), d / scale))


def trends(flights: Sequence[FlightStatistics], deviations_percent: Array, covariance: Array) -> list[Trend]:
    """Change of power over date, temperature and battery voltage, by generalized least squares.

    deviations_percent (n,): of each flight from a common curve, covariance (n, n). The change is that from the lowest
    to the highest value flown. Quantities that fewer than `POOLING.fewest_for_trend` flights have, or that are the same
    in all, are left out.
    """
    found = []
    for quantity, unit, values in (
        (TrendQuantity.DATE, "days since 1970", [_or_nan(f.content.pooling.start_unix_s) / 86400.0 for f in flights]),
        (TrendQuantity.TEMPERATURE, "K", [_or_nan(f.content.air_temperature_K) for f in flights]),
        (TrendQuantity.BATTERY, "V", [_or_nan(f.content.pooling.battery_V) for f in flights]),
    ):
        x = np.array(values)
        known = np.isfinite(x)
        if known.sum() < POOLING.fewest_for_trend or np.ptp(x[known]) < 1e-9 * np.abs(x[known]).max():
            continue
        X = np.stack([np.ones(known.sum()), x[known] - x[known].mean()], axis=1)
        weights = np.linalg.inv(covariance[np.ix_(known, known)])
        C = np.linalg.inv(X.T @ weights @ X)
        slope, error = float((C @ X.T @ weights @ deviations_percent[known])[1]), float(np.sqrt(C[1, 1]))
        lowest, highest = float(x[known].min()), float(x[known].max())
        found.append(
            Trend(
                quantity=quantity,
                unit=unit,
                lowest=lowest,
                highest=highest,
                change_percent=slope * (highest - lowest),
                standard_error_percent=error * (highest - lowest),
                p=float(2 * norm.sf(abs(slope / error))),
                flights=int(known.sum()),
            )
        )
    return found


def _or_nan(value: float | None) -> float:
    return float("nan") if value is None else value
