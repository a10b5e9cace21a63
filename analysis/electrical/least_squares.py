"""Nonlinear least squares in a trust region (Moré 1978, The Levenberg-Marquardt Algorithm).

The numbers are those of `scipy.optimize.least_squares` without bounds, whose import takes 0.2 s.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import svd

Array = NDArray[np.float64]

DIFFERENCE = float(np.finfo(float).eps) ** 0.5  # step of the forward differences
SMALLEST_GRADIENT = 1e-8
ROOT_ITERATIONS, ROOT_TOLERANCE = 10, 0.01  # for the damping whose step is as long as the trust region
POOR, GOOD = 0.25, 0.75  # actual over predicted reduction of the cost
EVALUATIONS = 100  # for each parameter, at most


def least_squares(
    residual: Callable[[Array], Array], start: Array, scale: Array, tolerance: float
) -> tuple[Array, Array]:
    """Parameters (m,) that make the sum of squares of `residual` (n,) least, n >= m, and its derivatives (n, m) there.

    scale: (m,) of the parameters. tolerance: relative, of the cost and of the parameters.
    """
    x, f = np.array(start, dtype=float), residual(start)
    J, cost = _derivatives(residual, x, f), 0.5 * np.dot(f, f)
    radius, damping, evaluations = float(np.linalg.norm(x * (1 / scale))) or 1.0, 0.0, 1
    while np.linalg.norm(J.T.dot(f), np.inf) >= SMALLEST_GRADIENT and evaluations < EVALUATIONS * len(x):
        scaled = J * scale
        U, s, Vt = svd(scaled, full_matrices=False)
        reduction, finished = -1.0, False
        while reduction <= 0 and evaluations < EVALUATIONS * len(x) and not finished:
            step, damping = _step(s, U.T.dot(f), Vt.T, radius, damping, len(f))
            along = scaled.dot(step)
            predicted = -(0.5 * np.dot(along, along) + np.dot(step, scale * J.T.dot(f)))
            new = x + scale * step
            f_new = residual(new)
            evaluations += 1
            length = float(np.linalg.norm(step))
            if not np.isfinite(f_new).all():
                radius = POOR * length
                continue
            cost_new = 0.5 * np.dot(f_new, f_new)
            reduction = cost - cost_new
            ratio = reduction / predicted if predicted > 0 else float(predicted == reduction == 0)
            moved = np.linalg.norm(scale * step)
            finished = bool(
                (reduction < tolerance * cost and ratio > POOR) or moved < tolerance * (tolerance + np.linalg.norm(x))
            )
            before = radius
            if ratio < POOR:
                radius = POOR * length
            elif ratio > GOOD and length > 0.95 * radius:
                radius *= 2
            damping *= before / radius
        if reduction > 0:
            x, f, cost = new, f_new, cost_new
            J = _derivatives(residual, x, f)
        if finished:
            break
    return x, J


def _derivatives(residual: Callable[[Array], Array], x: Array, f: Array) -> Array:
    """Forward differences (n, m)."""
    steps = np.where(x >= 0, DIFFERENCE, -DIFFERENCE) * np.maximum(1.0, np.abs(x))
    columns = []
    for i, step in enumerate(steps):
        moved = np.copy(x)
        moved[i] = x[i] + step
        columns.append((residual(moved) - f) / (moved[i] - x[i]))
    return np.array(columns).T


def _step(s: Array, of_residual: Array, V: Array, radius: float, damping: float, n: int) -> tuple[Array, float]:
    """The step that reduces the linearized cost most within the radius, and its damping.

    s, V : singular values and right singular vectors        of_residual : the residuals along the left ones
    damping : of an earlier step, where the search begins
    """
    full_rank = s[-1] > np.finfo(float).eps * n * s[0]
    if full_rank:
        newton = -V.dot(of_residual / s)
        if np.linalg.norm(newton) <= radius:
            return newton, 0.0
    product = s * of_residual

    def excess(damping: float) -> tuple[float, float]:
        """Length of the damped step less the radius, and its derivative."""
        denominator = s**2 + damping
        length = np.linalg.norm(product / denominator)
        return float(length - radius), float(-np.sum(product**2 / denominator**3) / length)

    low, high = 0.0, float(np.linalg.norm(product)) / radius
    if full_rank:
        beyond, slope = excess(0.0)
        low = -beyond / slope
    if not full_rank and damping == 0:
        damping = max(0.001 * high, (low * high) ** 0.5)
    for _ in range(ROOT_ITERATIONS):
        if damping < low or damping > high:
            damping = max(0.001 * high, (low * high) ** 0.5)
        beyond, slope = excess(damping)
        if beyond < 0:
            high = damping
        low = max(low, damping - beyond / slope)
        damping -= (beyond + radius) * (beyond / slope) / radius
        if abs(beyond) < ROOT_TOLERANCE * radius:
            break
    step = -V.dot(product / (s**2 + damping))
    return step * (radius / np.linalg.norm(step)), damping
