"""Collinearity: unknowns that the data determine only together.

Reference: Belsley, Kuh & Welsch, Regression Diagnostics, 1980, ch. 3; Klein & Morelli, Aircraft System Identification,
2006, ch. 5. Both are applied to the information matrix, scaled to a unit diagonal, priors included.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Condition index above which, with two variance proportions above LARGE_PROPORTION, Belsley speaks of strong
# collinearity. Standard errors are then larger by about this factor than each unknown's alone would be.
STRONG = 100.0
LARGE_PROPORTION = 0.5


class Collinearity(NamedTuple):
    """One combination of unknowns that is poorly determined.

    condition_index : square root of the largest eigenvalue divided by that of this combination
    names, proportions : unknowns of whose variance more than half comes from this combination, and which part
    """

    condition_index: float
    names: tuple[str, ...]
    proportions: tuple[float, ...]

    def __str__(self) -> str:
        return f"{' and '.join(self.names)} (condition index {self.condition_index:.0f})"


def collinearities(names: tuple[str, ...], information: Array, smallest_index: float = STRONG) -> list[Collinearity]:
    """Combinations with a condition index above `smallest_index`, the worst first.

    information : (m, m) of the unknowns `names`, positive definite
    """
    scale = np.sqrt(np.diag(information))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    parts = vectors**2 / values  # (unknown, eigenvalue): contribution to the variance
    proportions = parts / parts.sum(axis=1, keepdims=True)
    found = []
    for k in np.flatnonzero(values * smallest_index**2 < values[-1]):
        involved = np.flatnonzero(proportions[:, k] > LARGE_PROPORTION)
        if len(involved) > 1:
            found.append(
                Collinearity(
                    float(np.sqrt(values[-1] / values[k])),
                    tuple(names[i] for i in involved),
                    tuple(proportions[involved, k].tolist()),
                )
            )
    return found
