"""Measurement noise: its covariance R from the residuals (3.33), whitened residuals, and the likelihood.

R (outputs, outputs) is the covariance of one sample's noise, diagonal or full. With `tail_dof` the noise of each output
follows Student's t distribution instead of the normal one, which gives outliers a small weight; R then holds the
squared scales (Lange, Little & Taylor 1989, J. Am. Stat. Assoc. 84, 881).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.settings import NORMAL_95 as NORMAL_95

NoiseKind = Literal["diagonal", "full"]


@dataclass(frozen=True)
class Whitened:
    """Residuals and output sensitivities divided by the noise (multiplied by the inverse Cholesky factor of R).

    e : (n, outputs) residuals, 0 where a sample is missing
    weight : (n, outputs), 1 for normal noise, small for outliers with t noise
    S : (n, outputs, unknowns) sensitivities, 0 where a sample is missing
    present : (n, outputs), whether the sample exists
    """

    e: Array
    weight: Array
    S: Array
    present: NDArray[np.bool_]


def noise_covariance_of(residuals: Array, scale: Array, structure: NoiseKind, tail_dof: float | None) -> Array:
    """R (outputs, outputs) of the residuals (n, outputs), NaN where missing (3.33).

    scale : (outputs,) rms of the measured outputs; it sets the smallest variance that is returned
    The full R uses only samples with all outputs present.

    Raises InputError when a full R has too few complete samples.
    """
    floor = (1e-9 * scale) ** 2  # smaller residuals are rounding errors
    if structure == "full":
        complete = residuals[np.isfinite(residuals).all(axis=1)]
        if len(complete) <= residuals.shape[1]:
            raise InputError(
                f"a full noise covariance of {residuals.shape[1]} outputs needs more than {residuals.shape[1]} samples"
                f" with all outputs, there are {len(complete)}; use noise='diagonal'"
            )
        R: Array = complete.T @ complete / len(complete)
        R += np.diag(np.maximum(floor - np.diag(R), 0))
        return R
    variance = np.nanmean(residuals**2, axis=0)
    if tail_dof is not None:
        for _ in range(30):  # each gains a digit; maximum-likelihood condition: mean of weight e^2 = 1
            variance = np.maximum(variance, floor)
            weight = (tail_dof + 1) / (tail_dof + residuals**2 / variance)
            variance = np.nanmean(weight * residuals**2, axis=0)
    return np.diag(np.maximum(variance, floor))


def whiten(residuals: Array, S: Array, R: Array, tail_dof: float | None) -> Whitened:
    """Multiply residuals (n, outputs; NaN where missing) and sensitivities by the inverse Cholesky factor of R.

    A sample with missing outputs uses the block of R of the outputs that are present.
    """
    present = np.isfinite(residuals)
    if present.all() and not np.any(R - np.diag(np.diag(R))):
        inverse = 1 / np.sqrt(np.diag(R))
        e = residuals * inverse
        S_white = S * inverse[:, None]
    else:
        e, S_white = _whiten_patterns(residuals, S, R, present)
    weight = np.ones_like(e) if tail_dof is None else (tail_dof + 1) / (tail_dof + e**2)
    return Whitened(e, weight, S_white, present)


def _whiten_patterns(residuals: Array, S: Array, R: Array, present: NDArray[np.bool_]) -> tuple[Array, Array]:
    e, S_white = np.zeros_like(residuals), np.zeros_like(S)
    for pattern, rows in _patterns(present):
        W = np.zeros_like(R)
        W[np.ix_(pattern, pattern)] = np.linalg.inv(np.linalg.cholesky(R[np.ix_(pattern, pattern)]))
        e[rows] = np.nan_to_num(residuals[rows]) @ W.T
        S_white[rows] = W @ S[rows]
    return e, S_white


def negative_log_likelihood(white: Whitened, R: Array, tail_dof: float | None) -> float:
    """-ln L up to a constant: sum over the samples of (e'e + ln det R)/2 (3.32), or its equivalent for t noise."""
    total = 0.0
    for pattern, rows in _patterns(white.present):
        total += rows.sum() * np.linalg.slogdet(R[np.ix_(pattern, pattern)])[1] / 2
    if tail_dof is None:
        return float(total + (white.e**2).sum() / 2)
    return float(total + (tail_dof + 1) / 2 * np.log1p(white.e**2 / tail_dof).sum())


def _patterns(present: NDArray[np.bool_]) -> list[tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
    """Each combination of present outputs (outputs,), with the samples (n,) at which it occurs."""
    if present.all():
        return [(present[0], present[:, 0])]
    return [(pattern, (present == pattern).all(axis=1)) for pattern in np.unique(present, axis=0)]


def information_factor(tail_dof: float | None) -> float:
    """Fisher information of one sample about its mean, relative to R^-1: (dof + 1)/(dof + 3) for t noise, else 1."""
    return 1.0 if tail_dof is None else (tail_dof + 1) / (tail_dof + 3)
