"""The intensity of gusts from the evidence of three intensities.

Two things move the vertex of the parabola through the three away from the true intensity. The process model takes the
gusts of neighboring blocks as values at their centers; means over blocks have smaller increments, two thirds of the
variance where the gusts are much longer than a block, so the likelihood is greatest up to a fifth too low. And minus
the logarithm of the likelihood is no parabola: it rises faster towards low intensities, which moves the vertex up.
Both depend on the noise: where it hides the fast gusts, the slow ones determine the intensity. The expected likelihood
of a Gaussian process by its spectra (Whittle 1953, Ark. Mat. 2, 423) has the same vertex for the true intensity.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.trajectory.dryden import GaussMarkov, SecondOrderGust

Array = NDArray[np.float64]

FREQUENCIES = 256  # of a step's Nyquist band
ALIASES = 4  # multiples of the sampling frequency; means over a step and the gusts' own spectrum attenuate the others
FARTHEST_OCTAVES = 3.0  # between the intensity and the middle of the three


class ObservedGust(NamedTuple):
    """A gust at cruise where the vertical ones have 1 m/s, and the noise of a block mean that shows it [m/s]."""

    gust: GaussMarkov | SecondOrderGust
    noise_mps: float


def vertex(below: float, here: float, above: float) -> float:
    """Of the parabola through three values at -1, 0, 1."""
    return (below - above) / (2 * (below - 2 * here + above))


def intensity_of(found: float, middle_mps: float, observed: Sequence[ObservedGust], step_s: float) -> float:
    """The intensity of vertical gusts [m/s] for which `found` is the expected vertex.

    found : vertex of minus twice the logarithm of the evidence, in octaves from the middle of three intensities
    middle_mps : intensity in the middle; the others are half and twice as large
    """
    from scipy.optimize import brentq  # its import takes longer than all of this

    theta = np.pi * (np.arange(FREQUENCIES) + 0.5) / FREQUENCIES
    # Per measurement and frequency, at the three intensities: model's power (k, n), and means' for 1 m/s (n,).
    spectra = []
    for gust, noise_mps in observed:
        if np.isfinite(noise_mps):
            model = np.multiply.outer(middle_mps**2 * 4.0 ** np.arange(-1, 2), process_spectrum(gust, theta, step_s))
            spectra.append((model + noise_mps**2, block_mean_spectrum(gust, theta, step_s), noise_mps**2))

    def beyond(octaves: float) -> float:
        variance = (middle_mps * 2**octaves) ** 2
        return found - vertex(
            *sum(np.sum(np.log(f) + (variance * means + noise) / f, axis=1) for f, means, noise in spectra)
        )

    if not spectra or beyond(-FARTHEST_OCTAVES) < 0 or beyond(FARTHEST_OCTAVES) > 0:
        return float(middle_mps * 2**found)
    return float(middle_mps * 2 ** brentq(beyond, -FARTHEST_OCTAVES, FARTHEST_OCTAVES, xtol=1e-4))


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
    aliases = theta + 2 * np.pi * np.arange(-ALIASES, ALIASES + 1)[:, None]
    power = gust.power(aliases / step_s) / step_s * np.sinc(aliases / (2 * np.pi)) ** 2
    return np.asarray(power.sum(axis=0))
