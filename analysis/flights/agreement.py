"""Tests whether flights agree: each flight against the others, the homogeneity of all flights, and trends.

The estimates of two flights are correlated, since the same prior pulls on both. For the shared parameters x, each
estimate is v_f - x = a_f e + n_f + sum of c_f: e is the error of the prior's mean, n_f the flight's own error, and c_f
the effect of errors that all flights have in common. Both tests use the covariance of the differences between flights.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from scipy.special import chdtrc, ndtr

from flightpower.analysis.curve import POLAR
from flightpower.analysis.flights.flight_statistics import (
    INSTALLATION_ERRORS,
    POOLED,
    THRUST_CORRECTIONS,
    M,
    PoolFlight,
)
from flightpower.analysis.flights.joint import FlightStack, PooledEstimate, Prior, take, without_each
from flightpower.analysis.flights.pool_settings import POOLING
from flightpower.analysis.records.pool import Trend, TrendQuantity
from flightpower.analysis.results.settings import TRUST
from flightpower.analysis.settings import EVIDENCE
from flightpower.flight.arrays import Array
from flightpower.flight.units import DAY_S

_N_POLAR = len(POLAR)
POLAR_PART, INSTALLATION_PART = slice(_N_POLAR), slice(-len(INSTALLATION_ERRORS), None)
THRUST_PART = slice(_N_POLAR, _N_POLAR + len(THRUST_CORRECTIONS))
_OF_POLAR = np.eye(M)[POLAR_PART]


class Difference(NamedTuple):
    """One flight minus a pool: difference (M,) and its covariance (M, M).

    p, p_installation : probability of a larger difference by chance, in the polar and in the errors of the installation
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

    @property
    def doubtful(self) -> bool:
        """Whether p is low enough to count against pooling the flights; the verdict on a pool uses this level."""
        return self.p < TRUST.false_alarm_rate


class LargestDifference(NamedTuple):
    """A test for a difference at any of several speeds. It uses the difference that is largest in standard errors.

    speed_index : index of that speed     z : the difference at that speed, in its standard errors
    p : probability that the largest difference at any speed is at least as large if nothing differs
    """

    speed_index: int
    z: float
    p: float

    @property
    def differs(self) -> bool:
        """Whether something differs, with at most `EVIDENCE.false_alarms` of false alarms.

        If it differs, the 95 % interval at that speed does not contain zero.
        """
        return self.p < EVIDENCE.false_alarms


class GeneralizedFit(NamedTuple):
    """Generalized least squares: parameters (q,), their covariance (q, q) and the weighted sum of squared residuals."""

    values: Array
    covariance: Array
    chi_square: float


class LikelyCause(NamedTuple):
    """Why a flight differs from others: a `parameter` of POOLED, its difference in SI and in standard deviations."""

    parameter: str
    difference: float
    standard_deviations: float


def differences_in_pool(stack: FlightStack, pool: PooledEstimate) -> list[Difference]:
    """Return each flight minus the pool that it is part of."""
    (W,) = pool.influences
    by_others = np.einsum("fij,fjk,flk->il", W, stack.own_covariance, W, optimize=True)
    # Flight f is itself in the pool, with weight W_f: its errors enter as (1 - W) C (1 - W)' instead of W C W'.
    cross = W @ stack.own_covariance
    own = stack.own_covariance - cross - cross.transpose(0, 2, 1)
    return _differences(
        stack.values - pool.parameters.value,
        by_others + own,
        stack.prior_part - pool.prior_part,
        pool.prior_covariance,
        [change - np.einsum("fij,fj->i", W, change, optimize=True) for change in stack.changes.values()],
    )


def differences_to_others(stack: FlightStack, prior: Prior) -> list[Difference]:
    """Return each flight minus the pool of all others; requires at least two flights."""
    others = without_each(stack, prior)
    return _differences(
        stack.values - others.x,
        stack.own_covariance + others.by_others,
        stack.prior_part - others.prior_part,
        prior.covariance,
        [change - others.changes[name] for name, change in stack.changes.items()],
    )


