"""Polynomials in two variables, fitted by weighted least squares. Their order is chosen by cross-validation."""

from typing import NamedTuple

import msgspec
import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from analysis.airdata.settings import MAP
from flight.probe_maps import LEAST_SUM, PolynomialMap

Array = NDArray[np.float64]
Powers = list[tuple[int, int]]


class FittedMap(PolynomialMap, frozen=True, kw_only=True):
    """A polynomial map with what is known of its fit, evaluated for arrays."""

    residual_rms: float  # cross-validated, points weighted by their noise; of q_c/qbar as a fraction of it
    order: int
    tried_rms: list[float] = msgspec.field(default_factory=list)  # cross-validated, of orders 1, 2, …

    def __call__(self, x: Array, y: Array) -> Array:
        """Values at x and y, both (n,)."""
        sums: Array = terms(x, y, self.powers) @ np.array(self.coefficients)
        return sums if self.exponent == 1 else np.maximum(sums, LEAST_SUM) ** self.exponent


class MapFit(NamedTuple):
    """A fitted map, the covariance of its coefficients (k, k), and the weight of each point (n,)."""

    map: FittedMap
    covariance: Array
    weight: Array


def terms(x: Array, y: Array, powers: Powers) -> Array:
    """x^i y^j for each pair of powers, (n, k)."""
    return np.stack([x**i * y**j for i, j in powers], axis=-1)


def fit_map(x: Array, y: Array, target: Array, qbar_Pa: Array, exponent: float = 1.0) -> MapFit:
    """The map of x and y whose order predicts left-out points best; points weighted by their noise.

    x, y, target, qbar_Pa : (n,); noise depends on the dynamic pressure.
    exponent: of a map that is not a plain polynomial; its errors count as fractions of the target.
    """
    sums = target ** (1 / exponent)
    unit = _error_unit(sums, exponent)
    first, _ = _best_order(x, y, sums, _normalized(qbar_Pa) / unit)
    smooth = structs.replace(first, exponent=1.0)(x, y)
    # Take the unit from fitted values: by measured ones, points that happen to be small would get more weight.
    unit = _error_unit(smooth, exponent)
    weight = _normalized(1 / _noise((sums - smooth) / unit, qbar_Pa)) / unit
    best, covariance = _best_order(x, y, sums, weight)
    return MapFit(structs.replace(best, exponent=exponent), covariance, weight)


def polynomial_of_order(x: Array, y: Array, target: Array, weight: Array, order: int) -> tuple[FittedMap, Array]:
    """The polynomial of an order, and the covariance of its coefficients (k, k).

    The covariance is robust against unequal noise of the points (heteroscedasticity-consistent, HC1).
    """
    powers = _powers(order)
    X = terms(x, y, powers) * weight[:, None]
    coefficients, *_ = np.linalg.lstsq(X, target * weight, rcond=None)
    residual = X @ coefficients - target * weight
    spread = np.linalg.pinv(X) * residual
    covariance = spread @ spread.T * (len(target) / (len(target) - len(powers)))
    rms = float(np.sqrt(np.mean(residual**2)))
    return FittedMap(powers=powers, coefficients=coefficients.tolist(), residual_rms=rms, order=order), covariance


def _powers(order: int) -> Powers:
    return [(i, total - i) for total in range(order + 1) for i in range(total, -1, -1)]


def _error_unit(sums: Array, exponent: float) -> Array:
    """Change of the sum for an error of one: of the target, or of a fraction of it if the map has an exponent."""
    return np.ones_like(sums) if exponent == 1 else np.abs(sums / exponent)


def _normalized(weight: Array) -> Array:
    """Weights with a mean square of one."""
    return np.asarray(weight / np.sqrt(np.mean(weight**2)))


def _noise(residual: Array, qbar_Pa: Array) -> Array:
    """Standard deviation of each point, (n,).

    Two parts: errors of the tunnel's settings, the same at every point, and errors of pressure, constant in pascals.
    Their variances are the maximum-likelihood estimates for normal residuals.
    """
    from scipy.optimize import nnls  # takes 0.2 s to import, which an analysis of a flight does not need

    parts = np.stack([np.ones_like(qbar_Pa), (np.mean(qbar_Pa) / qbar_Pa) ** 2], axis=-1)
    variance: Array = np.full_like(residual, np.mean(residual**2))
    for _ in range(5):
        variance = parts @ nnls(parts / variance[:, None], residual**2 / variance)[0]
    return np.sqrt(variance)


def _best_order(x: Array, y: Array, target: Array, weight: Array) -> tuple[FittedMap, Array]:
    """The polynomial whose order predicts left-out points best, and the covariance of its coefficients."""
    fold = np.random.default_rng(0).permutation(len(target)) % 10  # tenfold cross-validation
    best, best_rms, tried = 0, np.inf, []
    for order in range(1, 10):
        X = terms(x, y, _powers(order)) * weight[:, None]
        if X.shape[1] > len(target) / 2:  # two points a coefficient at least
            break
        rms = _left_out_rms(X, target * weight, fold)
        tried.append(rms)
        if rms < (1 - MAP.least_improvement) * best_rms:
            best, best_rms = order, rms
    fitted, covariance = polynomial_of_order(x, y, target, weight, best)
    return structs.replace(fitted, residual_rms=best_rms, tried_rms=tried), covariance


def _left_out_rms(X: Array, y: Array, fold: NDArray[np.int64]) -> float:
    """Rms error with which the fit to the other folds predicts each fold: residual times inverse of (I - hat matrix).

    This is exact and needs no refitting.
    """
    Q, _ = np.linalg.qr(X)
    residual = y - Q @ (Q.T @ y)
    total = 0.0
    for k in range(fold.max() + 1):
        mine = Q[fold == k]
        left_out = np.linalg.solve(np.eye(len(mine)) - mine @ mine.T, residual[fold == k])
        total += float(left_out @ left_out)
    return float(np.sqrt(total / len(y)))
