"""Inputs that make parameters visible: 3-2-1-1 steps, doublets, and multisines that excite several surfaces at once.

References: Jategaonkar, Flight Vehicle System Identification, 2nd ed., sec. 2.5; Morelli, J. Aircraft 49(1), 2012, 1
(orthogonal phase-optimized multisines); Schroeder, IEEE Trans. Information Theory 16(1), 1970, 85 (phases).
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from analysis.estimation.data import frequencies_of
from flight.errors import InputError

Array = NDArray[np.float64]

PHASE_ITERATIONS = 300


def steps(pattern: tuple[int, ...], unit_s: float, amplitude: float, step_s: float, start_s: float = 1.0) -> Array:
    """(n,) alternating steps; (3, 2, 1, 1) is the 3-2-1-1, (1, 1) a doublet. As long before and after as `start_s`.

    unit_s : duration of 1. Of a doublet about half the period of the mode that is to be excited, of a 3-2-1-1 a third
    amplitude : in the input's unit

    Raises InputError for a unit shorter than a sample.
    """
    if unit_s < step_s:
        raise InputError(f"unit of {unit_s:g} s is shorter than a sample of {step_s:g} s")
    before = np.zeros(round(start_s / step_s))
    edges = np.round(np.cumsum([0, *pattern]) * unit_s / step_s).astype(int)
    signal = np.zeros(edges[-1])
    for i, (a, b) in enumerate(pairwise(edges)):
        signal[a:b] = amplitude if i % 2 == 0 else -amplitude
    return np.concatenate([before, signal, before])


def three_two_one_one(period_s: float, amplitude: float, step_s: float) -> Array:
    """(n,) 3-2-1-1 for a mode of this period: its spectrum is widest about 1/period. See `steps`."""
    return steps((3, 2, 1, 1), period_s / 3, amplitude, step_s)


def doublet(period_s: float, amplitude: float, step_s: float) -> Array:
    """(n,) doublet for a mode of this period. See `steps`."""
    return steps((1, 1), period_s / 2, amplitude, step_s)


class Multisine(NamedTuple):
    """t_s : (n,)     inputs : (n, k)     harmonics_Hz : per input, its own frequencies
    relative_peak_factor : per input, (max - min)/(2 sqrt(2) rms), 1 for a single sine
    """

    t_s: Array
    inputs: Array
    harmonics_Hz: tuple[Array, ...]
    relative_peak_factor: Array


def multisine(
    amplitudes: tuple[float, ...], band_Hz: tuple[float, float], duration_s: float, step_s: float, seed: int = 0
) -> Multisine:
    """Sums of sines for several inputs at once that are orthogonal to each other over the duration.

    Each input has every k-th harmonic of 1/duration within the band. The phases make the peak small for the energy, and
    each input starts and ends at zero.
    amplitudes : (k,) largest deflection of each input, in its unit

    Raises InputError for a band with fewer than two harmonics an input, or above half the sampling rate.
    """
    k = len(amplitudes)
    samples = round(duration_s / step_s)
    available = frequencies_of(band_Hz, samples, step_s)
    if len(available) // k < 2:
        raise InputError(
            f"band {band_Hz[0]:g} to {band_Hz[1]:g} Hz in {duration_s:g} s has {len(available)} harmonics for"
            f" {k} inputs; at least two each are needed"
        )
    t = np.asarray(np.arange(samples + 1) * step_s, dtype=np.float64)
    rng = np.random.default_rng(seed)
    inputs, harmonics, factors = [], [], []
    for i, amplitude in enumerate(amplitudes):
        f = available[i::k]
        signal = _of_small_peak(f, t, rng)
        peak = np.abs(signal).max()
        inputs.append(amplitude * signal / peak)
        harmonics.append(f)
        factors.append(_peak_factor(signal[:-1]))
    return Multisine(t, np.column_stack(inputs), tuple(harmonics), np.array(factors))


def _of_small_peak(f: Array, t: Array, rng: np.random.Generator) -> Array:
    """Sum of sines with Schroeder's phases, improved by a search of the smallest L8 norm; from a zero on.

    The L8 norm approaches the peak and is smooth.
    """
    n = len(f)
    phases = -np.pi * np.arange(n) ** 2 / n + rng.uniform(0, 2 * np.pi)
    base = 2 * np.pi * np.outer(t, f)

    def size(phase: Array) -> tuple[float, Array]:
        x = np.cos(base + phase).sum(axis=1)
        norm = float((x**8).sum())
        return float(np.log(norm)), -(8 * x**7 / norm) @ np.sin(base + phase)

    found = optimize.minimize(size, phases, jac=True, method="L-BFGS-B", options={"maxiter": PHASE_ITERATIONS})
    x = np.cos(base + found.x).sum(axis=1)
    before = int(np.flatnonzero(x[:-1] * x[1:] <= 0)[0])
    zero_s = optimize.brentq(lambda at: float(np.cos(2 * np.pi * f * at + found.x).sum()), t[before], t[before + 1])
    return np.asarray(np.cos(base + found.x + 2 * np.pi * f * zero_s).sum(axis=1))


def _peak_factor(x: Array) -> float:
    return float((x.max() - x.min()) / (2 * np.sqrt(2) * np.sqrt(np.mean(x**2))))
