"""Every method on one flight, each run alone, and where the methods disagree."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from analysis.drag import comparison as compare
from analysis.drag import polar as curve
from analysis.drag import sensor_errors as as_measured
from analysis.drag.direct import ACCELERATIONS, DECELERATIONS, DIRECT, FROM_SPEED, ONE_RUN, VARIED_LIFT
from analysis.drag.dynamic import POLAR, THRUST, UNITS, DynamicEstimate
from analysis.drag.energy import ENERGY
from analysis.drag.forces import Blocks
from analysis.drag.method import Method, MethodEstimate, estimate, flown
from analysis.drag.piw_viw import PIW_VIW_THREE, PIW_VIW_TWO
from analysis.drag.w_delta import W_DELTA, W_DELTA_SLOW
from analysis.maneuvers.kinds import LEVEL_RUNS, Maneuver
from analysis.trajectory.equations import SENSOR_ERRORS
from analysis.trajectory.reconstruction import Trajectory
from flight.aircraft import Aircraft
from flight.errors import InputError
from flight.propeller import Propeller

ALL: tuple[Method, ...] = (
    PIW_VIW_THREE, PIW_VIW_TWO, W_DELTA, W_DELTA_SLOW, DIRECT, FROM_SPEED, VARIED_LIFT, ENERGY, ACCELERATIONS,
    DECELERATIONS,
)  # fmt: skip
SELDOM = 0.001  # chance of an alarm about scatter where there is nothing but noise
FEWEST_RUNS = 3  # of one kind, to speak of their scatter


class MethodEstimates(NamedTuple):
    """The estimates of all methods; one_by_one: of each acceleration and deceleration alone."""

    by_method: list[MethodEstimate]
    one_by_one: list[MethodEstimate]
    disagreements: list[compare.Disagreement]


def every_method(
    table: pd.DataFrame,
    trajectory: Trajectory,
    runs: list[Maneuver],
    dynamic: DynamicEstimate | None,
    dynamic_CL: tuple[float, float],
    aircraft: Aircraft,
    propeller: Propeller,
    at: curve.Condition,
) -> MethodEstimates:
    """All of ALL over the runs of any kind, each run alone, and the pairs that disagree at one weight and density.

    table: as `air_data` leaves it. dynamic_CL: the lift coefficients that the dynamic method saw; dynamic: None where
    nothing was flown that it can use.
    """
    blocks = Blocks(table, trajectory, aircraft, propeller)
    t = blocks.t_s
    level = [run for run in runs if run.kind in LEVEL_RUNS]
    changing = np.zeros(len(t), dtype=bool)
    for run in level:
        changing |= (t >= run.start_s) & (t <= run.end_s)
    errors = as_measured.found(blocks, trajectory, changing)
    asked = flown(blocks, trajectory, runs, errors)
    answers = [estimate(method, asked) for method in ALL]
    one_by_one = [estimate(replace(ONE_RUN, title=run.name), replace(asked, runs=[run])) for run in level]
    return MethodEstimates(answers, one_by_one, compare.disagreements(dynamic, dynamic_CL, answers, errors, at))


def fallback(
    answers: list[MethodEstimate], trajectory: Trajectory, where: str
) -> tuple[DynamicEstimate, tuple[float, float]]:
    """The curve of a flight without accelerations and decelerations, and the lift coefficients it holds for.

    That of its steady points, or else of its roller coasters and wind-up turns. Raises InputError, beginning with
    `where`, saying why when they do not make one.
    """
    by_method = {answer.method.name: answer for answer in answers}
    candidates = [by_method[PIW_VIW_THREE.name], by_method[VARIED_LIFT.name]]
    answer = next((one for one in candidates if one.polar is not None and one.polar.A[2] > 0), None)
    if answer is None or answer.polar is None:
        raise InputError(
            f"{where}: no acceleration or deceleration to analyse, and of what was flown instead, {why(candidates)}"
        )
    names = (*POLAR, *THRUST)
    noise, systematic = np.zeros((5, 5)), np.zeros((5, 5))
    noise[:3, :3], systematic[:3, :3] = answer.noise, answer.systematic
    for i, name in enumerate(THRUST, start=3):
        variance = as_measured.UNKNOWN[name] ** 2
        systematic[i, i] = variance
        systematic[:3, i] = systematic[i, :3] = answer.slopes[name] * variance
    values = np.concatenate([answer.polar.A, [0.0, 0.0]])
    errors = np.sqrt(np.diag(noise + systematic))
    parameters = [(name, float(v), float(e), "") for name, v, e in zip(names, values, errors, strict=True)]
    parameters += [
        (name, trajectory.value(name), trajectory.standard_error(name), UNITS.get(name, "")) for name in SENSOR_ERRORS
    ]
    said = f"No acceleration or deceleration was flown: the curve is that of another method, {answer.method.title}."
    verdict = f"by {answer.method.title}" if trajectory.converged else "the path did not converge"
    estimate = DynamicEstimate(answer.polar, parameters, verdict, [said], [], values, noise, systematic)
    return estimate, answer.flown_CL


def why(answers: list[MethodEstimate]) -> str:
    """Why these methods have no answer, each in a few words."""
    return "; ".join(f"{answer.method.title}: {', '.join(answer.notes)}" for answer in answers)


def scatter(one_by_one: list[MethodEstimate], at: curve.Condition) -> list[str]:
    """Whether runs of one kind differ from each other by more than their noise, at a speed that all of them saw."""
    said = []
    for kind in LEVEL_RUNS:
        runs = [a for a in one_by_one if a.polar is not None and a.method.title.startswith(kind)]
        if len(runs) < FEWEST_RUNS:
            continue
        low, high = max(a.flown_CL[0] for a in runs), min(a.flown_CL[1] for a in runs)
        if low >= high:
            continue
        V = curve.speed_at([np.sqrt(low * high)], at)
        power, error = np.array(
            [curve.power_required(V, curve.Polar(a.polar.A, a.noise), at) for a in runs if a.polar is not None]
        )[:, :, 0].T
        mean = np.average(power, weights=error**-2)
        surprise = np.sum(((power - mean) / error) ** 2)
        if surprise > stats.chi2.isf(SELDOM, len(runs) - 1):
            said.append(
                f"The {len(runs)} {kind}s differ from each other by {100 * np.std(power, ddof=1) / mean:.1f} % at"
                f" {V[0]:.1f} m/s, {np.sqrt(surprise / (len(runs) - 1)):.1f} times what their noise allows."
            )
    return said
