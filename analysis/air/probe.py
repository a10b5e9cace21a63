"""The calibration of a five-port probe: the file `probe.json`, and the flow at the probe from its pressures.

C_alpha = dp_alpha/q_c and C_beta = dp_beta/q_c, with q_c = p_center - p_static, do not depend on speed. A polynomial in
the two gives (qbar/q_c)^2; polynomials in dp_alpha/qbar and dp_beta/qbar give the angles. The reason: the pressure that
the center port loses at an angle appears at the pairs of side ports, so qbar^2 is nearly a sum of squares of the three
pressures. That needs a polynomial of second order; q_c/qbar itself would need eighth order. The coefficients and
all deviations come from the tunnel by weighted least squares; cross-validation chooses the order.
"""

from typing import NamedTuple

import msgspec
import numpy as np
import pandas as pd
from msgspec import structs
from numpy.typing import NDArray

from flightpower.analysis.air.settings import MAP
from flightpower.flight.arrays import Array
from flightpower.flight.files import JsonFormat
from flightpower.flight.probe_maps import FIRST_FORMAT, FORMATS, LEAST_SUM, PolynomialMap

Powers = list[tuple[int, int]]


class FittedMap(PolynomialMap, frozen=True, kw_only=True):
    """A polynomial map that evaluates arrays, with the quality of its fit."""

    residual_rms: float  # cross-validated, points weighted by their noise; for q_c/qbar a fraction of its value
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
    of_x, of_y = np.array(powers).T
    x_to, y_to = (np.vander(values, most.max() + 1, increasing=True) for values, most in ((x, of_x), (y, of_y)))
    return np.asarray(x_to[:, of_x] * y_to[:, of_y])


def fit_map(x: Array, y: Array, target: Array, qbar_Pa: Array, exponent: float = 1.0) -> MapFit:
    """The map of x and y whose order predicts left-out points best; points weighted by their noise.

    x, y, target, qbar_Pa : (n,); noise depends on the dynamic pressure.
    exponent: of a map that is not a plain polynomial; its errors count as fractions of the target.
    """
    sums = target ** (1 / exponent)
    unit = _error_unit(sums, exponent)
    first, _ = _best_order(x, y, sums, _normalized(qbar_Pa) / unit)
    smooth = structs.replace(first, exponent=1.0)(x, y)
    # Take the unit from fitted values: with measured ones, points that happen to be small would get more weight.
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
    """Change of the sum per error of the target; if the map has an exponent, per relative error of the target."""
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
        if X.shape[1] > len(target) / 2:  # at least two points per coefficient
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
        Q_fold = Q[fold == k]
        left_out = np.linalg.solve(np.eye(len(Q_fold)) - Q_fold @ Q_fold.T, residual[fold == k])
        total += float(left_out @ left_out)
    return float(np.sqrt(total / len(y)))


class ProbeCalibration(msgspec.Struct, frozen=True, kw_only=True):
    """The content of `probe.json`."""

    format: str
    source: str
    points: int
    alpha_rad: FittedMap  # over (dp_alpha, dp_beta)/qbar
    beta_rad: FittedMap
    q_ratio: FittedMap  # q_c/qbar, over (C_alpha, C_beta)
    alpha_scale_sigma: float  # relative standard error of alpha's slope over +-10 deg, with errors of tunnel angles
    hull: list[tuple[float, float]]  # corners of the calibrated region in (C_alpha, C_beta)
    # The hull is convex, the measured region is not. So the angles themselves are also limited.
    alpha_limits_rad: tuple[float, float] | None = None
    beta_limits_rad: tuple[float, float] | None = None

    def maps(self, C_alpha: Array, C_beta: Array) -> tuple[Array, Array, Array]:
        """(alpha [rad], beta [rad], q_c/qbar), each (n,)."""
        ratio = self.q_ratio(C_alpha, C_beta)
        per_C = 1.0 if self.format == FIRST_FORMAT else ratio
        x, y = C_alpha * per_C, C_beta * per_C
        return self.alpha_rad(x, y), self.beta_rad(x, y), ratio


PROBE_FILE = JsonFormat(ProbeCalibration, FORMATS, "a probe calibration")


class ProbeFlow(NamedTuple):
    """Flow at the probe; arrays (n,)."""

    qbar_Pa: Array
    alpha_rad: Array
    beta_rad: Array
    inside: NDArray[np.bool_]  # the calibration covers this point
    dalpha_dlndp_alpha_rad: Array  # change of the angle of attack per relative change of dp_alpha
    dlnV_dlndp_alpha: Array  # relative change of airspeed, through q_c/qbar, per relative change of dp_alpha


def flow_at_probe(
    probe: ProbeCalibration, dp_alpha_Pa: Array, dp_beta_Pa: Array, q_c_Pa: Array, samples: int = 1
) -> ProbeFlow:
    """Dynamic pressure and flow angles from the three pressures, (n,); NaN where there is no flow (q_c <= 0).

    The maps are curved, and the mean of a curved function of a noisy number is biased. So they are evaluated at the
    mean of dp_alpha and dp_beta over so many samples, and angles are linear in the deviation from it. `inside` is
    judged by the means: dropping samples that only noise moves out of the calibrated range would lower the angle of
    slow flight.
    """
    q_c = np.where(q_c_Pa > 0, q_c_Pa, np.nan)
    C_alpha, C_beta = (_moving_mean(dp, samples) / q_c for dp in (dp_alpha_Pa, dp_beta_Pa))
    inside = _inside(np.array(probe.hull), C_alpha, C_beta)
    alpha, beta, ratio = probe.maps(C_alpha, C_beta)
    if samples > 1:
        inside &= np.isfinite(dp_alpha_Pa) & np.isfinite(dp_beta_Pa)
        h = 0.02  # of central differences of the angles
        higher, lower = (probe.maps(C_alpha + step, C_beta) for step in (h, -h))
        alpha = alpha + (higher[0] - lower[0]) / (2 * h) * (dp_alpha_Pa / q_c - C_alpha)
        higher, lower = (probe.maps(C_alpha, C_beta + step) for step in (h, -h))
        beta = beta + (higher[1] - lower[1]) / (2 * h) * (dp_beta_Pa / q_c - C_beta)
    for angle, limits in ((alpha, probe.alpha_limits_rad), (beta, probe.beta_limits_rad)):
        if limits is not None:
            inside &= (angle > limits[0] - MAP.angle_margin_rad) & (angle < limits[1] + MAP.angle_margin_rad)
    h = 0.01  # relative step of a central difference; error: a sixth of its square times the third derivative
    less, more = (probe.maps(C_alpha * factor, C_beta) for factor in (1 - h, 1 + h))
    dalpha, _, dratio = ((b - a) / (2 * h) for a, b in zip(less, more, strict=True))
    return ProbeFlow(q_c / ratio, alpha, beta, inside, dalpha, -dratio / (2 * ratio))


def _moving_mean(values: Array, samples: int) -> Array:
    return pd.Series(values).rolling(samples, center=True, min_periods=1).mean().to_numpy()


def _inside(corners: Array, x: Array, y: Array) -> NDArray[np.bool_]:
    """Whether points lie in a convex polygon given counter-clockwise (as ConvexHull gives it)."""
    inside = np.isfinite(x) & np.isfinite(y)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside &= (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) >= 0
    return inside
