"""Covariance of the energy balance's residuals.

Air rising at w does the work m g w per second, and a gust u along the path changes the kinetic energy relative to the
air by m V u. Both are first-order noise, averaged by the balance's windows. The efficiency is not exactly a function of
its argument; that error is in proportion to the useful power.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight.units import GRAVITY_MPS2 as g

Array = NDArray[np.float64]

LONGITUDINAL_RATIO = 1.0  # standard deviation of u over that of w
EFFICIENCY_SHARE, EFFICIENCY_S = 0.05, 10.0  # error of the efficiency's form, and how long it lasts
LEAST_W = 1.0  # standard deviation of a window's power, uncorrelated


@dataclass(frozen=True)
class Windows:
    """Windows of one shape. centers_s : (n,)     offsets_s, weight, slope : (k,) weight and its derivative in a window,
    each summing with the step to averages"""

    centers_s: Array
    offsets_s: Array
    weight: Array
    slope: Array


def covariance(
    windows: Windows, mass_kg: float, V_mps: float, useful_W: Array, sigma_w_mps: float, time_s: float
) -> Array:
    """Covariance (n, n) [W^2] of the balance's residuals for vertical air motion of this size and correlation time."""
    lags = np.abs(windows.centers_s[:, None] - windows.centers_s)
    vertical = (mass_kg * g * sigma_w_mps) ** 2 * _at_lags(lags, windows, windows.weight, time_s)
    along = (mass_kg * V_mps * LONGITUDINAL_RATIO * sigma_w_mps) ** 2 * _at_lags(lags, windows, windows.slope, time_s)
    efficiency = EFFICIENCY_SHARE**2 * np.outer(useful_W, useful_W) * np.exp(-lags / EFFICIENCY_S)
    return np.asarray(vertical + along + efficiency + LEAST_W**2 * np.eye(len(useful_W)))


def _at_lags(lags: Array, windows: Windows, weight: Array, time_s: float) -> Array:
    """Covariance of two weighted means of first-order noise of variance 1, whose windows are `lags` apart."""
    step = float(windows.offsets_s[1] - windows.offsets_s[0])
    overlap = np.convolve(weight, weight[::-1])  # sum over the pairs of offsets with one difference
    differences = step * (np.arange(len(overlap)) - len(weight) + 1)
    beyond = np.arange(0.0, windows.offsets_s[-1] * 2 + 6 * time_s + step, step)
    values = np.exp(-np.abs(beyond[:, None] + differences) / time_s) @ overlap
    return np.asarray(np.interp(lags, beyond, values, right=0.0))
