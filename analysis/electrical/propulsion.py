"""Efficiency from battery to propeller thrust for an unknown motor and propeller.

Propellers are alike when efficiency is drawn against V (rho D^2 / P)^(1/3) = J / c_P^(1/3), relative to its maximum:
the APC 10x5E and 12x8E agree with the form below within 0.02 up to the maximum. Beyond it they differ, and so the fall
is a parameter. The unknown diameter and the motor's losses are in the two scales.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RISE_EXPONENT = 2.3


def advance(V: Array, power_W: Array, rho: Array | float) -> Array:
    """V (rho / P)^(1/3), proportional to J / c_P^(1/3) [m^(-2/3)]."""
    return np.asarray(V * np.cbrt(rho / np.maximum(power_W, 1e-3)))


def efficiency(x: Array, maximum: float, x_at_maximum: float, fall: float) -> Array:
    """Thrust times airspeed over the motor's electrical power; zero where the propeller no longer pulls."""
    u = x / x_at_maximum
    rising = 1 - np.abs(1 - np.minimum(u, 1.0)) ** RISE_EXPONENT
    falling = 1 - fall * (np.maximum(u, 1.0) - 1) ** 2
    return np.asarray(maximum * np.maximum(np.where(u < 1, rising, falling), 0.0))


def idling(x: Array, x_at_maximum: float, fall: float) -> Array:
    """How far the propeller idles: 0 where it pulls, 1 where it hardly takes power."""
    zero_thrust = 1 + 1 / np.sqrt(fall)
    return np.asarray(np.clip((x / x_at_maximum - zero_thrust) / zero_thrust, 0.0, 1.0))
