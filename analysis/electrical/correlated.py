"""Residuals that are correlated in time: their most likely standard deviation and correlation time."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

Array = NDArray[np.float64]

TOLERANCE = 1e-6  # of the cost and of the parameters, relative
WHITE_SHARE = 0.05  # of the variance, uncorrelated


def correlation(apart_s: Array, time_s: float) -> Array:
    """Correlation matrix of first-order noise at instants `apart_s` (n, n) from each other."""
    return np.asarray((1 - WHITE_SHARE) * np.exp(-apart_s / time_s) + WHITE_SHARE * np.eye(len(apart_s)))


def most_probable(
    residual: Callable[[Array], Array],
    whiten: Array,
    mean: Array,
    sigma: Array,
    start: Array,
    measured: tuple[Array, Array] | None = None,
) -> tuple[Array, Array]:
    """Maximum a posteriori parameters (m,), and the derivative (n + m + k, m) of whitened residuals and priors there.

    residual: of (m,), (n,). whiten: (n, n), the inverse of a root of its covariance. mean, sigma: (m,) of the prior.
    measured: rows (k, m) and values (k,) of combinations that were measured before, in units of their errors.
    """
    rows, values = measured or (np.zeros((0, len(mean))), np.zeros(0))

    from scipy.optimize import least_squares  # takes 0.2 s to import, which other analyses do not need

    def cost(x: Array) -> Array:
        return np.concatenate([whiten @ residual(x), (x - mean) / sigma, rows @ x - values])

    found = least_squares(cost, start, x_scale=sigma, ftol=TOLERANCE, xtol=TOLERANCE)
    return found.x, np.asarray(found.jac)


def most_likely_noise(residual: Array, apart_s: Array, times_s: Sequence[float]) -> tuple[float, float]:
    """Standard deviation and correlation time of greatest likelihood, the latter out of `times_s`."""
    best = (np.inf, 1.0, times_s[0])
    for time_s in times_s:
        factor = np.linalg.cholesky(correlation(apart_s, time_s))
        white = solve_triangular(factor, residual, lower=True, check_finite=False)
        variance = float(np.mean(white**2))
        cost = len(residual) * np.log(variance) + 2 * float(np.sum(np.log(np.diag(factor))))
        best = min(best, (cost, float(np.sqrt(variance)), time_s))
    return best[1], best[2]
