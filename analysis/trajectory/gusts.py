"""Intensity, scale length and slow power of gusts, from the evidence and from the flight's own spectra.

The intensity follows from the evidence of three intensities. Two things move the vertex of the parabola through the
three away from the true intensity. The process model treats the gusts of neighboring blocks as values at the blocks'
centers; but means over blocks have smaller increments, with two thirds of the variance where gusts are much longer than
a block, so the likelihood peaks at an intensity up to a fifth too low. The negative log likelihood is not a parabola
either: it rises faster towards low intensities, which moves the vertex up. Both depend on the noise: where it hides the
fast gusts, the slow ones determine the intensity. So the intensity is found at which the expected likelihood of a
Gaussian process, computed from its spectra (Whittle 1953, Ark. Mat. 2, 423), has the same vertex.

Scale length and slow power follow from the spectra. The intensity is found from all frequencies of gusts, most of
which are fast. Errors of airspeed and flow angles come from the slow ones, whose mean over minutes is not zero. Their
power grows with the scale length (Lenschow, Mann & Kristensen 1994, J. Atmos. Oceanic Technol. 11, 661), which
differs from place to place, and with the shape of the spectrum. A flight of minutes has few slow gusts, but the
corner of the spectrum, at V/L, shows the scale length too. So Dryden's spectra are fitted to the periodograms of the
reconstructed gusts (Whittle's likelihood): one factor of length for all three axes, with the user's value
(`[uncertainty] gust_length`) as a prior, and an intensity for each axis. Where the corner contradicts the assumed
length, the flight is reconstructed again with the length found.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.trajectory.dryden import GaussMarkov, SecondOrderGust
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.settings import GUSTS
from flightpower.flight.arrays import Array


class ObservedGust(NamedTuple):
    """A gust at cruise, for vertical gusts of 1 m/s, and the noise of the block mean that measures it [m/s]."""

    gust: GaussMarkov | SecondOrderGust
    noise_mps: float


def vertex(below: float, middle: float, above: float) -> float:
    """Vertex of the parabola through three values at -1, 0, 1."""
    return (below - above) / (2 * (below - 2 * middle + above))


def intensity_of(octaves: float, middle_mps: float, observed: Sequence[ObservedGust], step_s: float) -> float:
    """The intensity of vertical gusts [m/s] for which `octaves` is the expected vertex.

    octaves : vertex of minus twice the logarithm of the evidence, in octaves from the middle of three intensities
    middle_mps : intensity in the middle; the others are half and twice as large
    """
    from scipy.optimize import brentq  # importing it takes longer than this whole function

    frequencies, farthest_octaves = 256, 3.0  # number in the Nyquist band; limit of the search either way
    theta = np.pi * (np.arange(frequencies) + 0.5) / frequencies
    # For each measurement, by frequency: power of the model at the three intensities (3, n), power of block means for
    # 1 m/s (n,), and power of the noise.
    spectra = []
    for gust, noise_mps in observed:
        if np.isfinite(noise_mps):
            model = np.multiply.outer(middle_mps**2 * 4.0 ** np.arange(-1, 2), process_spectrum(gust, theta, step_s))
            spectra.append((model + noise_mps**2, block_mean_spectrum(gust, theta, step_s), noise_mps**2))

    def excess(true_octaves: float) -> float:
        variance = (middle_mps * 2**true_octaves) ** 2
        return octaves - vertex(
            *sum(np.sum(np.log(f) + (variance * means + noise) / f, axis=1) for f, means, noise in spectra)
        )

    if not spectra or excess(-farthest_octaves) < 0 or excess(farthest_octaves) > 0:
        return float(middle_mps * 2**octaves)
    return float(middle_mps * 2 ** brentq(excess, -farthest_octaves, farthest_octaves, xtol=1e-4))


def process_spectrum(gust: GaussMarkov | SecondOrderGust, theta: Array, step_s: float) -> Array:
    """Two-sided power per step of the process model's gust at frequencies theta (n,) [rad/step]."""
    shift = np.exp(-1j * theta)
    if isinstance(gust, GaussMarkov):
        decay, increment = gust.discretize(step_s)
        return np.asarray(increment**2 / np.abs(1 - decay * shift) ** 2)
    decay, once, twice = gust.discretize(step_s)
    first = 1 / (1 - decay * shift)
    second = first**2 * (1 - decay) * (1 + shift) / 2
    once_to_gust, twice_to_gust = np.sqrt(3) * first + (1 - np.sqrt(3)) * second, (1 - np.sqrt(3)) * first
    return np.asarray(np.abs(once_to_gust) ** 2 * once**2 + np.abs(twice_to_gust) ** 2 * twice**2)


