"""Each acceleration and deceleration against the others of its kind: the flight's own certificate.

One run alone and the others, each alone, give power at one lift coefficient. Their difference has the noise of both,
an error of the path's slope in each, which residuals of some seconds do not show (D changes by L times the slope), and
what errors that they share (trajectory, propeller's table) change in it: runs of one kind are flown alike, so that most
of these cancel, whatever their size. A defect that is not the same in all runs does not cancel.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.drag.method import MethodEstimate
from analysis.drag.sensor_errors import error_prior_sigma
from analysis.drag.settings import COMPARISON
from analysis.polar import Condition, speed_at
from analysis.schema import RunAgainstOthers
from analysis.settings import CURVES
from flight.aircraft import Uncertainty

Array = NDArray[np.float64]


class _Difference(NamedTuple):
    """Drag coefficient by one run and by the others at a lift coefficient, and the standard error of the difference."""

    CL: float
    CD: float
    CD_others: float
    standard_error: float


def runs_against_others(
    runs: Sequence[MethodEstimate], condition: Condition, uncertainty: Uncertainty
) -> list[RunAgainstOthers]:
    """The comparison of each run that shares lift coefficients with another of its kind; of others there is none."""
    known = [run for run in runs if run.polar is not None]
    compared = []
    for run in known:
        others = [other for other in known if other is not run and other.method.kinds == run.method.kinds]
        lift = np.linspace(*run.flown_CL, 2 * len(known) + 1)  # finer than the ends of the others' ranges
        if found := _compared(run, others, lift, condition, uncertainty):
            compared.append(found)
    return compared


def one_kind_against_another(
    one: MethodEstimate, other: MethodEstimate, condition: Condition, uncertainty: Uncertainty
) -> RunAgainstOthers | None:
    """The accelerations against the decelerations, or the like: what differs by thrust or lag. None without both."""
    if one.polar is None or other.polar is None:
        return None
    return _compared(one, [other], np.linspace(*one.flown_CL, CURVES.points), condition, uncertainty)


def _compared(
    run: MethodEstimate, others: list[MethodEstimate], lift: Array, condition: Condition, uncertainty: Uncertainty
) -> RunAgainstOthers | None:
    """At the lift coefficient, of `lift`, where their difference is known best; None where they share none."""
    differences = [
        _difference(run, covering, CL, uncertainty)
        for CL in lift
        if (covering := [one for one in others if one.flown_CL[0] <= CL <= one.flown_CL[1]])
    ]
    if not differences:
        return None
    best = min(differences, key=lambda one: one.standard_error / abs(one.CD))
    V = float(speed_at(best.CL, condition))
    power_by_CD = condition.rho * V**3 * condition.wing_area_m2 / 2  # (3.45)
    return RunAgainstOthers(
        run=run.method.title,
        kind=run.method.kinds[0],
        speed_mps=V,
        power_W=power_by_CD * best.CD,
        others_W=power_by_CD * best.CD_others,
        standard_error_W=power_by_CD * best.standard_error,
        z=(best.CD - best.CD_others) / best.standard_error,
    )


def _difference(run: MethodEstimate, others: list[MethodEstimate], CL: float, uncertainty: Uncertainty) -> _Difference:
    """The others weighed by their noise. Shared errors change the difference by the difference of their effects."""
    row = np.array([1.0, CL, CL**2])
    weight = np.array([1 / (row @ other.noise @ row) for other in others])
    weight /= weight.sum()
    weighed = list(zip(weight, others, strict=True))
    CD, CD_others = _drag(run, row), float(sum(w * _drag(other, row) for w, other in weighed))
    variance = row @ run.noise @ row + sum(w**2 * (row @ other.noise @ row) for w, other in weighed)
    variance += (COMPARISON.run_slope_rad * CL) ** 2 * (1 + weight @ weight)
    by_trajectory = row @ run.trajectory_deviations - sum(w * (row @ one.trajectory_deviations) for w, one in weighed)
    variance += by_trajectory @ by_trajectory
    sigma = error_prior_sigma(uncertainty)
    for name, sensitivity in run.sensitivities.items():
        change = row @ sensitivity - sum(w * (row @ one.sensitivities[name]) for w, one in weighed)
        variance += (change * sigma[name]) ** 2
    return _Difference(CL, CD, CD_others, float(np.sqrt(variance)))


def _drag(run: MethodEstimate, row: Array) -> float:
    assert run.polar is not None
    return float(row @ run.polar.A)
