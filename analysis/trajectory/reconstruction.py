"""Maximum a posteriori trajectory and sensor errors of a whole flight, by Gauss-Newton iterations."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.air.magnetometer import Compass
from flightpower.analysis.trajectory.block_means import BlockMeans
from flightpower.analysis.trajectory.dryden import mean_wind_profile
from flightpower.analysis.trajectory.equations import (
    MEASUREMENT_INPUTS,
    MEASUREMENTS,
    PREDICTED_FLOW,
    SENSOR_ERRORS,
    STATES,
    EquationInputs,
)
from flightpower.analysis.trajectory.gusts import (
    AxisSpectrum,
    Estimate,
    gust_spectra,
    scale_length,
    slow_power_ratios,
    vertex,
    with_slow_power,
)
from flightpower.analysis.trajectory.priors import SensorPriors
from flightpower.analysis.trajectory.problem import TrajectoryProblem
from flightpower.analysis.trajectory.settings import GUSTS, SOLVER
from flightpower.analysis.trajectory.smoother import GaussNewtonStep, StatesGivenErrors, cost, gauss_newton_step
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError

GUST_STATES = [STATES.index(f"gust_{axis}") for axis in "uvw"]
GUST_GRID_MPS = SOLVER.gusts_mps


@dataclass(frozen=True)
class Trajectory:
    """The reconstructed trajectory and the systematic errors of the sensors.

    states : by name, index t_s
    sensor_errors, covariance : estimates (m,) and their covariance (m, m), order of SENSOR_ERRORS
    prior_sigma : (m,) prior standard deviations of the sensor errors
    state_sensitivity : (n, nx, m) derivative of the most probable states with respect to the sensor errors
    states_given_errors : the distribution of the states given the sensor errors
    draws : (SOLVER.draws, n, nx) random errors drawn from this distribution
    predicted_flow : (n, ·) columns PREDICTED_FLOW, for `flow`
    gust_mps : standard deviation of vertical gusts [m/s]        gust_length : their scale length over the standard's
    residuals : rms of each measurement's residuals, in units of its standard deviation
    block_means : the measurements at the same instants
    as_measured : whether it only repeats the measurements (`as_measured.path_as_measured`)
    lost_s : instants after which the attitude could not be followed for a step
    eddies_mps : updrafts differ from run to run; 1 sigma of their mean over the runs. The estimated updraft is the mean
        of the whole flight.
    height_noise : as in `SensorPriors`
    """

    states: pd.DataFrame
    sensor_errors: Array
    covariance: Array
    prior_sigma: Array
    state_sensitivity: Array
    states_given_errors: StatesGivenErrors
    draws: Array
    predicted_flow: Array
    gust_mps: float
    residuals: dict[str, float]
    converged: bool
    block_means: BlockMeans
    gust_length: float = 1.0
    as_measured: bool = False
    lost_s: tuple[float, ...] = ()
    eddies_mps: float = 0.0
    height_noise: float = 1.0

    def with_prior(self, name: str, sigma: float) -> "Trajectory":
        """The trajectory for another prior standard deviation of a sensor error whose prior has the mean zero.

        Posterior and prior are normal, so one prior's information can be subtracted and another's added.
        """
        i = SENSOR_ERRORS.index(name)
        information = np.linalg.inv(self.covariance)
        changed = information.copy()
        changed[i, i] += 1 / sigma**2 - 1 / self.prior_standard_error(name) ** 2
        covariance = np.linalg.inv(changed)
        errors = covariance @ information @ self.sensor_errors
        prior_sigma = self.prior_sigma.copy()
        prior_sigma[i] = sigma
        return replace(
            self,
            states=self.states + self.state_sensitivity @ (errors - self.sensor_errors),
            sensor_errors=errors,
            covariance=(covariance + covariance.T) / 2,
            prior_sigma=prior_sigma,
        )

    def value(self, name: str) -> float:
        """Estimate of a sensor error."""
        return float(self.sensor_errors[SENSOR_ERRORS.index(name)])

    def standard_error(self, name: str) -> float:
        """Standard error of the estimate of a sensor error."""
        return float(np.sqrt(self.covariance[SENSOR_ERRORS.index(name), SENSOR_ERRORS.index(name)]))

    def prior_standard_error(self, name: str) -> float:
        """Prior standard deviation of a sensor error."""
        return float(self.prior_sigma[SENSOR_ERRORS.index(name)])

    def states_error(self) -> pd.DataFrame:
        """Standard error of every state at every instant: random errors (from draws) and sensor errors."""
        random = np.sum(self.draws**2, axis=0) / len(self.draws)
        by_factor = self.state_sensitivity.reshape(-1, len(self.covariance)) @ np.linalg.cholesky(self.covariance)
        systematic = np.sum(by_factor**2, axis=1).reshape(random.shape)
        return pd.DataFrame(np.sqrt(random + systematic), index=self.states.index, columns=self.states.columns)


def reconstruct(
    table: pd.DataFrame,
    rest: list[slice],
    priors: SensorPriors = SensorPriors(),
    *,
    compass: Compass | None = None,
    gust_length: float = Uncertainty().gust_length,
    log: str = "log",
) -> Trajectory:
    """The most probable trajectory of a whole flight.

    table: as `air_data` returns it. rest: rows in which the aircraft is at rest. compass: the earth's field, sample by
    sample, from a calibrated magnetometer. gust_length: prior for the ratio of the scale length of vertical
    gusts to the height.
    Raises InputError, beginning with `log`, where the measurements do not determine a trajectory.
    """
    try:
        problem = TrajectoryProblem(table, rest, priors, compass)
        return _reconstruct(problem, gust_length)
    except np.linalg.LinAlgError:
        raise InputError(
            f"{log}: the flight path cannot be reconstructed: IMU and air data contradict each other or have long gaps"
        ) from None


class _LinearizationPoint(NamedTuple):
    """Arguments of `Equations.linearize`."""

    x: Array
    sensor_errors: Array
    inputs: EquationInputs


@dataclass(frozen=True)
class _Solution:
    """States and sensor errors for one gust intensity.

    minus_2_log_evidence : -2 ln of the marginal likelihood
    gust_ratio : rms of the gust increments over their assumed standard deviation
    residuals : (n, ny) of the measurements        linearized_at : where the last step began
    """

    x: Array
    sensor_errors: Array
    last_step: GaussNewtonStep
    gust_mps: float
    minus_2_log_evidence: float
    gust_ratio: float
    residuals: Array
    converged: bool
    linearized_at: _LinearizationPoint


class _Candidate(NamedTuple):
    """A solution to compare with others, and to start others from."""

    x: Array
    sensor_errors: Array
    gust_mps: float
    minus_2_log_evidence: float
    gust_ratio: float


def _candidate(solution: _Solution) -> _Candidate:
    """The solution without its matrices, which take 30 MB in a flight of 20 minutes."""
    return _Candidate(*(getattr(solution, name) for name in _Candidate._fields))


def _reconstruct(problem: TrajectoryProblem, gust_length: float) -> Trajectory:
    start, middle_mps = (problem.initial_states, problem.initial_errors), GUST_GRID_MPS[len(GUST_GRID_MPS) // 2]
    first_solution = _solve(problem, *start, middle_mps, tolerance=SOLVER.converged[0])
    if not first_solution.converged:  # other gusts would not converge either, after as many iterations
        return _trajectory(problem, first_solution, _draws(first_solution), gust_length)
    first = _candidate(first_solution)
    del first_solution
    solution = _in_most_probable_gusts(problem, first)
    draws = _draws(solution)
    if solution.gust_mps > GUSTS.dominate_mps:
        length = scale_length(_spectra(problem, solution, draws, GUSTS.around_corner), gust_length)
        if length.assumed_length_rejected:
            problem.conditions.length = length.ratio
            solution = _in_most_probable_gusts(problem, _near_grid(problem, solution))
            draws = _draws(solution)
    return _trajectory(problem, solution, draws, gust_length)


def _in_most_probable_gusts(problem: TrajectoryProblem, first: _Candidate) -> _Solution:
    """The solution for the gust intensity of greatest evidence; the search starts from a solution on GUST_GRID_MPS."""
    gust, nearest = _most_probable_gust(problem, first)
    return _solve(problem, nearest.x, nearest.sensor_errors, gust)


def _near_grid(problem: TrajectoryProblem, solution: _Solution) -> _Candidate:
    """Return a first solution on GUST_GRID_MPS, at the intensity nearest to a solution for another scale length."""
    nearest = min(GUST_GRID_MPS, key=lambda gust: abs(np.log(gust / solution.gust_mps)))
    return _candidate(_solve(problem, solution.x, solution.sensor_errors, nearest, tolerance=SOLVER.converged[0]))


def _most_probable_gust(problem: TrajectoryProblem, first: _Candidate) -> tuple[float, _Candidate]:
    """The gust intensity of greatest evidence [m/s], and the solution nearest to it on the grid.

    It searches along GUST_GRID_MPS from the first solution until evidence falls, then fits a parabola to the best
    three. The intensity is at least SOLVER.least_gust_mps: below it the evidence is only noise, and differs between two
    analyses of one log.
    """
    start = GUST_GRID_MPS.index(first.gust_mps)
    solutions = {start: first}
    for direction in (1, -1) if first.gust_ratio > 1 else (-1, 1):
        i = start
        while 0 <= i + direction < len(GUST_GRID_MPS):
            last = solutions[i]
            i += direction
            # One iteration, from the solution at the neighboring intensity.
            solutions[i] = _candidate(_solve(problem, last.x, last.sensor_errors, GUST_GRID_MPS[i], iterations=1))
            if solutions[i].minus_2_log_evidence > last.minus_2_log_evidence:
                break  # the only maximum of evidence has been passed
        if i != start + direction:
            break  # the evidence rose in this direction
    best = min(solutions, key=lambda i: solutions[i].minus_2_log_evidence)
    if best - 1 not in solutions or best + 1 not in solutions:
        return max(GUST_GRID_MPS[best], SOLVER.least_gust_mps), solutions[best]
    octaves = vertex(*(solutions[best + i].minus_2_log_evidence for i in (-1, 0, 1)))
    return max(problem.gust_intensity(octaves, GUST_GRID_MPS[best]), SOLVER.least_gust_mps), solutions[best]


def _solve(
    problem: TrajectoryProblem,
    x: Array,
    sensor_errors: Array,
    gust_mps: float,
    *,
    iterations: int = SOLVER.most_iterations,
    tolerance: float = SOLVER.converged[1],
) -> _Solution:
    """Run up to `iterations` Gauss-Newton iterations for one gust intensity, until a step is within the tolerance."""
    converged, last_move, damping = False, np.zeros(len(SENSOR_ERRORS)), 1.0
    linearization: Any
    step: Any
    for iteration in range(iterations):
        inputs = problem.equation_inputs(x, sensor_errors, gust_mps)
        remaining, prior = problem.remaining_errors(sensor_errors, gust_mps)
        point = _LinearizationPoint(x, remaining, inputs)
        linearization = step = None  # frees 30 MB before allocating as much again
        linearization = problem.equations.linearize(*point)
        if iteration > 2:  # the first ones come from a rough first estimate
            problem.leave_out_lost_steps(linearization.process_residual[:, :3] / inputs.process_weight[:, :3])
        initial = x[0]
        step = gauss_newton_step(linearization, prior, initial, remaining)
        move = step.sensor_errors / np.sqrt(np.diag(step.covariance))
        damping = _damping(damping, move, last_move)
        x, sensor_errors, last_move = x + damping * step.states, sensor_errors + damping * step.sensor_errors, move
        if np.max(np.abs(move)) < tolerance:
            converged = True
            break
    evidence = cost(linearization, prior, initial, remaining) - step.cost_decrease + step.log_determinant
    weights = inputs.measurement_weight
    evidence -= 2 * float(np.sum(np.log(inputs.process_weight)) + np.sum(np.log(weights[weights > 0])))
    gust_ratio = float(np.sqrt(np.mean(linearization.process_residual[:, GUST_STATES] ** 2)))
    return _Solution(
        x, sensor_errors, step, gust_mps, evidence, gust_ratio, linearization.measurement_residual, converged, point
    )


def _damping(damping: float, move: Array, last_move: Array) -> float:
    """The fraction of the step `move` (m,) to apply; of `last_move` the fraction `damping` was applied.

    Without a measured heading steps may oscillate between two points. Where the full step is l times too long, each
    step is 1 - l damping times the step before, and applying 1/l makes the next step vanish (Aitken's acceleration).
    """
    before = float(last_move @ last_move)
    ratio = float(move @ last_move) / before if before else 0.0
    if ratio > -0.3:
        return damping
    if damping == 1.0:  # the early steps of a rough first estimate: their ratio says little
        return 0.5
    return max(damping / (1 - max(ratio, -3.0)), 0.05)  # one pair of steps justifies a cut to a quarter at most


def _state_sensitivity(problem: TrajectoryProblem, solution: _Solution) -> Array:
    """Derivative of the states with respect to the sensor errors, (n, nx, m).

    The derivatives of the equations are taken at the actual flow: a sensor error acts in proportion to it. (Steps and
    covariance use the predicted flow.) They are taken where the last step began: anywhere else, a heading that is
    hardly measured would change with every error.
    """
    x, sensor_errors, inputs = solution.linearized_at
    actual = replace(inputs, predicted_inputs=inputs.measurement_inputs)
    return solution.last_step.conditional.state_sensitivity(problem.equations.linearize(x, sensor_errors, actual))


def _trajectory(problem: TrajectoryProblem, solution: _Solution, draws: Array, gust_length: float) -> Trajectory:
    inputs, _ = problem.regressors.measurement_inputs(solution.x, solution.sensor_errors, solution.gust_mps)
    sensitivity = _state_sensitivity(problem, solution)
    as_assumed = Estimate(solution.sensor_errors, solution.last_step.covariance)
    prior = Estimate(problem.error_mean, np.diag(problem.error_sigma**2))
    slow = slow_power_ratios(_spectra(problem, solution, draws, GUSTS.slow), gust_length / problem.conditions.length)
    sensor_errors, covariance = with_slow_power(as_assumed, prior, solution.gust_mps, slow)
    states = solution.x + sensitivity @ (sensor_errors - solution.sensor_errors)
    return Trajectory(
        states=pd.DataFrame(states, pd.Index(problem.blocks.t_s, name="t_s"), list(STATES)),
        sensor_errors=sensor_errors,
        covariance=covariance,
        prior_sigma=problem.error_sigma,
        state_sensitivity=sensitivity,
        states_given_errors=solution.last_step.conditional,
        draws=draws,
        predicted_flow=inputs[:, [MEASUREMENT_INPUTS.index(name) for name in PREDICTED_FLOW]],
        gust_mps=solution.gust_mps,
        gust_length=problem.conditions.length,
        residuals=_residual_rms(problem, solution.residuals),
        converged=solution.converged,
        block_means=problem.blocks,
        height_noise=problem.height_noise,
        lost_s=tuple(problem.blocks.t_s[:-1][problem.lost].tolist()),
    )


def _draws(solution: _Solution) -> Array:
    return solution.last_step.conditional.draws(len(STATES), SOLVER.draws)


def _spectra(
    problem: TrajectoryProblem, solution: _Solution, draws: Array, band: tuple[float, float]
) -> list[AxisSpectrum]:
    """`gust_spectra` from take-off to landing."""
    flown, assumed = problem.blocks.airborne, problem.conditions.in_cruise(solution.gust_mps)
    x = solution.x[flown]
    if not len(x):
        return [AxisSpectrum(np.empty(0), np.empty(0), gust) for gust in assumed]
    gusts, errors = gusts_and_wind(x), gusts_and_wind(draws[:, flown], x)
    return gust_spectra(gusts, errors, problem.blocks.step_s, assumed, band)


def gusts_and_wind(states: Array, along: Array | None = None) -> Array:
    """Gusts (3, ..., n) of states (..., n, nx) plus changes of the wind at one height, which look like slow gusts.

    along : states (n, nx) that supply heading and height if `states` are errors
    """
    path = states if along is None else along
    psi, profile = path[:, STATES.index("psi")], mean_wind_profile(path[:, STATES.index("height")])
    north, east = (states[..., STATES.index(f"wind_{axis}")] * profile.mean() / profile for axis in ("north", "east"))
    if along is None:
        north, east = north - north.mean(), east - east.mean()
    u, v, w = (states[..., i] for i in GUST_STATES)
    return np.stack([u + north * np.cos(psi) + east * np.sin(psi), v - north * np.sin(psi) + east * np.cos(psi), w])


def _residual_rms(problem: TrajectoryProblem, residuals: Array) -> dict[str, float]:
    """rms by measurement; the compass in units of the standard deviation of one block."""
    used = problem.measurements.weight > 0
    rms = {
        name: float(np.sqrt(np.mean(residuals[used[:, i], i] ** 2)))
        for i, name in enumerate(MEASUREMENTS)
        if used[:, i].any()
    }
    if "compass" in rms:
        rms["compass"] *= problem.measurements.compass_sigma_factor
    return rms
