"""Wind along a flight: mean wind profile over height, and gusts.

Dryden's spectra in the low-altitude form of MIL-F-8785C sec. 3.7.3.4.1, seen from an aircraft at speed V: a scale
length L corresponds to the time L/V. Lateral and vertical gusts are the standard's second-order process. A first-order
process is too simple: part of its increments would be predictable from past gusts, the aircraft's speed responds to
past gusts, and sensor errors would be biased.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flightpower.flight.arrays import Array
from flightpower.flight.units import FOOT_M


class GaussMarkov(NamedTuple):
    """A first-order Gauss-Markov process: standard deviation and correlation time."""

    sigma_mps: float | Array
    time_s: float | Array

    def discretize(self, step_s: float) -> tuple[Array, Array]:
        """Decay factor over a step, and standard deviation of the increment [m/s]."""
        decay = np.exp(np.asarray(-step_s / self.time_s))
        return decay, self.sigma_mps * np.sqrt(1 - decay**2)

    def power(self, omega: Array) -> Array:
        """Two-sided power per hertz (n,) [m^2/s] at frequencies omega (n,) [rad/s]."""
        return np.asarray(self.sigma_mps**2 * self.time_s * 2 / (1 + (omega * self.time_s) ** 2))


class SecondOrderGust(NamedTuple):
    """Dryden's lateral or vertical gust, g = g2 + sqrt3 (g1 - g2): g1 is white noise filtered once, g2 filtered twice.

    T g1' = noise - g1, T g2' = g1 - g2: variances sigma^2/2 and sigma^2/4. T = L/V with the standard's L.
    """

    sigma_mps: float | Array
    time_s: float | Array

    def discretize(self, step_s: float) -> tuple[Array, Array, Array]:
        """Decay factor of g1 and g2 over a step; standard deviations of the increments of g1 and of g2 [m/s].

        g1 is assumed linear over the step; g2 gets the noise within it as an increment of variance
        sigma^2 (step/T)^3/12.
        """
        d = np.asarray(step_s / self.time_s)
        return np.exp(-d), self.sigma_mps * np.sqrt(-np.expm1(-2 * d) / 2), self.sigma_mps * np.sqrt(d**3 / 12)

    def power(self, omega: Array) -> Array:
        """Two-sided power per hertz (n,) [m^2/s] at frequencies omega (n,) [rad/s]."""
        x = (omega * self.time_s) ** 2
        return np.asarray(self.sigma_mps**2 * self.time_s * (1 + 3 * x) / (1 + x) ** 2)

    def as_gauss_markov(self) -> GaussMarkov:
        """The first-order process with the same spectrum at low and at high frequencies.

        Spectrum sigma^2 (T/pi) (1 + 3 x^2)/(1 + x^2)^2, x = omega T. Low frequencies: sigma^2 T = 2 s^2 t; high ones:
        3 sigma^2/T = 2 s^2/t. Hence t = T/sqrt3, s^2 = sigma^2 sqrt3/2.
        """
        return GaussMarkov(self.sigma_mps * (3**0.5 / 2) ** 0.5, self.time_s / 3**0.5)


def mean_wind_profile(height_m: ArrayLike) -> Array:
    """Mean wind at heights (n,) above ground [m], up to a factor: logarithmic (sec. 3.7.3.4: roughness of open
    country 0.15 ft), constant outside the layer of `_in_layer`.

    From 20 to 100 m the wind grows by 26 %; over country ten times rougher or smoother, by 43 or 19 %.
    """
    return np.asarray(np.log(_in_layer(height_m) / (0.15 * FOOT_M)))


def longitudinal(sigma_w_mps: float, height_m: ArrayLike, V: ArrayLike) -> GaussMarkov:
    """Longitudinal gusts for vertical gusts of intensity sigma_w: L_u = h/s^1.2, sigma_u = sigma_w/s^0.4 (h in feet),
    at heights above ground [m] and speeds V [m/s]."""
    h = _in_layer(height_m)
    shape = 0.177 + 0.000823 * h / FOOT_M
    return GaussMarkov(sigma_w_mps / shape**0.4, h / shape**1.2 / np.asarray(V))


def lateral(sigma_w_mps: float, height_m: ArrayLike, V: ArrayLike) -> SecondOrderGust:
    """Lateral gusts for vertical gusts of intensity sigma_w; as strong and as long as the longitudinal ones."""
    return SecondOrderGust(*longitudinal(sigma_w_mps, height_m, V))


def vertical(sigma_w_mps: float, height_m: ArrayLike, V: ArrayLike) -> SecondOrderGust:
    """Vertical gusts: L_w = h."""
    return SecondOrderGust(sigma_w_mps, _in_layer(height_m) / np.asarray(V))


def _in_layer(height_m: ArrayLike) -> Array:
    """Limit heights to the range of the low-altitude form: 10 to 1000 ft."""
    return np.asarray(np.clip(np.asarray(height_m, dtype=float), 10 * FOOT_M, 1000 * FOOT_M))
