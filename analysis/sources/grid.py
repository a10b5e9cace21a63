"""Fills gaps, fits local polynomials and cubic splines, and finds stretches of a boolean signal.

Local polynomials smooth and differentiate (Savitzky and Golay, Anal. Chem. 36, 1964). They give the same numbers as
`scipy.signal.savgol_filter`, whose import takes half a second and 30 MB for code that is not used here. The cubic
spline has the not-a-knot condition (de Boor, A Practical Guide to Splines, ch. IV) and gives the same numbers as
`scipy.interpolate.CubicSpline`, whose import takes 0.15 s and 20 MB.
"""

from collections.abc import Iterable
from math import factorial

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.linalg import lapack

from flightpower.analysis.sources.grid_settings import CHANNELS, FLIGHT
from flightpower.analysis.sources.recording import Channel
from flightpower.flight.arrays import Array


def without_gaps(values: Array) -> Array:
    """Interpolate NaN in values (n,) linearly; hold the first and the last known value beyond the ends.

    All stay NaN if none is known. `pandas.Series.interpolate(limit_direction="both")` gives the same numbers.
    """
    finite = ~np.isnan(values)
    if finite.all() or not finite.any():
        return values
    rows = np.arange(len(values))
    return np.interp(rows, rows[finite], values[finite])


def rows_within(t_s: Array, stretches_s: Iterable[tuple[float, float]]) -> NDArray[np.bool_]:
    """Return which of the times (n,) lie within one of the stretches, both ends included."""
    rows = np.zeros(len(t_s), dtype=bool)
    for start_s, end_s in stretches_s:
        rows |= (t_s >= start_s) & (t_s <= end_s)
    return rows


def local_quadratic(values: Array, window: int, derivative: int = 0, step: float = 1.0) -> Array:
    """Return the value or derivative (n,) of a quadratic fitted by least squares around each of the values (n,).

    window: odd number of values in a fit, at most n. step: distance between two values. The first half window is
    evaluated from one quadratic fitted to the first window; the last half window likewise.
    """
    half = window // 2
    powers = np.arange(half, half - window, -1.0) ** np.arange(3).reshape(-1, 1)
    wanted = np.zeros(3)
    wanted[derivative] = factorial(derivative) / step**derivative
    weights = linalg.lstsq(powers, wanted)[0]
    fitted = _correlated(values, weights[::-1])
    samples = np.arange(window)
    for part, inside in (
        (slice(None, window), slice(0, half)),
        (slice(len(values) - window, None), slice(-half, None)),
    ):
        edge = np.polyder(np.polyfit(samples, values[part], 2), derivative)
        fitted[part][inside] = np.polyval(edge, samples[inside]) / step**derivative
    return fitted


def _correlated(values: Array, weights: Array) -> Array:
    """Return weighted sums (n,) of the values around each, with an odd number of weights; values beyond the ends are 0.

    The order of operations is that of `scipy.ndimage`, whose import takes 0.06 s.
    """
    half, n = len(weights) // 2, len(values)
    padded = np.concatenate([np.zeros(half), values, np.zeros(half)])
    near = [padded[i : i + n] for i in range(len(weights))]
    for sign in (1, -1):
        if np.abs(weights - sign * weights[::-1])[:half].max() <= np.finfo(float).eps:
            result = weights[half] * values
            for i in range(half):
                result += (near[i] + sign * near[-1 - i]) * weights[i]
            return np.asarray(result)
    result = near[-1] * weights[-1]
    for i in range(len(weights) - 1):
        result += near[i] * weights[i]
    return np.asarray(result)