def _differences(
    values: Array, own: Array, prior_part: Array, prior_covariance: Array, changes: Sequence[Array]
) -> list[Difference]:
    """Return differences from the values (n, M) of n flights, each compared with its own pool.

    own : (n, M, M) covariance from the errors of each single flight     prior_part : (n, M, M) derivative with respect
    to an error of the prior's mean     changes : (n, M) each, from an error that all flights have in common
    """
    covariance = own + prior_part @ prior_covariance @ prior_part.transpose(0, 2, 1)
    for change in changes:
        covariance = covariance + change[:, :, None] * change[:, None, :]
    p, p_installation = (
        chdtrc(values[:, part].shape[1], quadratic_form(values[:, part], covariance[:, part, part])).tolist()
        for part in (POLAR_PART, INSTALLATION_PART)
    )
    return [Difference(*parts) for parts in zip(values, covariance, p, p_installation, strict=True)]


class Compared(Protocol):
    """A flight compared with others. p, p_installation : as in `Difference`; the latter is None without installation"""

    @property
    def p(self) -> float: ...

    @property
    def p_installation(self) -> float | None: ...


One = TypeVar("One", bound=Compared)


def outliers(n: int, compared: Callable[[list[int]], Sequence[One]], false_alarms: float) -> dict[int, One]:
    """Return the flights, by number, that differ from the pool of agreeing flights; the worst is removed first.

    compared: a function that compares each of the numbered flights with the pool of the others. Curve and installation
    are tested, each at the level `false_alarms` over the number of tests. At most half of the flights are returned. For
    two flights the result is empty, since either may be wrong.
    """
    agreeing, differing = list(range(n)), dict[int, One]()
    while len(agreeing) > 2 and 2 * (len(differing) + 1) <= n:
        comparisons = compared(agreeing)
        p = [least_p(comparison) for comparison in comparisons]
        worst = int(np.argmin(p))
        if p[worst] >= outlier_level(comparisons[worst], n, false_alarms):
            break
        differing[agreeing[worst]] = comparisons[worst]
        del agreeing[worst]
    return differing


def least_p(compared: Compared) -> float:
    return compared.p if compared.p_installation is None else min(compared.p, compared.p_installation)


def outlier_level(compared: Compared, flights: int, false_alarms: float) -> float:
    """Return the limit for p in each test, so that any flight falls below it by chance at the rate `false_alarms`."""
    return false_alarms / (flights if compared.p_installation is None else 2 * flights)


def remounted_flights(stack: FlightStack, prior: Prior) -> frozenset[int]:
    """Return the numbers of the flights that contradict a common installation: the outliers, or all flights if there
    are no outliers or the rest still disagree.

    stack: the flights, grouped as their files say
    """
    if len(stack.values) < 2 or not homogeneity(stack, prior, INSTALLATION_PART).differs:
        return frozenset()
    n = len(stack.values)
    level = EVIDENCE.false_alarms / (2 * n)
    differing = outliers(n, lambda some: differences_to_others(take(stack, some), prior), EVIDENCE.false_alarms)
    moved = {i for i, difference in differing.items() if difference.p_installation < level}
    others = [i for i in range(n) if i not in moved]
    if moved and not homogeneity(take(stack, others), prior, INSTALLATION_PART).differs:
        return frozenset(moved)
    return frozenset(range(n))


