"""Every method on one flight, and where they disagree, in the form that `results.json` has."""

import numpy as np
import pandas as pd

from analysis import summary
from analysis.path.reconstruct import Path
from analysis.power import compare, curve, taken
from analysis.power.direct import ACCELERATIONS, DECELERATIONS, DIRECT, FROM_SPEED
from analysis.power.dynamic import DynamicEstimate
from analysis.power.energy import ENERGY
from analysis.power.forces import Blocks
from analysis.power.method import Method, MethodEstimate, estimate, flown
from analysis.power.steady import PIW_VIW_THREE, PIW_VIW_TWO
from analysis.power.w_delta import W_DELTA, W_DELTA_SLOW
from analysis.results import Disagreement, MethodPoint, MethodResult
from analysis.runs.kinds import LEVEL, Run
from flight.aircraft import Aircraft
from flight.propeller import Propeller

ALL: tuple[Method, ...] = (
    PIW_VIW_THREE, PIW_VIW_TWO, W_DELTA, W_DELTA_SLOW, DIRECT, FROM_SPEED, ENERGY, ACCELERATIONS, DECELERATIONS,
)  # fmt: skip


def every_method(
    table: pd.DataFrame,
    path: Path,
    runs: list[Run],
    dynamic: DynamicEstimate,
    dynamic_CL: tuple[float, float],
    aircraft: Aircraft,
    propeller: Propeller,
    at: curve.Condition,
) -> tuple[list[MethodEstimate], list[compare.Disagreement]]:
    """All of ALL over the runs of any kind, and the pairs that disagree at one weight and density.

    table: as `air_data` leaves it. dynamic_CL: the lift coefficients that the dynamic method saw.
    """
    blocks = Blocks(table, path, aircraft, propeller)
    t = blocks.t_s
    changing = np.zeros(len(t), dtype=bool)
    for run in runs:
        if run.kind in LEVEL:
            changing |= (t >= run.start_s) & (t <= run.end_s)
    errors = taken.found(blocks, path, changing)
    asked = flown(blocks, path, runs, errors)
    answers = [estimate(method, asked) for method in ALL]
    return answers, compare.disagreements(dynamic, dynamic_CL, answers, errors, at)


def method_result(answer: MethodEstimate, at: curve.Condition) -> MethodResult:
    """A method's curve over the lift coefficients it saw, and its points, at one weight and density."""
    polar = answer.polar
    return MethodResult(
        name=answer.method.name,
        title=answer.method.title,
        equations=answer.method.equations,
        taken_as_measured=list(answer.method.takes),
        drag_polar=[] if polar is None else polar.A.tolist(),
        power_required=[] if polar is None else summary.points(polar, at, answer.flown_CL),
        points=[_point(point, at) for point in answer.points],
        notes=list(answer.notes),
    )


def _point(point, at: curve.Condition) -> MethodPoint:
    """A steady point at another weight and density: the same lift and drag coefficients."""
    V = float(curve.speed_at(point.CL, at))
    unit = at.rho * V**3 * at.wing_area_m2 / 2
    power, half = unit * point.CD, curve.NORMAL_95 * unit * point.CD_error
    return MethodPoint(
        speed_mps=V, power_W=power, power_lo_W=power - half, power_hi_W=power + half, start_s=point.start_s
    )


def disagreement_result(found: compare.Disagreement) -> Disagreement:
    return Disagreement(
        methods=(found.first, found.second),
        speed_mps=found.speed_mps,
        difference_W=found.difference_W,
        allowed_W=found.allowed_W,
        culprit=found.culprit,
        shares_W=found.shares_W,
        text=found.text,
    )
