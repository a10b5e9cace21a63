"""The flight path and the errors of its sensors, over the whole flight at once: the most probable ones."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.magnetometer import Compass
from analysis.trajectory.data import Problem
from analysis.trajectory.equations import GIVEN, PREDICTED_FLOW, SENSOR_ERRORS, SHOWN, STATES, Data
from analysis.trajectory.smoother import Prior, Step, cost, step
from flight.errors import InputError

Array = NDArray[np.float64]

GUSTS = [STATES.index(f"gust_{axis}") for axis in "uvw"]
GUSTS_TRIED_MPS = tuple(0.2 * 2.0**i for i in range(-4, 5))  # vertical, 1 sigma: 0.0125, still air, to 3.2, a storm
_FIRST_TRIED = GUSTS_TRIED_MPS[len(GUSTS_TRIED_MPS) // 2]
ITERATIONS, QUICK = 40, 1  # at most; for a comparison of intensities, which are close to one another
DRAWS = 16  # of what states may be off by: enough for a standard error within a sixth
CONVERGED = 0.02  # of a standard error of every shared number, in the last step;
NEAR = 5.0  # in the last step before the intensity of gusts is known: intensities differ by far more


@dataclass(frozen=True)
class Trajectory:
    """The reconstructed trajectory and the systematic errors of the sensors.

    states : by name, index t_s
    sensor_errors, covariance : estimates (m,) and their covariance (m, m), order of SENSOR_ERRORS
    prior_sigma : (m,) prior standard deviations of the sensor errors
    state_sensitivity : (n, nx, m) derivative of the most probable states by the sensor errors
    draws : (DRAWS, n, nx) random errors of the states given the sensor errors
    predicted_flow : (n, ·) columns PREDICTED_FLOW, for `flow`
    gust_mps : standard deviation of vertical gusts [m/s]
    residuals : rms of each measurement's residuals, in units of its standard deviation
    """

    states: pd.DataFrame
    sensor_errors: Array
    covariance: Array
    prior_sigma: Array
    state_sensitivity: Array
    draws: Array
    predicted_flow: Array
    gust_mps: float
    residuals: dict[str, float]
    converged: bool

    def value(self, name: str) -> float:
        return float(self.sensor_errors[SENSOR_ERRORS.index(name)])

    def standard_error(self, name: str) -> float:
        return float(np.sqrt(self.covariance[SENSOR_ERRORS.index(name), SENSOR_ERRORS.index(name)]))

    def assumed(self, name: str) -> float:
        """Prior standard deviation of a sensor error."""
        return float(self.prior_sigma[SENSOR_ERRORS.index(name)])

    def states_error(self) -> pd.DataFrame:
        """Standard error of every state at every instant, by random errors (from draws) and by sensor errors."""
        own = np.sum(self.draws**2, axis=0) / len(self.draws)
        shared = np.einsum("nxm,mk,nxk->nx", self.state_sensitivity, self.covariance, self.state_sensitivity)
        return pd.DataFrame(np.sqrt(own + shared), index=self.states.index, columns=self.states.columns)


def reconstruct(
    table: pd.DataFrame,
    still: list[slice],
    *,
    alpha_scale_sigma: float = 0.0,
    compass: Compass | None = None,
    log: str = "log",
) -> Trajectory:
    """The most probable path of a whole flight.

    table: as `air_data` leaves it. still: where the aircraft stood. alpha_scale_sigma: standard deviation of the slope
    of angle of attack in the probe's calibration, on top of what transducers and their place on the aircraft add.
    compass: the earth's field, sample by sample, where a calibrated magnetometer saw it.
    Raises InputError, beginning with `log`, where the measurements do not determine a trajectory.
    """
    try:
        return _reconstructed(Problem(table, still, alpha_scale_sigma, compass))
    except np.linalg.LinAlgError:
        raise InputError(
            f"{log}: the flight path cannot be found: IMU and air data contradict each other, or are missing too long"
        ) from None


class _Point(NamedTuple):
    """Where the equations were linearised."""

    x: Array
    remaining: Array
    data: Data


@dataclass(frozen=True)
class _Solution:
    x: Array
    shared: Array
    last: Step
    gust: float
    evidence: float  # minus twice the log marginal likelihood
    gusty: float  # rms of what is new in gusts over what it was taken to be
    measured: Array
    converged: bool
    stepped_from: _Point


def _reconstructed(problem: Problem) -> Trajectory:
    first = _solve(problem, *problem.start(), _FIRST_TRIED, ITERATIONS, NEAR)
    gust, near = _most_probable(problem, first)
    return _path(problem, _solve(problem, near.x, near.shared, gust, ITERATIONS))


def _most_probable(problem: Problem, first: _Solution) -> tuple[float, _Solution]:
    """The intensity of gusts with the greatest evidence [m/s], downhill from the first, then by a parabola; and the
    nearest of what was tried."""
    start = GUSTS_TRIED_MPS.index(first.gust)
    tried = {start: first}
    for direction in (1, -1) if first.gusty > 1 else (-1, 1):
        i = start
        while 0 <= i + direction < len(GUSTS_TRIED_MPS):
            last = tried[i]
            i += direction
            tried[i] = _solve(problem, last.x, last.shared, GUSTS_TRIED_MPS[i], QUICK)
            if tried[i].evidence > last.evidence:
                break  # there is one best: it has been passed
        if i != start + direction:
            break  # it went downhill this way
    best = min(tried, key=lambda i: tried[i].evidence)
    if best - 1 not in tried or best + 1 not in tried:
        return GUSTS_TRIED_MPS[best], tried[best]
    before, here, after = (tried[best + i].evidence for i in (-1, 0, 1))
    vertex = (before - after) / (2 * (before - 2 * here + after))
    return float(GUSTS_TRIED_MPS[best] * 2**vertex), tried[best]


def _solve(
    problem: Problem, x: Array, shared: Array, gust: float, iterations: int, enough: float = CONVERGED
) -> _Solution:
    """Gauss-Newton from a start to where it stands still, or so often, for one intensity of gusts."""
    x, shared, converged = x.copy(), shared.copy(), False
    before, share = np.zeros(len(SENSOR_ERRORS)), 1.0
    moving = problem.in_gusts(gust)
    for _ in range(iterations):
        data = problem.data(x, shared, gust, *moving)
        remaining, prior = _remaining(problem, shared, gust)
        point = _Point(x, remaining, data)
        at = problem.equations.at(*point)
        first = x[0]
        last = step(at, prior, first, remaining)
        moves = last.shared / np.sqrt(np.diag(last.covariance))
        # To and fro, as where nothing shows the heading: the middle is better than either end, from then on.
        share = 0.5 if moves @ before < -0.3 * (before @ before) else share
        x, shared, before = x + share * last.states, shared + share * last.shared, moves
        if np.max(np.abs(moves)) < enough:
            converged = True
            break
    evidence = cost(at, prior, first, remaining) - last.decrease + last.log_determinant
    evidence -= 2 * float(np.sum(np.log(data.process_weight)) + np.sum(np.log(data.weight[data.weight > 0])))
    gusty = float(np.sqrt(np.mean(at.process[:, GUSTS] ** 2)))
    return _Solution(x, shared, last, gust, evidence, gusty, at.measured, converged, point)


def _remaining(problem: Problem, shared: Array, gust: float) -> tuple[Array, Prior]:
    """What is to be found of the shared numbers, and its prior: GPS has been moved by the latency known by now."""
    mean, sigma = problem.prior
    known = np.where(np.array(SENSOR_ERRORS) == "gps_latency", shared, 0.0)
    return shared - known, Prior(problem.first, problem.begun(gust), mean - known, sigma)


def _following(problem: Problem, last: Step, at: _Point) -> Array:
    """How the states move with the shared numbers, (n, nx, m).

    What an error of a sensor does to the path it does by the flow as it is. The search and the covariance have it
    beside the flow foretold, which changes alike but is less. Taken where the step was: elsewhere the heading, where
    next to nothing holds it, would turn with every error.
    """
    exact = replace(at.data, given_foreseen=at.data.given)
    return last.held.follow(problem.equations.at(at.x, at.remaining, exact))


def _path(problem: Problem, solution: _Solution) -> Trajectory:
    seen = problem.weight > 0
    rms = {
        name: float(np.sqrt(np.mean(solution.measured[seen[:, i], i] ** 2)))
        for i, name in enumerate(SHOWN)
        if seen[:, i].any()
    }
    if "compass" in rms:
        rms["compass"] *= problem.headings
    states = pd.DataFrame(solution.x, index=pd.Index(problem.t_s, name="t_s"), columns=list(STATES))
    last = solution.last
    given, _ = problem.what_is_given(solution.x, solution.shared, solution.gust)
    flow_slow = given[:, [GIVEN.index(name) for name in PREDICTED_FLOW]]
    return Trajectory(
        states,
        solution.shared,
        last.covariance,
        problem.prior[1],
        _following(problem, last, solution.stepped_from),
        last.held.draws(len(STATES), DRAWS),
        flow_slow,
        solution.gust,
        rms,
        solution.converged,
    )
