"""Each acceleration and deceleration compared with the others of its kind: the flight tests itself.

At one lift coefficient the power from each run alone is compared with the mean of the other runs of its kind. Their
difference has the noise of both, an error of the path's slope in each, which residuals of some seconds do not show (D
changes by L times the slope), and the effects of errors that they share (trajectory, propeller's table): runs of one
kind are flown alike, so that most of these cancel, whatever their size. A defect that is not the same in all runs does
not cancel.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flightpower.analysis.curve import Condition, drag_terms, speed_at
from flightpower.analysis.methods.causes import error_prior_sigma
from flightpower.analysis.methods.method import MethodEstimate
from flightpower.analysis.methods.settings import COMPARISON
from flightpower.analysis.records.flight import RunAgainstOthers
from flightpower.analysis.settings import CURVES
from flightpower.analysis.uncertain import variances
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.arrays import Array


class _Differences(NamedTuple):
    """Drag coefficients by one run and by the others at lift coefficients, and standard errors of the differences, each
    (k,)."""

    CL: Array
    CD: Array
    CD_others: Array
    standard_error: Array


def runs_against_others(
    runs: Sequence[MethodEstimate], condition: Condition, uncertainty: Uncertainty
) -> list[RunAgainstOthers]:
    """The comparison of each run that shares lift coefficients with another of its kind; of others there is none."""
    with_polar = [run for run in runs if run.polar is not None]
    compared = []
    for run in with_polar:
        others = [other for other in with_polar if other is not run and other.method.kinds == run.method.kinds]
        lift = np.linspace(*run.flown_CL, 2 * len(with_polar) + 1)  # finer than the ends of the others' ranges
        if comparison := _compared(run, others, lift, condition, uncertainty):
            compared.append(comparison)
    return compared


def one_kind_against_another(
    method_estimate: MethodEstimate, other: MethodEstimate, condition: Condition, uncertainty: Uncertainty
) -> RunAgainstOthers | None:
    """The accelerations compared with the decelerations: errors of thrust or lag make them differ. None without
    both."""
    if method_estimate.polar is None or other.polar is None:
        return None
    return _compared(
        method_estimate, [other], np.linspace(*method_estimate.flown_CL, CURVES.points), condition, uncertainty
    )


def _compared(
    run: MethodEstimate, others: list[MethodEstimate], lift: Array, condition: Condition, uncertainty: Uncertainty
) -> RunAgainstOthers | None:
    """Compares a run with the others at the value of `lift` where they differ most certainly; None without one."""
    differences = _differences(run, others, lift, uncertainty)
    if differences is None:
        return None
    best = int(np.argmin(differences.standard_error / np.abs(differences.CD)))
    CL, CD, CD_others, standard_error = (float(values[best]) for values in differences)
    V = float(speed_at(CL, condition))
    power_by_CD = condition.rho * V**3 * condition.wing_area_m2 / 2  # (3.45)
    return RunAgainstOthers(
        run=run.method.title,
        kind=run.method.kinds[0],
        speed_mps=V,
        power_W=power_by_CD * CD,
        others_W=power_by_CD * CD_others,
        standard_error_W=power_by_CD * standard_error,
        z=(CD - CD_others) / standard_error,
    )


def _differences(
    run: MethodEstimate, others: list[MethodEstimate], lift: Array, uncertainty: Uncertainty
) -> _Differences | None:
    """The run and the mean of the others, weighted by the inverse variance of their noise, at the lift coefficients
    that others cover; None if they cover none. Shared errors change the difference by the difference of their effects.
    """
    if not others:
        return None
    ends = np.array([method_estimate.flown_CL for method_estimate in others])
    covering = (ends[:, 0] <= lift[:, None]) & (lift[:, None] <= ends[:, 1])
    shared = covering.any(axis=1)
    CL, covering = lift[shared], covering[shared]
    if not len(CL):
        return None
    rows = drag_terms(CL)
    noise = np.stack([variances(rows, method_estimate.noise) for method_estimate in others], axis=1)
    weight = covering / noise
    weight /= weight.sum(axis=1, keepdims=True)
    weighed = (weight[:, :, None] * rows[:, None, :]).reshape(len(CL), -1)

    def by_others(values: list[Array]) -> Array:
        """The weighted mean (k, n) of changes of the polars, (3, n) each."""
        return np.asarray(weighed @ np.concatenate([value.reshape(3, -1) for value in values]))

    CD, CD_others = rows @ _polar(run), by_others([_polar(method_estimate) for method_estimate in others])[:, 0]
    variance = variances(rows, run.noise) + np.sum(weight**2 * noise, axis=1)
    variance += (COMPARISON.run_slope_rad * CL) ** 2 * (1 + np.sum(weight**2, axis=1))
    by_trajectory = rows @ run.trajectory_deviations - by_others(
        [method_estimate.trajectory_deviations for method_estimate in others]
    )
    variance += np.sum(by_trajectory**2, axis=1)
    sigma = error_prior_sigma(uncertainty)
    for name, sensitivity in run.sensitivities.items():
        change = (
            rows @ sensitivity - by_others([method_estimate.sensitivities[name] for method_estimate in others])[:, 0]
        )
        variance += (change * sigma[name]) ** 2
    return _Differences(CL, CD, CD_others, np.sqrt(variance))


def _polar(run: MethodEstimate) -> Array:
    assert run.polar is not None
    return run.polar.A