def block_mean_spectrum(gust: GaussMarkov | SecondOrderGust, theta: Array, step_s: float) -> Array:
    """Two-sided power per step of means over a step of the continuous gust, at theta (n,) [rad/step]."""
    # Four multiples of the sampling frequency are enough: averaging and the gusts' own spectrum attenuate the others.
    aliases = theta + 2 * np.pi * np.arange(-4, 5)[:, None]
    power = gust.power(aliases / step_s) / step_s * np.sinc(aliases / (2 * np.pi)) ** 2
    return np.asarray(power.sum(axis=0))


Gust = GaussMarkov | SecondOrderGust

LENGTHS = GUSTS.lengths


class GustAxis(IntEnum):
    """Order of the gusts' axes in arrays."""

    LONGITUDINAL, LATERAL, VERTICAL = range(3)


# The axis whose slow gusts look like the sensor error. Errors not listed are found from fast motion, gravity and GPS.
GUST_AXIS_OF_ERROR = {
    "alpha_bias": GustAxis.VERTICAL,
    "alpha_scale": GustAxis.VERTICAL,
    "updraft": GustAxis.VERTICAL,
    "dp_alpha_zero": GustAxis.VERTICAL,
    "beta_bias": GustAxis.LATERAL,
    "V_scale": GustAxis.LONGITUDINAL,
    "q_c_zero": GustAxis.LONGITUDINAL,
}


class AxisSpectrum(NamedTuple):
    """Spectrum of one axis' gusts: power (m,) at omega (m,) [rad/s], and the assumed process."""

    power: Array
    omega: Array
    assumed: Gust


class ScaleLength(NamedTuple):
    """Ratio of the gusts' scale length to the assumed one, and the standard deviation of the ratio's logarithm."""

    ratio: float
    log_sigma: float

    @property
    def assumed_length_rejected(self) -> bool:
        """Whether the spectra contradict the assumed length."""
        return abs(float(np.log(self.ratio))) > STATISTICS.sigmas * self.log_sigma


def gust_spectra(
    gusts_mps: Array, random_errors_mps: Array, step_s: float, assumed: Sequence[Gust], band: tuple[float, float]
) -> list[AxisSpectrum]:
    """Multitaper periodograms of gusts (3, n) at constant steps.

    random_errors_mps : (3, k, n) drawn from their distribution. assumed: processes at the mean speed and height.
    band : lowest and highest frequency, in radians over each axis' L/V. The reconstructed gust is smoother than the
    true one; on average it lacks the power of its random errors, which is added.
    """
    n = gusts_mps.shape[1]
    tapers = np.sqrt(2 / (n + 1)) * np.sin(
        np.pi / (n + 1) * np.outer(np.arange(1, GUSTS.tapers + 1), np.arange(1, n + 1))
    )

    def power(values: Array, compared: NDArray[np.bool_]) -> Array:
        spectra = np.fft.rfft(values[..., None, :] * tapers)[..., compared]
        return np.asarray(np.mean(np.abs(spectra) ** 2, axis=-2) * step_s)

    axes = []
    for gust, errors, process in zip(gusts_mps, random_errors_mps, assumed, strict=True):
        compared, omega = _frequencies(n, step_s, process, band)
        of_gust = power(gust, compared) + np.mean(power(errors, compared), axis=0) if compared.any() else omega
        axes.append(AxisSpectrum(of_gust, omega, process))
    return axes


def planned_ratios(n: int, step_s: float, assumed: Sequence[Gust], prior_length: float) -> Array:
    """Return `slow_power_ratios` for a planned flight of n steps, with the assumed spectra as its periodograms."""
    axes = []
    for process in assumed:
        _, omega = _frequencies(n, step_s, process, GUSTS.slow)
        axes.append(AxisSpectrum(process.power(omega), omega, process))
    return slow_power_ratios(axes, prior_length)


def _frequencies(n: int, step_s: float, assumed: Gust, band: tuple[float, float]) -> tuple[NDArray[np.bool_], Array]:
    """Select the frequencies of n steps that are in the band and resolved: return a mask, and the values [rad/s]."""
    omega = 2 * np.pi * np.fft.rfftfreq(max(n, 1), step_s)
    half_bandwidth = (GUSTS.tapers + 1) / 2  # in units of one over the duration
    resolved = 2 * np.pi * half_bandwidth / max(n * step_s, step_s)
    lowest, highest = (limit / float(assumed.time_s) for limit in band)
    compared = np.asarray((omega >= max(resolved, lowest)) & (omega <= highest))
    return compared, np.asarray(omega[compared], dtype=float)


