"""Hints for the verdict on a fit: residuals that are not white, outliers, instability, collinear unknowns.

Collinear unknowns are determined by the data only together (Belsley, Kuh & Welsch, Regression Diagnostics, 1980, ch. 3;
Klein & Morelli, Aircraft System Identification, 2006, ch. 5). Both diagnostics are applied to the information matrix,
scaled to a unit diagonal, priors included.
"""

import math
from typing import NamedTuple

import numpy as np

from flightpower.analysis.estimation.fit import Finding, Fit, FitStatus, Remark, SegmentFit
from flightpower.analysis.estimation.settings import VERDICT
from flightpower.flight.arrays import Array


class Collinearity(NamedTuple):
    """One combination of unknowns that is poorly determined.

    condition_index : square root of the ratio of the largest eigenvalue to the eigenvalue of this combination
    names, proportions : unknowns that owe more than half of their variance to this combination, and the part they owe
    """

    condition_index: float
    names: tuple[str, ...]
    proportions: tuple[float, ...]

    def __str__(self) -> str:
        return f"{' and '.join(self.names)} (condition index {self.condition_index:.0f})"


def collinearities(
    names: tuple[str, ...], information: Array, smallest_index: float = VERDICT.condition_index
) -> list[Collinearity]:
    """Combinations with a condition index above `smallest_index`, the worst first.

    information : (m, m) of the unknowns `names`, positive definite
    """
    scale = np.sqrt(np.diag(information))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    parts = vectors**2 / values  # (unknown, eigenvalue): contribution to the variance
    proportions = parts / parts.sum(axis=1, keepdims=True)
    combinations = []
    for k in np.flatnonzero(values * smallest_index**2 < values[-1]):
        involved = np.flatnonzero(proportions[:, k] > VERDICT.variance_proportion)
        if len(involved) > 1:
            combinations.append(
                Collinearity(
                    float(np.sqrt(values[-1] / values[k])),
                    tuple(names[i] for i in involved),
                    tuple(proportions[involved, k].tolist()),
                )
            )
    return combinations


RESIDUALS_NOT_WHITE = (
    "the model lacks something, process noise acts, or this is a false optimum; compare best_of_starts and"
    " fit_filter_error, and use uncertainty.morelli_klein"
)
INNOVATIONS_NOT_WHITE = (
    "the model lacks something, process noise acts on other states too, or it is colored (give it a state of its own)"
)


def hints_of(fit: Fit) -> tuple[Remark, ...]:
    """One sentence for each finding. Stability is examined only if the fit has other faults."""
    hints = _colored(fit) + _outliers(fit)
    if hints or fit.verdict.status is not FitStatus.CONVERGED:
        hints += _unstable(fit)
    return tuple(hints)


def innovation_hints(fit: Fit) -> tuple[Remark, ...]:
    """One sentence if the innovations of filter error are not white."""
    return tuple(_colored(fit, INNOVATIONS_NOT_WHITE))


def _colored(fit: Fit, explanation: str = RESIDUALS_NOT_WHITE) -> list[Remark]:
    outputs = len(fit.model.outputs)
    products, squares, pairs = np.zeros(outputs), np.zeros(outputs), np.zeros(outputs)
    for segment_fit in fit.segment_fits:
        e = np.nan_to_num(segment_fit.residuals)
        products += np.einsum("ij,ij->j", e[1:], e[:-1])
        squares += np.einsum("ij,ij->j", e, e)
        pairs += (segment_fit.white.present[1:] & segment_fit.white.present[:-1]).sum(axis=0)
    lag_one = np.divide(products, squares, out=np.zeros(outputs), where=squares > 0)
    colored = np.abs(lag_one) * np.sqrt(pairs) > VERDICT.not_white
    if not colored.any():
        return []
    names = [name for name, is_colored in zip(fit.model.outputs, colored, strict=True) if is_colored]
    largest = np.abs(lag_one[colored]).max()
    text = f"residuals of {', '.join(names)} are not white (lag-one correlation up to {largest:.2f}): {explanation}"
    return [Remark(Finding.NOT_WHITE, text)]


def _outliers(fit: Fit) -> list[Remark]:
    """Finds outliers under normal noise; t noise gives them a small weight anyway."""
    counts = np.sum(
        [(np.abs(segment_fit.white.e) > VERDICT.outlier).sum(axis=0) for segment_fit in fit.segment_fits], axis=0
    )
    if not counts.any() or any((segment_fit.white.weight != 1).any() for segment_fit in fit.segment_fits):
        return []
    named = [f"{count} of {name}" for name, count in zip(fit.model.outputs, counts, strict=True) if count]
    size = f"{VERDICT.outlier:g} standard deviations"
    text = f"outliers: {', '.join(named)} beyond {size}; use MeasurementNoise(tail_dof=4)"
    return [Remark(Finding.OUTLIERS, text)]


def _unstable(fit: Fit) -> list[Remark]:
    growths = (unstable_growth(fit, segment_fit) for segment_fit in fit.segment_fits)
    ln_growth, eigenvalue, name = max(growths, default=(0.0, 0.0, ""))
    if ln_growth < math.log(VERDICT.error_growth):
        return []
    text = (
        f"unstable: with an eigenvalue of {eigenvalue:+.2g} 1/s an error grows by {math.exp(min(ln_growth, 700)):.0e}"
        f" within segment {name}; split it (data.split), or use filter error"
    )
    return [Remark(Finding.UNSTABLE, text)]


def unstable_growth(fit: Fit, segment_fit: SegmentFit) -> tuple[float, float, str]:
    """ln of an error's growth over a segment, mean of the largest real part of an eigenvalue [1/s], segment name.

    The eigenvalues are those of the model linearized about the response.
    """
    segment, x = segment_fit.segment, segment_fit.response.x
    if not fit.model.states:
        return 0.0, 0.0, segment.name
    indices = np.linspace(0, len(segment) - 1, min(20, len(segment))).astype(int)
    estimates = [
        fit.parameters.get(q.name) or fit.parameters[f"{q.name}[{segment.name}]"] for q in fit.model.parameters
    ]
    values, u = [estimate.value for estimate in estimates], [segment.u[name][indices] for name in fit.model.inputs]

    def rates(x: Array) -> Array:
        return np.array([rate + np.zeros(len(indices)) for rate in fit.model.evaluate_dynamics(x.T, u, values)])

    share = 1e-6  # of the largest value of a state, for central differences
    steps = share * np.maximum(np.abs(x).max(axis=0), share)
    with np.errstate(all="ignore"):
        A = np.stack(
            [(rates(x[indices] + d) - rates(x[indices] - d)) / (2 * d.max()) for d in np.diag(steps)], axis=1
        )  # (i, j, k)
    real_parts = np.linalg.eigvals(np.nan_to_num(A).transpose(2, 0, 1)).real.max(axis=1)
    mean = float(np.mean(real_parts))
    return mean * float(segment.t_s[-1] - segment.t_s[0]), mean, segment.name
