"""How much more power slow vertical gusts have than assumed: from the spectrum of the flight's own gusts.

The intensity of gusts is found from all their frequencies, most of which are fast. Errors of the angle of attack come
from the slow ones: the mean of a gust over minutes. Their power grows with the scale length (Lenschow, Mann &
Kristensen 1994, J. Atmos. Oceanic Technol. 11, 661), which differs from place to place, and with the shape of the
spectrum. A flight of minutes has few slow gusts, but the corner of the spectrum, at V/L, shows the scale length too. So
Dryden's spectrum of free intensity and length is fitted to the periodogram of the reconstructed gust (Whittle's
likelihood), with the user's scale length (`[uncertainty] gust_length`) as a prior.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.trajectory.dryden import SecondOrderGust

Array = NDArray[np.float64]

FASTEST = 2.0  # frequency in radians over a gust's time L/V, up to which spectra are compared: beyond are fast gusts
TAPERS = 3  # of the multitaper periodogram, sines (Riedel & Sidorenko 1995, IEEE Trans. Signal Process. 43, 188)
HALF_BANDWIDTH = (TAPERS + 1) / 2  # in units of one over the duration
FEWEST_FREQUENCIES = 12  # two minutes at 40 m: fewer tell less than the user
LENGTH_FACTOR = 2.0  # the user's scale length is right within this factor, 1 sigma
LENGTHS = np.geomspace(0.1, 20.0, 80)  # over the standard's, over which the posterior is summed
GUSTS_DOMINATE_MPS = 0.1  # vertical gusts, 1 sigma, that contribute as much as noise to the errors of flow angles


def slow_power_ratio(
    gust_mps: Array, random_errors_mps: Array, step_s: float, assumed: SecondOrderGust, prior_length: float
) -> float:
    """Expected power of slow vertical gusts over the assumed one, for a gust (n,) at constant steps.

    random_errors_mps : (k, n) drawn from their distribution. assumed: the gust's process at the mean speed and height.
    prior_length: scale length over the standard's, returned for a flight too short to show another. The reconstructed
    gust is smoother than the true one; what it lacks is on average the power of its random errors.
    """
    n = len(gust_mps)
    compared, omega = _frequencies(n, step_s, assumed)
    tapers = np.sqrt(2 / (n + 1)) * np.sin(np.pi / (n + 1) * np.outer(np.arange(1, TAPERS + 1), np.arange(1, n + 1)))

    def power(values: Array) -> Array:
        spectra = np.fft.rfft(values[..., None, :] * tapers)[..., compared]
        return np.asarray(np.mean(np.abs(spectra) ** 2, axis=-2) * step_s)

    if len(omega) < FEWEST_FREQUENCIES:
        return prior_length
    return _posterior_mean(power(gust_mps) + np.mean(power(random_errors_mps), axis=0), omega, assumed, prior_length)


def planned_ratio(n: int, step_s: float, assumed: SecondOrderGust, prior_length: float) -> float:
    """`slow_power_ratio` of a flight of n steps in gusts as assumed, whose periodogram is the spectrum."""
    _, omega = _frequencies(n, step_s, assumed)
    if len(omega) < FEWEST_FREQUENCIES:
        return prior_length
    return _posterior_mean(assumed.power(omega), omega, assumed, prior_length)


def _frequencies(n: int, step_s: float, assumed: SecondOrderGust) -> tuple[NDArray[np.bool_], Array]:
    """Which frequencies of n steps are compared, and these [rad/s]: from the resolution to FASTEST."""
    omega = 2 * np.pi * np.fft.rfftfreq(max(n, 1), step_s)
    at_least, at_most = 2 * np.pi * HALF_BANDWIDTH / max(n * step_s, step_s), FASTEST / float(assumed.time_s)
    compared = np.asarray((omega >= at_least) & (omega <= at_most))
    return compared, np.asarray(omega[compared], dtype=float)


def _posterior_mean(power: Array, omega: Array, assumed: SecondOrderGust, prior_length: float) -> float:
    """Mean of the posterior of sigma^2 T over the assumed one. power (m,) at omega (m,) [rad/s].

    For a length, sigma^2 over the assumed one has an inverse gamma distribution with m degrees and the scale A, the sum
    of power over spectrum; it is integrated over (prior flat in its logarithm).
    """
    spectra = np.stack([assumed._replace(time_s=assumed.time_s * length).power(omega) for length in LENGTHS])
    A, m = np.sum(power / spectra, axis=1), len(omega)
    prior = (np.log(LENGTHS / prior_length) / np.log(LENGTH_FACTOR)) ** 2 / 2
    log_posterior = -np.sum(np.log(spectra), axis=1) - m * np.log(A) - prior
    posterior = np.exp(log_posterior - log_posterior.max())
    return float(np.sum(posterior * A / (m - 1) * LENGTHS) / np.sum(posterior))


def with_slow_power(covariance: Array, prior_sigma: Array, gust_mps: float, ratio: float) -> Array:
    """Covariance (m, m) of the sensor errors where the power of slow gusts is `ratio` times that assumed.

    The variance of the mean of a gust over a time much longer than its scale is in proportion to it. The data's
    information is divided by as much, the prior's is not. gust_mps : standard deviation of vertical gusts, which share
    the errors with noise
    """
    share = gust_mps**2 / (gust_mps**2 + GUSTS_DOMINATE_MPS**2)
    factor = 1 + (ratio - 1) * share
    prior = np.diag(prior_sigma**-2.0)
    scaled = np.linalg.inv((np.linalg.inv(covariance) - prior) / factor + prior)
    return np.asarray((scaled + scaled.T) / 2)
