"""How the wind changes while an aircraft flies through it: with height, and by turbulence.

Dryden's spectra in the low-altitude form of MIL-F-8785C sec. 3.7.3.4.1, seen from an aircraft at speed V: a length L
takes L/V to pass. Gusts across the flight are the standard's second-order process. What they do next must come as a
surprise: an aircraft's speed answers to what they did before, and a process too simple leaves some of that to be
foreseen.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

FOOT_M = 0.3048
LOWEST_M, HIGHEST_M = 10 * FOOT_M, 1000 * FOOT_M  # the layer that the low-altitude form holds in
ROUGHNESS_M = 0.15 * FOOT_M  # of open country (sec. 3.7.3.4)


class GaussMarkov(NamedTuple):
    """A first-order Gauss-Markov process: standard deviation about its mean, and the time after which 1/e stays."""

    sigma_mps: float | Array
    time_s: float | Array

    def step(self, seconds: float) -> tuple[Array, Array]:
        """What is left after so long of a deviation from the mean, as a fraction; sigma of what is new [m/s]."""
        stays = np.exp(np.asarray(-seconds / self.time_s))
        return stays, self.sigma_mps * np.sqrt(1 - stays**2)


class Swaying(NamedTuple):
    """Dryden's gusts across the flight, g = g2 + sqrt3 (g1 - g2), where g1 is noise filtered once and g2 twice.

    T g1' = noise - g1, T g2' = g1 - g2: variances sigma^2/2 and sigma^2/4. T = L/V with the standard's L.
    """

    sigma_mps: float | Array
    time_s: float | Array

    def step(self, seconds: float) -> tuple[Array, Array, Array]:
        """What is left after so long of g1 and g2; sigma of what is new in g1, and in g2 [m/s].

        With g1 taken straight over the step, g2 misses the noise within it: (step/T)^3/12 of sigma^2.
        """
        d = np.asarray(seconds / self.time_s)
        return np.exp(-d), self.sigma_mps * np.sqrt(-np.expm1(-2 * d) / 2), self.sigma_mps * np.sqrt(d**3 / 12)

    def as_gauss_markov(self) -> GaussMarkov:
        """The first-order process that agrees for slow and for quick changes.

        Spectrum sigma^2 (T/pi) (1 + 3 x^2)/(1 + x^2)^2, x = omega T. Slow changes: sigma^2 T = 2 s^2 t; quick ones:
        3 sigma^2/T = 2 s^2/t. Hence t = T/sqrt3, s^2 = sigma^2 sqrt3/2.
        """
        return GaussMarkov(self.sigma_mps * (3**0.5 / 2) ** 0.5, self.time_s / 3**0.5)


def profile(height_m: ArrayLike) -> Array:
    """Mean wind at heights (n,) above ground [m], up to a factor: logarithmic (sec. 3.7.3.4), held beyond its layer.

    From 20 to 100 m wind grows by a quarter. Country ten times rougher or smoother makes that a third or a fifth.
    """
    return np.log(_in_layer(height_m) / ROUGHNESS_M)


def along(sigma_w_mps: float, height_m: ArrayLike, V: ArrayLike) -> GaussMarkov:
    """Gusts along the flight that go with vertical ones of sigma_w: L_u = h/s^1.2, sigma_u = sigma_w/s^0.4 (h in feet),
    at heights above the ground and speeds V [m/s]."""
    h = _in_layer(height_m)
    shape = 0.177 + 0.000823 * h / FOOT_M
    return GaussMarkov(sigma_w_mps / shape**0.4, h / shape**1.2 / np.asarray(V))


def across(sigma_w_mps: float, height_m: ArrayLike, V: ArrayLike) -> Swaying:
    """Lateral gusts that go with vertical ones of sigma_w: as strong and as long as those along the flight."""
    return Swaying(*along(sigma_w_mps, height_m, V))


def vertical(sigma_w_mps: float, height_m: ArrayLike, V: ArrayLike) -> Swaying:
    """Vertical gusts: L_w = h."""
    return Swaying(sigma_w_mps, _in_layer(height_m) / np.asarray(V))


def _in_layer(height_m: ArrayLike) -> Array:
    return np.clip(np.asarray(height_m, dtype=float), LOWEST_M, HIGHEST_M)
