"""How the wind changes while an aircraft flies through it: with height, and by turbulence.

Dryden's spectra in the low-altitude form of MIL-F-8785C sec. 3.7.3.4.1, seen from an aircraft at speed V: a length L
takes L/V to pass. Vertical gusts are the standard's second-order process. What they do next must come as a surprise:
an aircraft's speed answers to what they did before, and a process too simple leaves some of that to be foreseen.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

FOOT_M = 0.3048
LOWEST_M, HIGHEST_M = 10 * FOOT_M, 1000 * FOOT_M  # the layer that the low-altitude form holds in
ROUGHNESS_M = 0.15 * FOOT_M  # of open country (sec. 3.7.3.4)


class Wandering(NamedTuple):
    """A first-order Gauss-Markov process: standard deviation about its mean, and the time after which 1/e stays."""

    sigma_mps: float | Array
    time_s: float | Array

    def stays(self, seconds: float) -> Array:
        """What is left after so long of a deviation from the mean, as a fraction."""
        return np.exp(np.asarray(-seconds / self.time_s))


class Heaving(NamedTuple):
    """A step of Dryden's vertical gusts w = w2 + sqrt3 (w1 - w2), where w1 is noise filtered once and w2 twice.

    stays : what is left of w1 and w2 after the step     sigma_once, sigma_twice : of what is new in each [m/s]
    """

    stays: Array
    sigma_once: Array
    sigma_twice: Array


def profile(height_m: ArrayLike) -> Array:
    """Mean wind at heights (n,) above ground [m], up to a factor: logarithmic (sec. 3.7.3.4), held beyond its layer.

    From 20 to 100 m wind grows by a quarter. Country ten times rougher or smoother makes that a third or a fifth.
    """
    return np.log(_in_layer(height_m) / ROUGHNESS_M)


def vertical_step(sigma_w_mps: float, height_m: ArrayLike, V: ArrayLike, step_s: float) -> Heaving:
    """Vertical gusts of intensity sigma_w from one instant to the next, at heights above the ground and speeds V [m/s].

    T w1' = noise - w1, T w2' = w1 - w2: variances sigma^2/2 and sigma^2/4. With w1 taken straight over the step, w2
    misses the noise within it: (step/T)^3/12 of sigma^2.
    """
    d = step_s * np.asarray(V) / _in_layer(height_m)
    return Heaving(np.exp(-d), sigma_w_mps * np.sqrt(-np.expm1(-2 * d) / 2), sigma_w_mps * np.sqrt(d**3 / 12))


def vertical(sigma_w_mps: float, height_m: ArrayLike, V: ArrayLike) -> Wandering:
    """The first-order process that agrees with vertical gusts for slow and for quick changes.

    Spectrum sigma^2 (T/pi) (1 + 3 x^2)/(1 + x^2)^2, x = omega T. Slow changes: sigma^2 T = 2 s^2 t; quick ones:
    3 sigma^2/T = 2 s^2/t. Hence t = T/sqrt3, s^2 = sigma^2 sqrt3/2.
    """
    T = _in_layer(height_m) / np.asarray(V)
    return Wandering(sigma_w_mps * (3**0.5 / 2) ** 0.5, T / 3**0.5)


def horizontal(sigma_w_mps: float, height_m: ArrayLike, V: ArrayLike) -> Wandering:
    """Horizontal gusts that go with vertical ones of sigma_w: L_u = h/s^1.2, sigma_u = sigma_w/s^0.4 (h in feet)."""
    h = _in_layer(height_m)
    shape = 0.177 + 0.000823 * h / FOOT_M
    return Wandering(sigma_w_mps / shape**0.4, h / shape**1.2 / np.asarray(V))


def _in_layer(height_m: ArrayLike) -> Array:
    return np.clip(np.asarray(height_m, dtype=float), LOWEST_M, HIGHEST_M)
