"""Covariance of the energy balance's residuals.

Air rising at w does the work m g w per second, and a gust u along the path changes the kinetic energy relative to the
air by m V u. Both are first-order noise, averaged by the balance's windows. The efficiency is not exactly a function of
its argument; that error is in proportion to the useful power. The balance with the accelerometer has the same motion of
the air with the opposite sign, and the errors of an angle of attack that follows from C_L.
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


def by_air(windows: Windows, mass_kg: float, V_mps: float, sigma_w_mps: float, time_s: float) -> Array:
    """Covariance (n, n) [W^2] by vertical and longitudinal air motion of this size and correlation time."""
    lags = _lags(windows)
    vertical = (mass_kg * g * sigma_w_mps) ** 2 * _at_lags(lags, windows, windows.weight, time_s)
    along = (mass_kg * V_mps * LONGITUDINAL_RATIO * sigma_w_mps) ** 2 * _at_lags(lags, windows, windows.slope, time_s)
    return np.asarray(vertical + along)


def by_efficiency(windows: Windows, useful_W: Array) -> Array:
    """Covariance (n, n) [W^2] by the form of the efficiency."""
    return np.asarray(EFFICIENCY_SHARE**2 * np.outer(useful_W, useful_W) * np.exp(-_lags(windows) / EFFICIENCY_S))


def by_angle(windows: Windows, mass_kg: float, V_mps: Array, sigma_rad: float, time_s: float) -> Array:
    """Covariance (n, n) [W^2] by errors of the angle of attack, at the airspeeds V_mps (n,) of the windows."""
    lift_W = mass_kg * g * V_mps * sigma_rad
    return np.asarray(np.outer(lift_W, lift_W) * _at_lags(_lags(windows), windows, windows.weight, time_s))


def uncorrelated(windows: Windows) -> Array:
    return np.asarray(LEAST_W**2 * np.eye(len(windows.centers_s)))


def of_both(air: Array, of_drag: Array, of_force: Array) -> Array:
    """Covariance (2 n, 2 n) of both balances: the air's motion with opposite signs, and what only one contains."""
    return np.block([[air + of_drag, -air], [-air, air + of_force]])


def _lags(windows: Windows) -> Array:
    return np.asarray(np.abs(windows.centers_s[:, None] - windows.centers_s))


def _at_lags(lags: Array, windows: Windows, weight: Array, time_s: float) -> Array:
    """Covariance of two weighted means of first-order noise of variance 1, whose windows are `lags` apart."""
    step = float(windows.offsets_s[1] - windows.offsets_s[0])
    overlap = np.convolve(weight, weight[::-1])  # sum over the pairs of offsets with one difference
    differences = step * (np.arange(len(overlap)) - len(weight) + 1)
    beyond = np.arange(0.0, windows.offsets_s[-1] * 2 + 6 * time_s + step, step)
    values = np.exp(-np.abs(beyond[:, None] + differences) / time_s) @ overlap
    return np.asarray(np.interp(lags, beyond, values, right=0.0))
