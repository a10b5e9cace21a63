"""Regression in flight: Fourier transforms that grow with each sample, and least squares on them when asked.

A sample costs one complex multiplication for each regressor and frequency, whatever the length of the record, and no
sample is kept. At the end of a record the estimate is that of the batch.

Reference: Morelli, J. Guidance, Control, and Dynamics 23(5), 2000, 812.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flight.errors import InputError

Array = NDArray[np.float64]


class RecursiveEstimate(NamedTuple):
    """values, standard_errors : (k,) of the coefficients     covariance : (k, k)     noise_variance : of a sample."""

    values: Array
    standard_errors: Array
    covariance: Array
    noise_variance: float


class RecursiveFourierRegression:
    """z = regressors times coefficients, on transforms at fixed frequencies. Biases have no part in it.

    regressors : number k of regressors     frequencies_Hz : (f,), about 0.04 Hz apart over the band of the motion
    step_s : between samples     memory_s : older data lose weight with this time constant; default: none

    Raises InputError for fewer frequencies than half the regressors, or frequencies above half the sampling rate.
    """

    def __init__(self, regressors: int, frequencies_Hz: ArrayLike, step_s: float, memory_s: float = np.inf):
        f = np.atleast_1d(np.asarray(frequencies_Hz, dtype=float))
        if 2 * len(f) <= regressors:
            raise InputError(
                f"{regressors} regressors need more than {regressors // 2} frequencies, there are {len(f)}"
            )
        if not (f > 0).all() or 2 * f.max() * step_s >= 1:
            raise InputError(f"frequencies must lie between 0 and half the sampling rate of {1 / step_s:g} Hz")
        self._turn = np.exp(-2j * np.pi * f * step_s)
        self._decay = np.exp(-step_s / memory_s)
        self._rotation = np.ones(len(f), dtype=complex)
        self._sums = np.zeros((len(f), regressors + 1), dtype=complex)
        self._weight = 0.0  # sum of the squared weights of the samples

    def add(self, regressors: ArrayLike, z: float) -> None:
        """One sample. regressors : (k,)"""
        self._sums *= self._decay
        self._sums += self._rotation[:, None] * np.append(regressors, z)
        self._weight = self._weight * self._decay**2 + 1
        self._rotation *= self._turn

    def estimate(self) -> RecursiveEstimate:
        """Least squares on the transforms so far (Klein & Morelli 2006, sec. 7.2).

        Raises InputError while the data do not determine the coefficients.
        """
        X, Z = self._sums[:, :-1], self._sums[:, -1]
        A = np.concatenate([X.real, X.imag])
        b = np.concatenate([Z.real, Z.imag])
        solution, _, rank, _ = np.linalg.lstsq(A, b, rcond=None)
        if rank < A.shape[1]:
            raise InputError(f"the data so far determine {rank} of {A.shape[1]} coefficients; add more samples")
        residual = b - A @ solution
        variance = float(residual @ residual) / (len(b) - len(solution))
        covariance = variance * np.linalg.inv(A.T @ A)
        # A transform of white noise of variance s has real and imaginary parts of variance s (sum of weights^2)/2.
        return RecursiveEstimate(solution, np.sqrt(np.diag(covariance)), covariance, 2 * variance / self._weight)
