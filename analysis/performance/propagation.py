"""Numbers with their covariance, carried through any function: the function is asked again along each direction.

Exact where the function is linear, and to first order elsewhere; no random draws, so the same log gives the same page.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag

from analysis.estimation.intervals import NORMAL_95

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Numbers:
    """Estimates by name with their covariance (m, m)."""

    names: tuple[str, ...]
    values: Array
    covariance: Array

    def nudged(self) -> dict[str, Array]:
        """Each number as (2m + 1, 1): the estimate, then a standard error up and down each direction of the covariance.

        What is computed from them, with the rows left where they are, is what `estimate` takes.
        """
        variance, directions = np.linalg.eigh(self.covariance)
        steps = (directions * np.sqrt(np.maximum(variance, 0.0))).T
        rows = np.concatenate([self.values[None], self.values + steps, self.values - steps])
        return {name: rows[:, i : i + 1] for i, name in enumerate(self.names)}


def joined(*parts: Numbers) -> Numbers:
    """Independent numbers side by side."""
    return Numbers(
        tuple(name for part in parts for name in part.names),
        np.concatenate([part.values for part in parts]),
        block_diag(*(part.covariance for part in parts)),
    )


def known(**values: float) -> Numbers:
    """Numbers without doubt."""
    return Numbers(tuple(values), np.array(list(values.values()), dtype=float), np.zeros((len(values), len(values))))


class Estimate(NamedTuple):
    """A quantity and its standard error, of any shape; NaN where there is none."""

    value: Array
    standard_error: Array

    @property
    def lo(self) -> Array:
        return self.value - NORMAL_95 * self.standard_error

    @property
    def hi(self) -> Array:
        return self.value + NORMAL_95 * self.standard_error


def estimate(rows: ArrayLike) -> Estimate:
    """From a quantity computed of `nudged` numbers, (2m + 1, …), its value and standard error (…)."""
    rows = np.asarray(rows, dtype=float)
    m = len(rows) // 2
    half = (rows[1 : m + 1] - rows[m + 1 :]) / 2
    return Estimate(rows[0], np.sqrt(np.sum(half**2, axis=0)))