class ErrorParts(NamedTuple):
    """Errors of n separate estimates of k values: the errors of each flight alone, and the errors that all flights
    share.

    own : (n, k, k) covariance     shared : (n, k, m) changes caused by m independent errors of one standard deviation
    each
    """

    own: Array
    shared: Array

    def whitened(self, columns: Array) -> Array:
        """Multiply the columns (n, k, c) of each flight by the inverse square root of its own covariance.

        A flight that adds nothing to the prior has zero variance of its own, so the rounding error is added to every
        flight.
        """
        k = self.own.shape[1]
        rounding = np.finfo(float).eps * np.sum(self.shared**2, axis=2)
        own = self.own + rounding[:, :, None] * np.eye(k)
        scale = 1 / np.sqrt(np.einsum("fkk->fk", own))
        factor = np.linalg.cholesky(own * scale[:, :, None] * scale[:, None, :])
        return np.linalg.solve(factor, columns * scale[:, :, None])


def error_parts(stack: FlightStack, prior: Prior, projection: Array = _OF_POLAR) -> ErrorParts:
    """Return the error parts of `projection` (k, M) times the parameters of each flight."""
    covariance = prior.covariance
    scale = np.sqrt(np.where(np.diag(covariance) > 0, np.diag(covariance), 1.0))
    eigenvalues, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = scale[:, None] * vectors * np.sqrt(np.maximum(eigenvalues, 0.0))
    shared = [
        projection @ stack.prior_part @ root,
        *((change @ projection.T)[:, :, None] for change in stack.changes.values()),
    ]
    return ErrorParts(projection @ stack.own_covariance @ projection.T, np.concatenate(shared, axis=2))


def least_squares(values: Array, design: Array, errors: ErrorParts) -> GeneralizedFit:
    """Fit values (n, k) with a design (n, k, q) by generalized least squares.

    The shared errors are estimated along with the q parameters, each with its variance as prior. This equals using the
    covariance (n k, n k) of all values (Tapley et al. 2004, sec. 4.5), but its time grows linearly with n.
    """
    n, k, q = design.shape
    m = errors.shared.shape[2]
    columns = np.concatenate([design, errors.shared, values[:, :, None]], axis=2)
    white = errors.whitened(columns).reshape(n * k, q + m + 1)
    A = np.vstack([white[:, :-1], np.eye(q + m)[q:]])
    z = np.concatenate([white[:, -1], np.zeros(m)])
    norm_of_column = np.linalg.norm(A, axis=0)
    Q, R = np.linalg.qr(A / norm_of_column)
    residual = z - Q @ (Q.T @ z)
    inverse = np.linalg.inv(R)
    coefficients = inverse @ (Q.T @ z) / norm_of_column
    covariance = inverse @ inverse.T / np.outer(norm_of_column, norm_of_column)
    return GeneralizedFit(coefficients[:q], covariance[:q, :q], float(residual @ residual))


def homogeneity(stack: FlightStack, prior: Prior, part: slice = POLAR_PART) -> Test:
    """Test whether the flights differ by more than their errors, by generalized least squares on common parameters."""
    return common_values(stack.values[:, part], error_parts(stack, prior, np.eye(M)[part]))


def common_values(values: Array, errors: "ErrorParts", unknown: int = 0) -> Test:
    """Test whether n flights have the same k values (n, k), by generalized least squares.

    unknown: how many of the values are unknown; their errors are so large that these values do not count
    """
    n, k = values.shape
    chi_square = least_squares(values, np.tile(np.eye(k), (n, 1, 1)), errors).chi_square
    return chi_square_test(chi_square, k * (n - 1) - unknown)


def chi_square_test(chi_square: float, degrees_of_freedom: int) -> Test:
    return Test(chi_square, degrees_of_freedom, float(chdtrc(degrees_of_freedom, chi_square)))


def of_difference(value: Array, covariance: Array) -> LargestDifference:
    """Test whether a difference (n,) at several speeds is significant. covariance : (n, n)"""
    z = value / np.sqrt(np.diag(covariance))
    index = int(np.argmax(np.abs(z)))
    return LargestDifference(index, float(z[index]), largest_of_errors(covariance)(abs(float(z[index]))))


