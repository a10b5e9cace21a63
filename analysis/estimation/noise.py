"""The measurement noise: its covariance from residuals (3.33), and residuals in its units.

R is the covariance of one sample's noise: diagonal, or full with the outputs' cross terms. With `tail_dof` the noise
of each output is Student's t instead of normal, which gives outliers a small weight; R then holds the squared scales
(Lange, Little & Taylor 1989, J. Am. Stat. Assoc. 84, 881).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flight.errors import InputError

Array = NDArray[np.float64]
Kind = Literal["diagonal", "full"]

SMALLEST_PART = 1e-9  # of an output's rms: residuals below it are rounding, and ln det R would run away
SCALE_STEPS = 30  # fixed-point steps for the scale of t noise; each gains about a digit


@dataclass(frozen=True)
class Whitened:
    """Residuals and sensitivities in units of the noise; zero where a sample is missing.

    e : (n, outputs)      weight : (n, outputs), 1 for normal noise, small for an outlier of t noise
    S : (n, outputs, numbers)     present : (n, outputs)
    """

    e: Array
    weight: Array
    S: Array
    present: NDArray[np.bool_]


def noise_covariance(residuals: Array, scale: Array, kind: Kind, tail_dof: float | None) -> Array:
    """R (outputs, outputs) of the residuals (n, outputs), NaN where missing (3.33).

    scale : (outputs,) rms of the measured outputs, below a billionth of which nothing is believed.
    The full R uses the samples at which no output is missing.
    """
    floor = (SMALLEST_PART * scale) ** 2
    if kind == "full":
        complete = residuals[np.isfinite(residuals).all(axis=1)]
        if len(complete) <= residuals.shape[1]:
            raise InputError(
                f"a full noise covariance of {residuals.shape[1]} outputs needs more samples at which none is missing"
                f" than the {len(complete)} there are; use noise='diagonal'"
            )
        R = complete.T @ complete / len(complete)
        return R + np.diag(np.maximum(floor - np.diag(R), 0))
    variance = np.nanmean(residuals**2, axis=0)
    if tail_dof is not None:
        for _ in range(SCALE_STEPS):  # the likelihood's own equation: mean of weight e^2 = 1
            variance = np.maximum(variance, floor)
            weight = (tail_dof + 1) / (tail_dof + residuals**2 / variance)
            variance = np.nanmean(weight * residuals**2, axis=0)
    return np.diag(np.maximum(variance, floor))


def whiten(residuals: Array, S: Array, R: Array, tail_dof: float | None) -> Whitened:
    """Residuals (n, outputs; NaN where missing) and sensitivities by the inverse Cholesky factor of R.

    A sample with missing outputs is whitened by the block of R of those it has.
    """
    present = np.isfinite(residuals)
    e, S_white = np.zeros_like(residuals), np.zeros_like(S)
    for pattern, rows in _patterns(present):
        W = np.zeros_like(R)
        W[np.ix_(pattern, pattern)] = np.linalg.inv(np.linalg.cholesky(R[np.ix_(pattern, pattern)]))
        e[rows] = np.nan_to_num(residuals[rows]) @ W.T
        S_white[rows] = W @ S[rows]
    weight = np.ones_like(e) if tail_dof is None else (tail_dof + 1) / (tail_dof + e**2)
    return Whitened(e, weight, S_white, present)


def negative_log_likelihood(white: Whitened, R: Array, tail_dof: float | None) -> float:
    """-ln L up to a constant: half of sum e'e plus half of ln det R for every sample (3.32), or its t counterpart."""
    total = 0.0
    for pattern, rows in _patterns(white.present):
        total += rows.sum() * np.linalg.slogdet(R[np.ix_(pattern, pattern)])[1] / 2
    if tail_dof is None:
        return float(total + (white.e**2).sum() / 2)
    return float(total + (tail_dof + 1) / 2 * np.log1p(white.e**2 / tail_dof).sum())


def _patterns(present: NDArray[np.bool_]) -> list[tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
    """Which outputs are there together, and at which samples."""
    if present.all():
        return [(present[0], present[:, 0])]
    return [(pattern, (present == pattern).all(axis=1)) for pattern in np.unique(present, axis=0)]


def information_factor(tail_dof: float | None) -> float:
    """Fisher information of one sample about its mean, in units of R^-1: (dof + 1)/(dof + 3) for t noise."""
    return 1.0 if tail_dof is None else (tail_dof + 1) / (tail_dof + 3)
