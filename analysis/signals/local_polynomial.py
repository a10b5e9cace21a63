"""Smoothing and differentiation by local polynomials (Savitzky and Golay, Anal. Chem. 36, 1964).

The numbers are those of `scipy.signal.savgol_filter`, whose import takes half a second and 30 MB for what is not used
here.
"""

from math import factorial

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

Array = NDArray[np.float64]


def local_quadratic(values: Array, window: int, derivative: int = 0, step: float = 1.0) -> Array:
    """The value or derivative of a quadratic fitted by least squares around each of the values (n,), (n,).

    window: odd number of values of a fit, at most n. step: distance of two values. The first and the last half window
    are those of one quadratic each, fitted to the first and to the last window.
    """
    half = window // 2
    powers = np.arange(half, half - window, -1.0) ** np.arange(3).reshape(-1, 1)
    wanted = np.zeros(3)
    wanted[derivative] = factorial(derivative) / step**derivative
    weights = linalg.lstsq(powers, wanted)[0]
    fitted = _correlated(values, weights[::-1])
    at = np.arange(window)
    for part, inside in (
        (slice(None, window), slice(0, half)),
        (slice(len(values) - window, None), slice(-half, None)),
    ):
        edge = np.polyder(np.polyfit(at, values[part], 2), derivative)
        fitted[part][inside] = np.polyval(edge, at[inside]) / step**derivative
    return fitted


def _correlated(values: Array, weights: Array) -> Array:
    """Sums of the values (n,) around each, times an odd number of weights; zero beyond the ends.

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
            return result
    result = near[-1] * weights[-1]
    for i in range(len(weights) - 1):
        result += near[i] * weights[i]
    return result