def largest_of_errors(covariance: Array) -> Callable[[float], float]:
    """Return a function of z: the probability that any of n normal errors exceeds z standard errors in size.

    covariance : (n, n)
    The errors are a matrix times a vector of independent normal errors. In each direction of that vector the largest
    error grows with the length of the vector, whose square has a chi-square distribution, so only directions are drawn
    (Genz & Bretz 2009, Computation of Multivariate Normal and t Probabilities, sec. 4.1). At 5 % the draws leave an
    error of 0.05 %.
    """
    sigma = np.sqrt(np.diag(covariance))
    eigenvalue, vectors = np.linalg.eigh(covariance / np.outer(sigma, sigma))
    k = int(np.sum(eigenvalue > np.sqrt(np.finfo(float).eps)))
    directions = np.random.default_rng(0).standard_normal((4096, k))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    largest = np.max(np.abs(directions @ (vectors[:, -k:] * np.sqrt(eigenvalue[-k:])).T), axis=1)
    return lambda z: float(np.mean(chdtrc(k, (z / largest) ** 2)))


def likely_cause(difference: Difference) -> LikelyCause | None:
    """Return the correction of thrust or error of the installation that differs most, in standard deviations.

    None if no difference reaches `EVIDENCE.contradiction`.
    """
    z = difference.standardized
    most = max(range(_N_POLAR, M), key=lambda i: abs(z[i]))
    if abs(z[most]) < EVIDENCE.contradiction:
        return None
    return LikelyCause(POOLED[most], float(difference.value[most]), float(abs(z[most])))


def quadratic_form(d: Array, C: Array) -> Array:
    """Return d' C^-1 d for d (..., k) and C (..., k, k)."""
    scale = 1 / np.sqrt(np.diagonal(C, axis1=-2, axis2=-1))
    scaled = d * scale
    solution = np.linalg.solve(C * scale[..., :, None] * scale[..., None, :], scaled[..., None])[..., 0]
    return np.asarray(np.sum(scaled * solution, axis=-1))


def trends(flights: Sequence[PoolFlight], deviations_percent: Array, errors: ErrorParts) -> list[Trend]:
    """Fit the change of power over date, temperature and battery voltage by generalized least squares.

    deviations_percent (n,): deviation of each flight from a common curve; errors: of these deviations (k = 1). Each
    change is from the lowest to the highest value flown. A quantity is left out if fewer than
    `POOLING.fewest_for_trend` flights have it, or if it is the same in all of them.
    """
    trends = []
    for quantity, unit, values in (
        (TrendQuantity.DATE, "days since 1970", [_or_nan(f.start_unix_s) / DAY_S for f in flights]),
        (TrendQuantity.TEMPERATURE, "K", [_or_nan(f.content.air_temperature_K) for f in flights]),
        (TrendQuantity.BATTERY, "V", [_or_nan(f.battery_V) for f in flights]),
    ):
        x = np.array(values)
        finite = np.isfinite(x)
        if finite.sum() < POOLING.fewest_for_trend or np.ptp(x[finite]) < 1e-9 * np.abs(x[finite]).max():
            continue
        X = np.stack([np.ones(finite.sum()), x[finite] - x[finite].mean()], axis=1)
        of_known = ErrorParts(errors.own[finite], errors.shared[finite])
        fit = least_squares(deviations_percent[finite, None], X[:, None, :], of_known)
        (_, slope), (_, error) = fit.values.tolist(), np.sqrt(np.diag(fit.covariance)).tolist()
        lowest, highest = float(x[finite].min()), float(x[finite].max())
        trends.append(
            Trend(
                quantity=quantity,
                unit=unit,
                lowest=lowest,
                highest=highest,
                change_percent=slope * (highest - lowest),
                standard_error_percent=error * (highest - lowest),
                p=float(2 * ndtr(-abs(slope / error))),
                flights=int(finite.sum()),
            )
        )
    return trends


def _or_nan(value: float | None) -> float:
    return float("nan") if value is None else value
