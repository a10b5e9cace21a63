"""How the wind changes while an aircraft flies through it: with height, and by turbulence, as first-order processes.

Dryden's spectra in the low-altitude form of MIL-F-8785C sec. 3.7.3.4.1, seen from an aircraft at speed V: a length L
takes L/V to pass. The vertical spectrum, sigma^2 (T/pi) (1 + 3 x^2)/(1 + x^2)^2 with x = omega T, is replaced by the
first-order one that agrees with it both for slow and for quick changes.
"""

from typing import NamedTuple

import numpy as np

FOOT_M = 0.3048
LOWEST_M, HIGHEST_M = 10 * FOOT_M, 1000 * FOOT_M  # the layer that the low-altitude form holds in
ROUGHNESS_M = 0.15 * FOOT_M  # of open country (sec. 3.7.3.4)


class Wandering(NamedTuple):
    """A first-order Gauss-Markov process: standard deviation about its mean, and the time after which 1/e stays."""

    sigma_mps: float
    time_s: float

    def stays(self, seconds: float) -> float:
        """What is left after so long of a deviation from the mean, as a fraction."""
        return float(np.exp(-seconds / self.time_s))


def profile(height_m: np.ndarray) -> np.ndarray:
    """Mean wind at heights (n,) above ground [m], up to a factor: logarithmic (sec. 3.7.3.4), held beyond its layer.

    From 20 to 100 m wind grows by a quarter. Country ten times rougher or smoother makes that a third or a fifth.
    """
    return np.log(np.clip(height_m, LOWEST_M, HIGHEST_M) / ROUGHNESS_M)


def vertical(sigma_w_mps: float, height_m: float, V: float) -> Wandering:
    """Vertical gusts of intensity sigma_w for an aircraft at height above the ground and speed V [m/s].

    Slow changes: sigma^2 T = 2 s^2 t; quick ones: 3 sigma^2/T = 2 s^2/t. Hence t = T/sqrt3, s^2 = sigma^2 sqrt3/2.
    """
    T = float(np.clip(height_m, LOWEST_M, HIGHEST_M)) / V
    return Wandering(sigma_w_mps * (3**0.5 / 2) ** 0.5, T / 3**0.5)


def horizontal(sigma_w_mps: float, height_m: float, V: float) -> Wandering:
    """Horizontal gusts that go with vertical ones of sigma_w: L_u = h/s^1.2, sigma_u = sigma_w/s^0.4 (h in feet)."""
    h_ft = float(np.clip(height_m, LOWEST_M, HIGHEST_M)) / FOOT_M
    shape = 0.177 + 0.000823 * h_ft
    return Wandering(sigma_w_mps / shape**0.4, h_ft * FOOT_M / shape**1.2 / V)
