"""Fourier transforms of records within a band of frequencies.

An estimation in the frequency domain uses only the band in which the aircraft moves. Biases, drift and trim lie below
it, structural vibration and most of the noise above it. Within the band the noise is nearly white, so that standard
errors need no correction for color.

Reference: Klein & Morelli, Aircraft System Identification, 2006, ch. 7.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flight.errors import InputError

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Band = tuple[float, float]  # lowest and highest frequency [Hz]


def frequencies_of(band_Hz: Band, samples: int, step_s: float) -> Array:
    """(k,) frequencies [Hz] of the discrete Fourier transform within the band, without zero.

    They are multiples of 1/duration, and the transforms of white noise at them are independent. Raises InputError for
    a band with fewer than two of them or above half the sampling rate.
    """
    low, high = band_Hz
    duration_s = samples * step_s
    first, last = max(1, int(np.ceil(low * duration_s - 1e-9))), int(np.floor(high * duration_s + 1e-9))
    if not 0 <= low < high or 2 * last >= samples:
        raise InputError(
            f"band {low:g} to {high:g} Hz: give two frequencies, the lower first, below half the sampling rate of"
            f" {1 / step_s:g} Hz"
        )
    if last <= first:
        raise InputError(
            f"band {low:g} to {high:g} Hz: a record of {duration_s:.3g} s resolves {1 / duration_s:.2g} Hz only; give a"
            " wider band or a longer record"
        )
    return np.arange(first, last + 1) / duration_s


def band_matrix(band_Hz: Band, samples: int, step_s: float) -> Array:
    """(2k, samples): real and imaginary parts of the discrete Fourier transform within the band.

    Its rows are orthonormal: white noise of variance s has transforms of variance s. Errors as for `frequencies_of`.
    """
    phase = 2 * np.pi * np.outer(frequencies_of(band_Hz, samples, step_s), np.arange(samples) * step_s)
    return np.sqrt(2 / samples) * np.concatenate([np.cos(phase), np.sin(phase)])


def transform(values: ArrayLike, step_s: float, frequencies_Hz: ArrayLike) -> ComplexArray:
    """(k,) finite Fourier transform: the sum of values (n,) times exp(-2 pi j f t) and the step, from t = 0."""
    x = np.asarray(values, dtype=float)
    t = np.arange(len(x)) * step_s
    return np.asarray(np.exp(-2j * np.pi * np.outer(np.asarray(frequencies_Hz), t)) @ x * step_s)
