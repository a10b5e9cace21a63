"""Slow vertical gusts of a flight compared with the standard's spectrum: how much longer than assumed gusts are.

The intensity of gusts is found from all their frequencies, most of which are fast. Errors of the angle of attack come
from the slow ones: the mean of a gust over minutes. Their power grows with the scale length (Lenschow, Mann &
Kristensen 1994, J. Atmos. Oceanic Technol. 11, 661), which differs from place to place, and with the shape of the
spectrum. So it is measured: the power of the reconstructed vertical gust at low frequencies over that of the assumed
spectrum. A short flight has few such gusts; the ratio is combined with the user's scale length (`[uncertainty]
gust_length`) as the mean of a normal process' variance is with its conjugate prior (scaled inverse chi-squared).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.trajectory.dryden import SecondOrderGust

Array = NDArray[np.float64]

SLOW = 0.5  # frequency in radians over a gust's time L/V: the spectrum is within 12 % of that at frequency zero
TAPERS = 3  # of the multitaper periodogram, sines (Riedel & Sidorenko 1995, IEEE Trans. Signal Process. 43, 188)
HALF_BANDWIDTH = (TAPERS + 1) / 2  # in units of one over the duration
PRIOR_DEGREES = 8.0  # of freedom of the user's scale length: right within a factor of 1.6, 1 sigma
GUSTS_DOMINATE_MPS = 0.1  # vertical gusts, 1 sigma, that contribute as much as noise to the errors of flow angles


class SlowGusts(NamedTuple):
    """ratio : power of slow vertical gusts over the assumed one     degrees : of freedom of this ratio"""

    ratio: float
    degrees: float

    def length(self, prior: float) -> float:
        """Expected scale length over the standard's, to which slow power is proportional. prior: the user's value."""
        return (self.degrees * self.ratio + PRIOR_DEGREES * prior) / (self.degrees + PRIOR_DEGREES)


def expected_slow_gusts(n: int, step_s: float, assumed: SecondOrderGust) -> SlowGusts:
    """What a flight of n steps would find on average if gusts are as assumed."""
    return SlowGusts(1.0, 2.0 * int(_slow(n, step_s, assumed).sum()))


def slow_gusts(gust_mps: Array, random_errors_mps: Array, step_s: float, assumed: SecondOrderGust) -> SlowGusts:
    """The ratio for a vertical gust (n,) at constant steps, with random errors (k, n) drawn from its distribution.

    assumed: the gust's process at the mean speed and height. The reconstructed gust is smoother than the true one; what
    it lacks is on average the power of its random errors.
    """
    n = len(gust_mps)
    slow = _slow(n, step_s, assumed)
    if not slow.any():
        return SlowGusts(1.0, 0.0)
    tapers = np.sqrt(2 / (n + 1)) * np.sin(np.pi / (n + 1) * np.outer(np.arange(1, TAPERS + 1), np.arange(1, n + 1)))

    def power(values: Array) -> Array:
        spectra = np.fft.rfft(values[..., None, :] * tapers)[..., slow]
        return np.asarray(np.mean(np.abs(spectra) ** 2, axis=-2) * step_s)

    T = float(assumed.time_s)
    x = (2 * np.pi * np.fft.rfftfreq(n, step_s)[slow] * T) ** 2
    expected = float(assumed.sigma_mps) ** 2 * T * (1 + 3 * x) / (1 + x) ** 2  # two-sided, per hertz
    ratio = np.mean((power(gust_mps) + np.mean(power(random_errors_mps), axis=0)) / expected)
    return SlowGusts(float(ratio), 2.0 * int(slow.sum()))


def _slow(n: int, step_s: float, assumed: SecondOrderGust) -> NDArray[np.bool_]:
    """Which frequencies of n steps are those of slow gusts: above the resolution, below SLOW."""
    frequency_Hz = np.fft.rfftfreq(max(n, 1), step_s)
    at_least, at_most = HALF_BANDWIDTH / max(n * step_s, step_s), SLOW / (2 * np.pi * float(assumed.time_s))
    return np.asarray((frequency_Hz >= at_least) & (frequency_Hz <= at_most))


def with_gust_length(covariance: Array, prior_sigma: Array, gust_mps: float, gust_length: float) -> Array:
    """Covariance (m, m) of the sensor errors where gusts are longer or shorter than in the standard's spectrum.

    The variance of the mean of a process over a time much longer than its scale grows with the scale. The data's
    information is divided by as much, the prior's is not. gust_mps : standard deviation of vertical gusts, which share
    the errors with noise
    """
    share = gust_mps**2 / (gust_mps**2 + GUSTS_DOMINATE_MPS**2)
    factor = 1 + (gust_length - 1) * share
    prior = np.diag(prior_sigma**-2.0)
    scaled = np.linalg.inv((np.linalg.inv(covariance) - prior) / factor + prior)
    return np.asarray((scaled + scaled.T) / 2)
