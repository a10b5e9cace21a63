"""Values together with their errors: errors of their own, and named errors that other values share.

Shared errors do not average out in a mean, but they cancel in a difference. Estimates, curves and pools are such
values, so one line of code handles a value and its errors together.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.arrays import Array
from flightpower.flight.settings import NORMAL_95


@dataclass(frozen=True)
class Uncertain:
    """Values (n,), the covariance (n, n) of their own errors, and the change (n,) that one standard deviation of each
    shared error makes, by name of the error. Errors with different names are independent."""

    value: Array
    own: Array
    shared: Mapping[str, Array] = field(default_factory=dict)

    @property
    def by_shared(self) -> Array:
        """Covariance (n, n) due to the shared errors."""
        changes = np.array(list(self.shared.values())).reshape(-1, len(self.value))
        return np.asarray(changes.T @ changes)

    @property
    def covariance(self) -> Array:
        """Covariance (n, n) due to all errors."""
        return np.asarray(self.own + self.by_shared)

    @property
    def standard_error(self) -> Array:
        """Standard errors (n,) due to all errors."""
        by_shared = sum((np.square(change) for change in self.shared.values()), start=np.zeros(len(self.value)))
        return np.asarray(np.sqrt(np.diag(self.own) + by_shared))

    @property
    def half_width(self) -> Array:
        """Half widths of the 95 % intervals (n,)."""
        return np.asarray(NORMAL_95 * self.standard_error)

    def through(self, J: Array, value: Array | None = None) -> "Uncertain":
        """Propagate the values through a function with derivative J (k, n). value: its result (k,) if not linear"""
        value = J @ self.value if value is None else value
        return Uncertain(value, J @ self.own @ J.T, {name: J @ change for name, change in self.shared.items()})

    def at(self, rows: Sequence[int] | NDArray[np.intp]) -> "Uncertain":
        """Return the values at these indices, with their errors."""
        indices = [int(row) for row in rows]
        shared = {name: change[indices] for name, change in self.shared.items()}
        return Uncertain(self.value[indices], self.own[np.ix_(indices, indices)], shared)

    def minus(self, other: "Uncertain", cancel: bool) -> "Uncertain":
        """Return the difference. cancel: errors with the same name are the same error in both, so they cancel"""
        less = other.through(-np.eye(len(other.value)))
        if not cancel:
            less = Uncertain(less.value, less.own, {f"{name} of the other": less.shared[name] for name in less.shared})
        return total([self, less])


def total(parts: Iterable[Uncertain]) -> Uncertain:
    """Return the sum of independent estimates (n,). Their own errors add as squares, and shared errors with the same
    name add linearly."""
    parts = list(parts)
    names = dict.fromkeys(name for part in parts for name in part.shared)
    zero = np.zeros(len(parts[0].value))
    return Uncertain(
        np.sum([part.value for part in parts], axis=0),
        np.sum([part.own for part in parts], axis=0),
        {name: np.sum([part.shared.get(name, zero) for part in parts], axis=0) for name in names},
    )


def variances(rows: Array, covariance: Array) -> Array:
    """Variances (k,) of the linear combinations in `rows` (k, n) of values with covariance (n, n)."""
    return np.asarray(np.einsum("ki,ij,kj->k", rows, covariance, rows))
