"""Compares each acceleration and deceleration with the others of its kind, so that the flight tests itself.

Each run alone gives power at a lift coefficient, which is compared with power from the other runs of its kind. The
difference contains the noise of both and an error of the path's slope in each run, which residuals of a few seconds do
not show (D changes by L times the slope). It also contains the effects of shared errors (trajectory, propeller's
table). Most of these cancel, whatever their size, because runs of one kind are flown alike. A defect that is not the
same in all runs does not cancel.
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
    """Drag coefficients from one run and from the others at lift coefficients CL, and the standard errors of their
    differences, each (k,)."""

    CL: Array
    CD: Array
    CD_others: Array
    standard_error: Array


def runs_against_others(
    runs: Sequence[MethodEstimate], condition: Condition, uncertainty: Uncertainty
) -> list[RunAgainstOthers]:
    """Compare each run with the others of its kind, if it shares lift coefficients with one of them."""
    with_polar = [run for run in runs if run.polar is not None]
    compared = []
    for run in with_polar:
        others = [other for other in with_polar if other is not run and other.method.kinds == run.method.kinds]
        lift = np.linspace(*run.flown_CL, 2 * len(with_polar) + 1)  # finer than the spacing of the other runs' ends
        if comparison := _compared(run, others, lift, condition, uncertainty):
            compared.append(comparison)
    return compared


def one_kind_against_another(
    method_estimate: MethodEstimate, other: MethodEstimate, condition: Condition, uncertainty: Uncertainty
) -> RunAgainstOthers | None:
    """Compare the accelerations with the decelerations, which differ if thrust or lag is wrong. None unless both have a
    polar."""
    if method_estimate.polar is None or other.polar is None:
        return None
    return _compared(
        method_estimate, [other], np.linspace(*method_estimate.flown_CL, CURVES.points), condition, uncertainty
    )


def _compared(
    run: MethodEstimate, others: list[MethodEstimate], lift: Array, condition: Condition, uncertainty: Uncertainty
) -> RunAgainstOthers | None:
    """Compare a run with the others at the value of `lift` where their difference is known best, relative to drag.

    None if they share no lift coefficient.
    """
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
    """The run and the mean of the others, weighted by noise, at the lift coefficients that one of the others covers.

    Shared errors change the difference by the difference of their effects. None if no lift coefficient is covered.
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
        """The effect (k, n) on the weighted mean of the others, from polars or their changes, (3, n) for each run."""
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
