"""What all methods have in common: what each is, how it is asked, and what it answers.

A method is a pure function from what it is given (`as_measured.given`) and the runs it uses to a linear problem for the
drag polar; solving it, its noise, and what it is off by because of what it takes as measured and because of the path
are the same for all of them, and here.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag import sensor_errors as as_measured
from analysis.drag.covariance import FLOOR_RAD
from analysis.drag.forces import Blocks
from analysis.drag.polar import ROBUST_RANGE, Polar
from analysis.drag.regression import Point, Problem
from analysis.maneuvers.kinds import Run
from analysis.trajectory import dryden as gusts
from analysis.trajectory.reconstruction import Trajectory
from flight.aircraft import Aircraft
from flight.errors import InputError

Array = NDArray[np.float64]

LEAST_LIFT_AT = 0.2  # standard deviation of CL_minD: what a form without it is off by (method section 2)


@dataclass(frozen=True)
class Method:
    """One way to power required.

    kinds : of runs it uses        takes : what it takes as measured, names of `as_measured.UNKNOWN`
    problem : (given, runs, aircraft) to a problem; raises InputError where the runs do not allow one
    points : (given, runs, aircraft) to what it measured point by point; most methods have none
    two_term : its form has no CL_minD
    """

    name: str
    title: str
    equations: str
    kinds: tuple[str, ...]
    takes: tuple[str, ...]
    problem: Callable[[pd.DataFrame, list[Run], Aircraft], Problem]
    points: Callable[[pd.DataFrame, list[Run], Aircraft], list[Point]] | None = None
    two_term: bool = False


@dataclass(frozen=True)
class MethodEstimate:
    """A method's answer: a drag polar over the lift coefficients that it saw.

    noise, systematic : the two parts of the polar's covariance (3, 3); systematic is what all runs share
    slopes : by how much A (3,) moves with each error of what is taken as measured
    moves : (3, ·) by how much with each independent error of the path, of one standard error
    faults : by how much each of `as_measured.CAUSES` has moved A (3,), by what path and dynamic method found of it
    polar : None where there is no answer; `notes` then say why
    """

    method: Method
    polar: Polar | None = None
    noise: Array = field(default_factory=lambda: np.zeros((3, 3)))
    systematic: Array = field(default_factory=lambda: np.zeros((3, 3)))
    slopes: dict[str, Array] = field(default_factory=dict)
    moves: Array = field(default_factory=lambda: np.zeros((3, 0)))
    faults: dict[str, Array] = field(default_factory=dict)
    flown_CL: tuple[float, float] = (0.0, 0.0)
    points: tuple[Point, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Flown:
    """What methods are asked about: one flight's runs, and what they are given of it.

    as_is : as measured and along the path         moved : along the path moved by each independent error of it
    shifted : with each error of `as_measured.UNKNOWN` supposed to be of that size     corrected : with what was found
    of each of `as_measured.CAUSES` taken out
    """

    aircraft: Aircraft
    runs: list[Run]
    as_is: pd.DataFrame
    moved: list[pd.DataFrame]
    shifted: dict[str, pd.DataFrame]
    corrected: dict[str, pd.DataFrame]


def flown(blocks: Blocks, trajectory: Trajectory, runs: list[Run], errors: Mapping[str, as_measured.Error]) -> Flown:
    """Everything that methods are asked about a flight, once for all of them. errors: of `as_measured.found`."""
    states = trajectory.states.to_numpy()

    def given(
        errors: Mapping[str, float], states: Array = states, shared: Array = trajectory.sensor_errors
    ) -> pd.DataFrame:
        return as_measured.given(blocks, states, shared, errors, vertical, along)

    flying = np.isfinite(blocks.mean["V_mps"])
    where = [float(np.nanmedian(blocks.mean[name][flying])) for name in ("height_m", "V_mps")]
    vertical, along = (
        gusts.vertical(trajectory.gust_mps, *where).as_gauss_markov(),
        gusts.longitudinal(trajectory.gust_mps, *where),
    )
    directions = np.linalg.cholesky(trajectory.covariance).T
    return Flown(
        blocks.aircraft,
        runs,
        given({}),
        [given({}, states + trajectory.state_sensitivity @ d, trajectory.sensor_errors + d) for d in directions],
        {name: given({name: size}) for name, size in as_measured.UNKNOWN.items()},
        {cause: given({name: errors[name].value for name in names}) for cause, names in as_measured.CAUSES.items()},
    )


def estimate(method: Method, flown: Flown) -> MethodEstimate:
    """A method's answer; never raises for what a flight lacks, but says so in the notes."""
    try:
        return _estimate(method, flown)
    except InputError as error:
        return MethodEstimate(method, notes=(str(error),))


def _estimate(method: Method, flown: Flown) -> MethodEstimate:
    runs = [run for run in flown.runs if run.kind in method.kinds]
    if not runs:
        raise InputError(f"nothing of the kind was flown: {' or '.join(method.kinds)}")

    def asked(given: pd.DataFrame) -> Problem:
        return method.problem(given, runs, flown.aircraft)

    problem = asked(flown.as_is)
    A, noise = problem.values(), problem.noise()
    moves = np.stack([asked(given).values() - A for given in flown.moved], axis=1)
    slopes = {name: (asked(flown.shifted[name]).values() - A) / as_measured.UNKNOWN[name] for name in method.takes}
    systematic = moves @ moves.T + sum(_outer(slope * as_measured.UNKNOWN[name]) for name, slope in slopes.items())
    systematic[1, 1] += np.tan(FLOOR_RAD) ** 2
    if method.two_term:
        systematic += _missing_term(problem, A)
    faults = {
        cause: A - asked(flown.corrected[cause]).values()
        for cause, names in as_measured.CAUSES.items()
        if set(names) & set(method.takes)
    }
    points = method.points(flown.as_is, runs, flown.aircraft) if method.points else []
    low, high = (problem.CL.min(), problem.CL.max()) if points else np.percentile(problem.CL, ROBUST_RANGE)
    return MethodEstimate(
        method,
        Polar(A, noise + systematic),
        noise,
        systematic,
        slopes,
        moves,
        faults,
        (float(low), float(high)),
        tuple(points),
        _doubts(A, flown.as_is, runs),
    )


def _outer(x: Array) -> Array:
    return np.outer(x, x)


def _missing_term(problem: Problem, A: Array) -> Array:
    """What a fit of A0 and A2 alone makes of a polar with a CL_minD: the covariance of A for LEAST_LIFT_AT.

    (3.36): CL_minD adds -2 K CL_minD CL to C_D; the fit sees it as a change of A0 and A2, and lacks it in A1.
    """
    A1 = -2 * A[2] * LEAST_LIFT_AT
    CL = problem.CL
    X = np.stack([np.ones_like(CL), CL**2], axis=1)
    (A0, A2), *_ = np.linalg.lstsq(X, A1 * CL, rcond=None)
    return _outer(np.array([A0, -A1, A2]))


def _doubts(A: Array, given: pd.DataFrame, runs: list[Run]) -> tuple[str, ...]:
    notes = []
    if A[2] <= 0:
        notes.append("drag does not rise with lift in this fit: the lift coefficients flown are too much alike")
    flown = pd.concat([given.loc[run.start_s : run.end_s, "covered"] for run in runs])
    beyond = 1 - float(flown.mean())
    if beyond > 0.02:
        notes.append(f"the propeller's table does not reach {100 * beyond:.0f} % of what was flown")
    return tuple(notes)