class CubicSpline:
    """A piecewise cubic through values (n,) or (n, k) at increasing x (n,), with two continuous derivatives."""

    fewest_points = 4  # needed for the not-a-knot condition at both ends

    def __init__(self, x: Array, values: Array):
        """Raises ValueError for fewer than four points, or where x does not increase."""
        x, values = np.asarray(x, dtype=float), np.asarray(values, dtype=float)
        step = np.diff(x)
        if len(x) < self.fewest_points or not (step > 0).all():
            raise ValueError(f"a cubic spline needs {self.fewest_points} points in increasing order")
        self._x = x
        by_point = (-1, *[1] * (values.ndim - 1))
        h = step.reshape(by_point)
        slope = np.diff(values, axis=0) / h
        diagonal, above, below = np.empty(len(x)), np.empty(len(x) - 1), np.empty(len(x) - 1)
        diagonal[1:-1], above[1:], below[:-1] = 2 * (step[:-1] + step[1:]), step[:-1], step[1:]
        right = np.empty_like(values)
        right[1:-1] = 3 * (h[1:] * slope[:-1] + h[:-1] * slope[1:])
        first, last = x[2] - x[0], x[-1] - x[-3]
        diagonal[0], above[0] = step[1], first
        diagonal[-1], below[-1] = step[-2], last
        right[0] = ((step[0] + 2 * first) * step[1] * slope[0] + step[0] ** 2 * slope[1]) / first
        right[-1] = (step[-1] ** 2 * slope[-2] + (2 * last + step[-1]) * step[-2] * slope[-1]) / last
        *_, derivative, _ = lapack.dgtsv(below, diagonal, above, right)
        derivative = derivative.reshape(values.shape)
        excess = (derivative[:-1] + derivative[1:] - 2 * slope) / h
        # Coefficients of the powers 0 to 3 of the distance from the interval's first point.
        self._coefficients = values[:-1], derivative[:-1], (slope - derivative[:-1]) / h - excess, excess / h

    def __call__(self, x: Array, derivative: int = 0) -> Array:
        """Return the value or first derivative at x (m,); beyond the ends, the first and the last cubic continue."""
        interval = np.clip(np.searchsorted(self._x, x, side="right") - 1, 0, len(self._x) - 2)
        constant, linear, square, cubic = (c.take(interval, axis=0) for c in self._coefficients)
        d = (x - self._x[interval]).reshape(-1, *[1] * (constant.ndim - 1))
        if derivative:
            return np.asarray(linear + square * d * 2 + cubic * (d * d) * 3)
        return np.asarray(constant + linear * d + square * (d * d) + cubic * (d * d * d))


def on_grid(t_s: Array, taken_s: Array, value: Array) -> Array:
    """Return values (m,) from times `taken_s` (m,) at `t_s` (n,) by a cubic spline; NaN in gaps and beyond the ends."""
    if len(value) < CubicSpline.fewest_points:
        return np.full_like(t_s, np.nan)
    interval = max(float(np.median(np.diff(taken_s))), t_s[1] - t_s[0])
    after = np.clip(np.searchsorted(taken_s, t_s), 1, len(taken_s) - 1)
    before = after - 1
    bridged = taken_s[after] - taken_s[before] <= CHANNELS.gap * interval
    distance = np.minimum(np.abs(t_s - taken_s[before]), np.abs(taken_s[after] - t_s))
    within = (t_s >= taken_s[0]) & (t_s <= taken_s[-1])
    defined = (bridged & within) | (distance <= 0.01 * interval)
    return np.where(defined, CubicSpline(taken_s, value)(t_s), np.nan)


def stretches(flag: NDArray[np.bool_]) -> list[slice]:
    """Return the slices in which a boolean array (n,) is True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(np.int8)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def resampled(
    channel: Channel, t_s: Array, window_s: float = FLIGHT.smoothing_s, longest_gap_s: float = FLIGHT.longest_gap_s
) -> Array:
    """Return values at t_s (n,), averaged with a Hann window, then interpolated; NaN in gaps and beyond the ends.

    A channel whose interval exceeds two thirds of the window is only interpolated. A gap is at least four intervals.
    """
    if len(channel.t_s) < 2:
        return np.full(len(t_s), np.nan)
    interval = float(np.median(np.diff(channel.t_s)))
    width = round(window_s / interval)
    value = channel.value if width < 2 else smoothed(channel.value, width)
    after = np.clip(np.searchsorted(channel.t_s, t_s), 1, len(channel.t_s) - 1)
    bridged = channel.t_s[after] - channel.t_s[after - 1] <= max(longest_gap_s, 4 * interval)
    within = (t_s >= channel.t_s[0]) & (t_s <= channel.t_s[-1])
    return np.where(bridged & within, Channel(channel.t_s, value).at(t_s), np.nan)


def smoothed(value: Array, width: int) -> Array:
    """Return the centered average (n,) with Hann weights over `width` samples; end values repeat beyond the ends."""
    weights = np.hanning(width + 2)[1:-1]
    padded = np.pad(value, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, weights / weights.sum(), mode="valid")
