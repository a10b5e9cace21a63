"""Derivatives of the same equations at many instants, stored without those that are always zero, and their products."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from flightpower.flight.arrays import Array


@dataclass(frozen=True)
class SparseJacobian:
    """Derivatives of residuals with respect to variables, at n instants.

    values : (k, n) the derivatives that are not always zero        places : numbers of residual and variable of each
    width : number of variables
    """

    values: Array
    places: Sequence[tuple[int, int]]
    width: int
    chunk: ClassVar[int] = 2048  # instants: the normal equations of a chunk fit in the processor's cache

    @classmethod
    def of(cls, dense: Array) -> "SparseJacobian":
        """Build a Jacobian from all derivatives, (n, residuals, variables)."""
        _, residuals, width = dense.shape
        places = [(i, j) for i in range(residuals) for j in range(width)]
        return cls(np.ascontiguousarray(dense.reshape(len(dense), -1).T), places, width)

    def dense(self) -> Array:
        """All derivatives, (n, residuals, variables)."""
        result = np.zeros((self.values.shape[1], 1 + max(i for i, _ in self.places), self.width))
        for value, (i, j) in zip(self.values, self.places, strict=True):
            result[:, i, j] = value
        return result

    def add_state_products(self, band: Array, n_states: int) -> None:
        """Add the lower triangle of J_x^T J_x; J_x: derivatives with respect to the first `n_states` variables.

        band : (n, columns, ·), the rows of each column from the diagonal on; `columns` is the number of states of an
        instant, and later columns are those of the next instant
        """
        columns = band.shape[1]
        targets = {}
        for (column, row), pairs in self._pairs(n_states, n_states).items():
            if row >= column:
                following, j = divmod(column, columns)
                targets[column, row] = band[following:, j, row - column], pairs
        self._add(targets.values())

    def add_border(self, border: Array, n_states: int) -> None:
        """Add J_x^T J_c; J_c: derivatives with respect to variables after the first `n_states`. border: (m, n, nx)."""
        targets = {}
        for (state, variable), pairs in self._pairs(n_states, self.width).items():
            if variable >= n_states:
                following, j = divmod(state, border.shape[2])
                targets[state, variable] = border[variable - n_states, following:, j], pairs
        self._add(targets.values())

    def add_gradient(self, gradient: Array, residual: Array, n_states: int) -> None:
        """Add J_x^T r of residuals (n, ·). gradient: (n, nx)."""
        n, nx = self.values.shape[1], gradient.shape[1]
        for value, (i, j) in zip(self.values, self.places, strict=True):
            if j < n_states:
                gradient[j // nx : j // nx + n, j % nx] += value * residual[:, i]

    def corner(self, n_states: int) -> Array:
        """Sum over all instants of J_c^T J_c, (m, m)."""
        result = np.zeros((self.width - n_states,) * 2)
        for (row, column), pairs in self._pairs(self.width, self.width).items():
            if min(row, column) >= n_states:
                result[row - n_states, column - n_states] = sum(self.values[a] @ self.values[b] for a, b in pairs)
        return result

    def corner_gradient(self, residual: Array, n_states: int) -> Array:
        """Sum over all instants of J_c^T r, (m,)."""
        result = np.zeros(self.width - n_states)
        for value, (i, j) in zip(self.values, self.places, strict=True):
            if j >= n_states:
                result[j - n_states] += value @ residual[:, i]
        return result

    def _pairs(self, below_first: int, below_second: int) -> dict[tuple[int, int], list[tuple[int, int]]]:
        """For each two variables below these numbers, the pairs of derivatives of residuals that depend on both."""
        of_residual: dict[int, list[tuple[int, int]]] = {}
        for k, (i, j) in enumerate(self.places):
            of_residual.setdefault(i, []).append((k, j))
        pairs: dict[tuple[int, int], list[tuple[int, int]]] = {}
        for columns in of_residual.values():
            for a, first in columns:
                for b, second in columns:
                    if first < below_first and second < below_second:
                        pairs.setdefault((first, second), []).append((a, b))
        return pairs

    def _add(self, targets: Iterable[tuple[Array, list[tuple[int, int]]]]) -> None:
        """Add sums of products of two derivatives, each to an array of n instants or more."""
        targets, n = list(targets), self.values.shape[1]
        for first in range(0, n, self.chunk):
            values = self.values[:, first : first + self.chunk]
            for target, pairs in targets:
                part = target[first : first + values.shape[1]]
                for a, b in pairs:
                    part += values[a] * values[b]
