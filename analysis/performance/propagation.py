"""Propagation of estimated parameters and their covariance through any function, by sigma points.

The function is evaluated at the estimate and at one standard error up and down each principal direction of the
covariance. The standard error is exact where the function is linear, and first order elsewhere. Nothing is drawn at
random, so the same log gives the same results.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.records.flight import Interval
from flightpower.flight.arrays import Array

SigmaPoints = dict[str, Array]  # sigma points (2m + 1, 1) of each parameter, by its name


@dataclass(frozen=True)
class ParameterVector:
    """Parameters by name: values (m,) and their covariance (m, m)."""

    names: tuple[str, ...]
    values: Array
    covariance: Array

    def sigma_points(self) -> SigmaPoints:
        """The sigma points (2m + 1, 1) of each parameter.

        The first is the estimate; m points one standard error up and m points one standard error down each principal
        direction of the covariance follow. Pass results computed from them to `from_sigma_points`, in the same order.
        """
        variance, directions = np.linalg.eigh(self.covariance)
        steps = (directions * np.sqrt(np.maximum(variance, 0.0))).T
        points = np.concatenate([self.values[None], self.values + steps, self.values - steps])
        return {name: points[:, i : i + 1] for i, name in enumerate(self.names)}


def combine_independent(*parts: ParameterVector) -> ParameterVector:
    """Join vectors of parameters into one, in which the parts are uncorrelated with one another."""
    return ParameterVector(
        tuple(name for part in parts for name in part.names),
        np.concatenate([part.values for part in parts]),
        block_diag(*(part.covariance for part in parts)),
    )


def exact(**values: float) -> ParameterVector:
    """Parameters with zero covariance."""
    zero = np.zeros((len(values), len(values)))
    return ParameterVector(tuple(values), np.array(list(values.values()), dtype=float), zero)


class UncertainValue(NamedTuple):
    """A quantity and its standard error, both of the same shape, and NaN where the quantity does not exist."""

    value: Array
    standard_error: Array

    @property
    def lo(self) -> Array:
        """Lower end of the 95 % interval."""
        return self.value - NORMAL_95 * self.standard_error

    @property
    def hi(self) -> Array:
        """Upper end of the 95 % interval."""
        return self.value + NORMAL_95 * self.standard_error

    def at(self, i: int | slice) -> "UncertainValue":
        """Element i, or a slice, of a quantity with shape (k,)."""
        return UncertainValue(self.value[i], self.standard_error[i])

    def interval_if_known(self) -> Interval | None:
        """The 95 % interval of a single value; None where its standard error is not known."""
        if not np.isfinite(self.standard_error):
            return None
        return Interval(value=float(self.value), lo=float(self.lo), hi=float(self.hi))

    def interval(self, least: float = -np.inf) -> Interval:
        """The 95 % interval, or one of zero width if the standard error is unknown. Its lower end is at least `least`,
        unless the value itself is lower."""
        finite_interval = self.interval_if_known()
        value = float(self.value)
        lo, hi = (finite_interval.lo, finite_interval.hi) if finite_interval else (value, value)
        return Interval(value=value, lo=max(lo, min(least, value)), hi=hi)


def from_sigma_points(values: ArrayLike) -> UncertainValue:
    """Value and standard error (…) of a quantity that was computed at the sigma points, as (2m + 1, …)."""
    values = np.asarray(values, dtype=float)
    m = len(values) // 2
    half = (values[1 : m + 1] - values[m + 1 :]) / 2
    return UncertainValue(values[0], np.sqrt(np.sum(half**2, axis=0)))
