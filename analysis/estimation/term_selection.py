"""Choice of a model's terms: stepwise regression, and multivariate orthogonal functions with predicted square error.

Both choose from candidate regressors, such as alpha, alpha^2 and elevator, those that the measured output needs.

References: Klein & Morelli, Aircraft System Identification, 2006, secs. 5.4 and 5.5; Barron, Predicted Squared Error,
in Self-Organizing Methods in Modeling, 1984; Morelli, J. Aircraft 32(6), 1995, 1366.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError

DEPENDENT = 1e-10  # of a candidate's square: if the chosen terms leave less of it, that is rounding error


class Selection(NamedTuple):
    """The chosen terms of z = constant + sum of coefficient times term.

    names : (k,) in the order in which they were chosen; the constant is always in the model
    coefficients, standard_errors : (k,), for white residuals
    constant, constant_error : the constant and its standard error
    R2 : share of the variance of z that the terms explain
    predicted_square_error : mean square of the error expected on other data, in the square of z's unit
    """

    names: tuple[str, ...]
    coefficients: Array
    standard_errors: Array
    constant: float
    constant_error: float
    R2: float
    predicted_square_error: float

    def predict(self, candidates: Mapping[str, ArrayLike]) -> Array:
        """z (n,) for the candidates (n,) by name."""
        terms = [
            coefficient * np.asarray(candidates[n])
            for n, coefficient in zip(self.names, self.coefficients, strict=True)
        ]
        return np.asarray(self.constant + sum(terms, np.zeros(1)))


def stepwise(candidates: Mapping[str, ArrayLike], z: ArrayLike, *, level: float = 0.01) -> Selection:
    """Terms enter in the order of their partial correlation with z, and leave again when others replace them.

    candidates : name to (n,)     z : (n,)
    level : level of the F test at which terms enter, divided by the number of candidates (Bonferroni); terms leave at
    twice that level

    Raises InputError for arrays of different lengths, values that are not finite, or fewer samples than candidates.
    """
    names, X, z = _checked(candidates, z)
    n, m = X.shape
    chosen: list[int] = []
    seen = {frozenset(chosen)}
    while True:
        F = _partial_F(X, z, chosen)
        dof = n - len(chosen) - 2
        best = int(np.argmax(F))
        if F[best] <= special.fdtri(1, dof, 1 - level / m):
            break
        chosen.append(best)
        while len(chosen) > 1:
            leaving = np.array([_partial_F(X, z, [j for j in chosen if j != i])[i] for i in chosen])
            worst = int(np.argmin(leaving))
            if leaving[worst] >= special.fdtri(1, dof, 1 - 2 * level / m):
                break
            del chosen[worst]
        if frozenset(chosen) in seen or len(chosen) == m:
            break
        seen.add(frozenset(chosen))
    return _fitted(names, X, z, chosen)


def orthogonal_functions(
    candidates: Mapping[str, ArrayLike], z: ArrayLike, *, largest_noise_variance: float | None = None
) -> Selection:
    """The terms that give the smallest predicted square error.

    The candidates are made orthogonal to one another, the one that explains the most first. Each term then lowers the
    mean square of the residuals by its own amount, whatever the other terms are. The predicted square error adds
    sigma_max^2 k/n for k terms.

    largest_noise_variance : sigma_max^2, an upper bound of the noise in z. The default is the variance of z about its
    mean: then a term that explains less than 1/n of this variance is left out, however small the noise is. A limit of
    10 times the noise variance accepts one superfluous candidate in 600, a limit of 4 one in 20.

    Other arguments and errors as for `stepwise`.
    """
    names, X, z = _checked(candidates, z)
    n = len(z)
    left, size = X - X.mean(axis=0), ((X - X.mean(axis=0)) ** 2).sum(axis=0)
    residual = z - z.mean()
    penalty = (float(residual @ residual) / n if largest_noise_variance is None else largest_noise_variance) / n
    order: list[int] = []
    errors = [float(residual @ residual) / n]
    for _ in range(min(X.shape[1], n - 2)):
        square = (left**2).sum(axis=0)
        usable = square > DEPENDENT * size
        usable[order] = False
        if not usable.any():
            break
        gain = np.where(usable, (left.T @ residual) ** 2 / np.where(usable, square, 1.0), -1.0)
        best = int(np.argmax(gain))
        p = left[:, best] / np.sqrt(square[best])
        residual = residual - p * (p @ residual)
        left = left - np.outer(p, p @ left)
        order.append(best)
        errors.append(float(residual @ residual) / n + penalty * len(order))
    return _fitted(names, X, z, order[: int(np.argmin(errors))], penalty)


def _checked(candidates: Mapping[str, ArrayLike], z: ArrayLike) -> tuple[tuple[str, ...], Array, Array]:
    target = np.asarray(z, dtype=float)
    columns = {name: np.asarray(values, dtype=float) for name, values in candidates.items()}
    for name, values in {"z": target, **columns}.items():
        if values.ndim != 1 or len(values) != len(target):
            raise InputError(f"candidate {name}: shape {values.shape}, z has {target.shape}; give (n,) for all")
        if not np.isfinite(values).all():
            raise InputError(f"{name}: not finite at sample {int(np.argmin(np.isfinite(values)))}; leave it out")
    if not columns or len(target) < len(columns) + 3:
        raise InputError(f"{len(columns)} candidates and {len(target)} samples; give more samples than candidates")
    return tuple(columns), np.column_stack(list(columns.values())), target


def _partial_F(X: Array, z: Array, chosen: list[int]) -> Array:
    """(m,) F statistic of each candidate added to the chosen ones; 0 for a chosen or a dependent one."""
    n = len(z)
    Q = np.linalg.qr(np.column_stack([np.ones(n), X[:, chosen]]))[0]
    left, residual = X - Q @ (Q.T @ X), z - Q @ (Q.T @ z)
    square = (left**2).sum(axis=0)
    usable = square > DEPENDENT * ((X - X.mean(axis=0)) ** 2).sum(axis=0)
    usable[chosen] = False
    gain = np.where(usable, (left.T @ residual) ** 2 / np.where(usable, square, 1.0), 0.0)
    dof = n - len(chosen) - 2
    return np.asarray(gain * dof / np.maximum(residual @ residual - gain, np.finfo(float).tiny))


def _fitted(names: tuple[str, ...], X: Array, z: Array, chosen: list[int], penalty: float | None = None) -> Selection:
    """Fit the chosen terms. penalty : predicted square error per term; default: from the variance of the residuals."""
    n, k = len(z), len(chosen)
    A = np.column_stack([np.ones(n), X[:, chosen]])
    solution: Array = np.asarray(np.linalg.lstsq(A, z, rcond=None)[0])
    residual = z - A @ solution
    square, total = float(residual @ residual), float(((z - z.mean()) ** 2).sum())
    noise_variance = square / max(n - k - 1, 1)
    errors = np.sqrt(noise_variance * np.diag(np.linalg.inv(A.T @ A)))
    return Selection(
        tuple(names[i] for i in chosen),
        solution[1:],
        errors[1:],
        float(solution[0]),
        float(errors[0]),
        1 - square / total if total else 0.0,
        square / n + k * (2 * noise_variance / n if penalty is None else penalty),
    )