def slow_power_ratios(axes: Sequence[AxisSpectrum], prior_length: float) -> Array:
    """Expected ratio (3,) of the power of slow gusts to the assumed power: posterior mean of the ratio of sigma^2 T.

    axes : `gust_spectra` in the band of slow gusts. prior_length: the user's scale length over the assumed one,
    returned for a flight too short to show another. The intensity of an axis with too few frequencies is as assumed.
    """
    is_known = [len(axis.omega) >= GUSTS.fewest_frequencies for axis in axes]
    if not any(is_known):
        return np.full(len(axes), prior_length)
    posterior = _length_posterior(axes, prior_length)
    intensity = np.ones((len(axes), len(LENGTHS)))
    for i, axis in enumerate(axes):
        if is_known[i]:
            intensity[i] = np.sum(axis.power / _spectra(axis), axis=1) / (len(axis.omega) - 1)
    return np.asarray((intensity * LENGTHS) @ posterior)


def scale_length(axes: Sequence[AxisSpectrum], prior_length: float) -> ScaleLength:
    """The scale length of gusts over the assumed one, by `gust_spectra` in the band GUSTS.around_corner.

    It is unknown (log_sigma infinite) where no axis has GUSTS.fewest_frequencies: the user's length alone cannot reject
    the assumed one.
    """
    if all(len(axis.omega) < GUSTS.fewest_frequencies for axis in axes):
        return ScaleLength(1.0, np.inf)
    posterior, log_length = _length_posterior(axes, prior_length), np.log(LENGTHS)
    mean = float(posterior @ log_length)
    return ScaleLength(float(np.exp(mean)), float(np.sqrt(posterior @ (log_length - mean) ** 2)))


def _length_posterior(axes: Sequence[AxisSpectrum], prior_length: float) -> Array:
    """Probabilities (80,) of LENGTHS, with the intensity of each axis unknown.

    For each length, the ratio of sigma^2 to its assumed value has an inverse gamma distribution with shape m and scale
    A, the sum of power over spectrum; the ratio is integrated out, with a prior that is flat in its logarithm.
    """
    log_posterior = -((np.log(LENGTHS / prior_length) / np.log(GUSTS.length_factor)) ** 2) / 2
    for axis in axes:
        if len(axis.omega) >= GUSTS.fewest_frequencies:
            spectra, m = _spectra(axis), len(axis.omega)
            A = np.sum(axis.power / spectra, axis=1)
            log_posterior = log_posterior - np.sum(np.log(spectra), axis=1) - m * np.log(A)
    posterior = np.exp(log_posterior - log_posterior.max())
    return np.asarray(posterior / np.sum(posterior))


def _spectra(axis: AxisSpectrum) -> Array:
    """Spectra (80, m) at the assumed intensity for each of LENGTHS."""
    assumed = axis.assumed
    return np.stack([assumed._replace(time_s=assumed.time_s * length).power(axis.omega) for length in LENGTHS])


class Estimate(NamedTuple):
    """Estimate of the sensor errors: values (m,) and covariance (m, m)."""

    values: Array
    covariance: Array


def with_slow_power(estimate: Estimate, prior: Estimate, gust_mps: float, ratios: Array) -> Estimate:
    """The estimate of SENSOR_ERRORS if the power of slow gusts is `ratios` (3,) times the power assumed in `estimate`.

    The variance of the mean of a gust over a time much longer than its scale is in proportion to its slow power. So
    where a sensor error looks like such gusts, the standard error from the data alone grows with the root of the ratio.
    The prior then counts for more: the estimate moves towards it.

    gust_mps : standard deviation of vertical gusts; the weaker they are, the more of the standard error is noise
    """
    share = gust_mps**2 / (gust_mps**2 + GUSTS.dominate_mps**2)
    ratio = np.ones(len(SENSOR_ERRORS))
    for name, axis in GUST_AXIS_OF_ERROR.items():
        ratio[SENSOR_ERRORS.index(name)] = ratios[axis]
    factor = np.sqrt(1 + (ratio - 1) * share)
    # The estimate by the data alone is values + offset. What the data do not determine (a millionth of the prior's
    # information keeps it finite) stays undetermined.
    of_prior = np.linalg.inv(prior.covariance)
    of_data = np.linalg.inv(estimate.covariance) - (1 - 1e-6) * of_prior
    offset = np.linalg.solve(of_data, of_prior @ (estimate.values - prior.values))
    of_data = of_data / np.outer(factor, factor)
    covariance = np.linalg.inv(of_data + of_prior)
    values = estimate.values + covariance @ (of_data @ offset - of_prior @ (estimate.values - prior.values))
    return Estimate(values, (covariance + covariance.T) / 2)
