"""Predicts what a flight will show: the expected covariance of the curve, from the estimator's equations.

The equations are linearized along the planned flight. The covariance of the sensor errors, the sensitivity of the
trajectory and the random errors of the states are those of `analysis.trajectory`, at the expected gust intensity. Drag
is regressed as in `analysis.methods.dynamic`, with the noise of `analysis.methods.consider`: from errors of the states,
and from everything else in the residuals. The latter is taken as white, and as large as flights of this kind have
shown. Earlier flights add their information on the installation's sensor errors; their drag polar is used where it is
known. A `Question` names the half width to minimize.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.air.air import with_sensors_elsewhere
from flightpower.analysis.curve import (
    POLAR,
    Condition,
    Polar,
    best_range_lift,
    minimum_power_lift,
    polar_part,
    power_required,
    speed_at,
)
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.maneuvers.find_level import find_runs
from flightpower.analysis.maneuvers.kinds import Maneuver
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods.assumed_values import missing_values
from flightpower.analysis.methods.consider import STATE_STEP
from flightpower.analysis.methods.forces import FlightForces
from flightpower.analysis.methods.thrust_prior import J_REFERENCE, stand_information
from flightpower.analysis.missions.expected_aircraft import ExpectedAircraft
from flightpower.analysis.missions.plan_settings import NOISE, SEARCH
from flightpower.analysis.missions.time_history import TimeHistory
from flightpower.analysis.records.flight import Results, Trust
from flightpower.analysis.results import read
from flightpower.analysis.sources.grid import rows_within
from flightpower.analysis.trajectory.equations import (
    MEASUREMENT_INPUTS,
    PREDICTED_FLOW,
    SENSOR_ERRORS,
    STATES,
    EquationInputs,
)
from flightpower.analysis.trajectory.gusts import Estimate, planned_ratios, with_slow_power
from flightpower.analysis.trajectory.observability import SENSOR_ERROR_KINDS
from flightpower.analysis.trajectory.priors import SensorPriors, probe_ahead_sigma_m, stated_sigma, upwash_slope_sigma
from flightpower.analysis.trajectory.problem import TrajectoryProblem
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.analysis.trajectory.settings import SOLVER
from flightpower.analysis.trajectory.smoother import GaussNewtonStep, gauss_newton_step
from flightpower.analysis.trajectory.updraft import STILL_MPS, by_waves
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError


def read_results(path: Path) -> Results:
    """Read a results.json. Raises InputError if it is something else, or not to be trusted."""
    results = read.read_results(path)
    if results.trust is Trust.NOT_TO_BE_TRUSTED:
        raise InputError(f"{path}: not to be trusted ({results.evidence[0].kind}); plan without it")
    return results


def polar(results: Sequence[Results]) -> Array | None:
    """Return A0, A1, A2 of the last flight that has a drag polar; None if no flight has one."""
    polars = [flight_results.drag_polar for flight_results in results if flight_results.drag_polar is not None]
    return np.array([polars[-1].A0, polars[-1].A1, polars[-1].A2]) if polars else None


def information(results: Sequence[Results]) -> Array | None:
    """Return the flights' information (m, m) on the errors that stay with the installation; None without flights.

    It is the information that each flight adds to the prior, error by error, since results.json has no correlations.
    """
    total = np.zeros((len(SENSOR_ERRORS), len(SENSOR_ERRORS)))
    for flight_results in results:
        if flight_results.path is None:
            raise InputError(
                f"{flight_results.log}: these results have no sensor errors, so a plan cannot begin with them"
            )
        for error in flight_results.path.sensor_errors:
            if error.name in INSTALLATION:
                i, factor = SENSOR_ERRORS.index(error.name), SENSOR_ERROR_KINDS[error.name].display_unit[0]
                gained = (factor / error.standard_error) ** 2 - (factor / error.assumed_sigma) ** 2
                total[i, i] += max(gained, 0.0)
    return total if results else None


INSTALLATION = ("alpha_bias", "alpha_scale", "beta_bias", "V_scale", "air_data_lag")  # shared by two flights on one day


class Covariances(NamedTuple):
    """Covariances of sensor errors (m, m) and A0, A1, A2 (3, 3): from noise, and from consider terms and floor.

    shared : (3, m) derivative of A0, A1, A2 with respect to the sensor errors
    assumed : effects of the values that the aircraft file lacks
    """

    errors: Array
    noise: Array
    fixed: Array
    shared: Array
    assumed: "AssumedErrors"

    @property
    def polar(self) -> Array:
        """Covariance of A0, A1, A2."""
        by_assumed = self.assumed.direct + self.assumed.scores @ self.errors @ self.shared.T
        return np.asarray(
            self.noise + self.fixed + self.shared @ self.errors @ self.shared.T + by_assumed.T @ by_assumed
        )


class AssumedErrors(NamedTuple):
    """Effects on the estimate of k values assumed for missing keys, each wrong by one standard deviation.

    scores : (k, m) gradients for the sensor errors; covariance times score gives the change of the sensor errors.
        Scores add up over the pieces of a flight, as information does.
    direct : (k, 3) change of A0, A1, A2 that does not come from the sensor errors
    """

    scores: Array
    direct: Array

    @property
    def none(self) -> "AssumedErrors":
        """Zero effects, since they cancel in the difference of two flights of one installation."""
        return AssumedErrors(0 * self.scores, 0 * self.direct)


class Question(NamedTuple):
    """speeds: where half widths are reported [m/s]. cost: what the plan minimizes [%]."""

    name: str
    title: str
    speeds: Array
    cost: Callable[[Covariances], float]
    half_widths: Callable[[Covariances], Array]  # in % of power, at `speeds`


QUESTION_TITLES = {
    "curve": "the whole power curve",
    "endurance": "power at the speed of best endurance",
    "range": "power at the speed of best range",
    "propellers": "the difference of two propellers, flown one after another",
    "probe": "the calibration of the probe",
}


def question(name: str, expected: ExpectedAircraft, slowest_mps: float, fastest_mps: float) -> Question:
    """Return the question with a name in QUESTION_TITLES, for the speeds that are planned."""
    V = np.linspace(slowest_mps, fastest_mps, 5)
    center = {"endurance": minimum_power_lift, "range": best_range_lift}.get(name)
    if center is not None:
        best = float(np.clip(speed_at(center(expected.A), condition(expected)), slowest_mps, fastest_mps))
        V = np.unique(np.clip(best * np.array([0.95, 1.0, 1.05]), slowest_mps, fastest_mps))

    def widths_of(covariances: Covariances) -> Array:
        return half_widths(_of_difference(covariances) if name == "propellers" else covariances, expected, V)

    def cost(covariances: Covariances) -> float:
        if name == "probe":
            return _probe_cost(covariances.errors)
        widths = widths_of(covariances)
        return float(np.max(widths) + SEARCH.mean_share * np.mean(widths))

    return Question(name, QUESTION_TITLES[name], V, cost, widths_of)


def condition(expected: ExpectedAircraft) -> Condition:
    """Weight and density of the flight."""
    return Condition(expected.aircraft.mass.weight_N, expected.rho, expected.aircraft.geometry.wing_area_m2)


def half_widths(covariances: Covariances, expected: ExpectedAircraft, V: Array) -> Array:
    """Return half widths of the 95 % interval of power [%] at speeds V (n,) [m/s]."""
    power, sigma = power_required(V, Polar(expected.A, covariances.polar), condition(expected))
    return np.asarray(100 * NORMAL_95 * sigma / power)


def _of_difference(covariances: Covariances) -> Covariances:
    """Return the covariances of the difference between two such flights, which share the errors of the installation."""
    errors = covariances.errors.copy()
    same = [SENSOR_ERRORS.index(error) for error in INSTALLATION]
    errors[same] = errors[:, same] = 0.0
    return covariances._replace(
        errors=2 * errors,
        noise=2 * covariances.noise,
        fixed=0 * covariances.fixed,
        assumed=covariances.assumed.none,
    )


def _probe_cost(errors: Array) -> float:
    """Return the root mean square of the 95 % half widths of offset [0.1 deg], slope [%] and airspeed scale [%]."""
    i = [SENSOR_ERRORS.index(name) for name in ("alpha_bias", "alpha_scale", "V_scale")]
    sigma = np.sqrt(np.diag(errors)[i]) * np.array([10 * np.degrees(1), 100, 100])
    return float(NORMAL_95 * np.sqrt(np.mean(sigma**2)))


class Expected(NamedTuple):
    """errors: covariance (m, m) of the sensor errors. noise, systematic: covariances (3, 3) of A0, A1, A2. shared: (3,
    m) derivative of A0, A1, A2 with respect to the sensor errors. runs: the runs that the analysis will find."""

    errors: Array
    noise: Array
    systematic: Array
    shared: Array
    runs: list[Maneuver]
    assumed: AssumedErrors

    @property
    def covariances(self) -> Covariances:
        fixed = self.systematic - self.shared @ self.errors @ self.shared.T
        return Covariances(self.errors, self.noise, fixed, self.shared, self.assumed)

    @property
    def total(self) -> Array:
        """Covariance of A0, A1, A2."""
        return self.covariances.polar


class _Linearized(NamedTuple):
    problem: TrajectoryProblem
    x: Array
    errors: Array
    inputs: EquationInputs
    step: GaussNewtonStep


def _linearized(
    history: TimeHistory, aircraft: ExpectedAircraft, gust_mps: float, alpha_scale_sigma: float
) -> _Linearized:
    """Compute the estimator's last step along the history."""
    uncertainty = aircraft.aircraft.uncertainty
    if uncertainty.updraft_mps == STILL_MPS and not aircraft.aircraft.has("uncertainty.updraft"):
        lasting_mps = by_waves(float(history.starts_s[-1] - history.starts_s[0]))
        uncertainty = replace(uncertainty, updraft_mps=max(STILL_MPS, lasting_mps))
    priors = SensorPriors(
        alpha_scale_sigma=math.hypot(alpha_scale_sigma, upwash_slope_sigma(aircraft.aircraft)),
        file_sigma=stated_sigma(uncertainty, aircraft.aircraft.wing_loading_Pa),
        probe_ahead_m=probe_ahead_sigma_m(aircraft.aircraft),
    )
    problem = TrajectoryProblem(history.table, history.rest, priors)
    blocks = problem.blocks
    x = np.zeros((blocks.n, len(STATES)))
    x[:, :3], x[:, 3:6] = history.attitude[blocks.rows], history.velocity[blocks.rows]
    x[:, STATES.index("height")] = blocks["height_m"]
    x[:, [STATES.index(f"wind_{axis}") for axis in ("north", "east")]] = history.wind[blocks.rows]
    errors = np.zeros(len(SENSOR_ERRORS))
    inputs = problem.equation_inputs(x, errors, gust_mps)
    remaining, prior = problem.remaining_errors(errors, gust_mps)
    step = gauss_newton_step(problem.equations.linearize(x, remaining, inputs), prior, x[0], remaining)
    return _Linearized(problem, x, errors, inputs, step)


class SensorErrors(NamedTuple):
    """covariance: (m, m). scores: (k, m) as in `AssumedErrors`."""

    covariance: Array
    scores: Array


def sensor_errors(
    history: TimeHistory, aircraft: ExpectedAircraft, gust_mps: float, *, alpha_scale_sigma: float
) -> SensorErrors:
    """Compute covariance and scores of the sensor errors after such a flight: the fastest part of `expected`."""
    linearized = _linearized(history, aircraft, gust_mps, alpha_scale_sigma)
    covariance = _sensor_errors(linearized, aircraft, gust_mps)
    moved = [step for _, step in _with_other_values(history, aircraft, gust_mps, alpha_scale_sigma)]
    return SensorErrors(covariance, _scores(covariance, linearized, moved))


def _with_other_values(
    history: TimeHistory, aircraft: ExpectedAircraft, gust_mps: float, alpha_scale_sigma: float
) -> list[tuple[Aircraft, _Linearized]]:
    """Return the aircraft and the estimator's last step for each assumed value wrong by one standard deviation."""
    steps = []
    for assumed in missing_values(aircraft.aircraft):
        other = assumed.perturbed(aircraft.aircraft)
        table = with_sensors_elsewhere(history.table, aircraft.aircraft, other)
        moved = _linearized(history._replace(table=table), aircraft, gust_mps, alpha_scale_sigma)
        steps.append((other, moved))
    return steps


def _scores(covariance: Array, as_assumed: _Linearized, moved: Sequence[_Linearized]) -> Array:
    changes = [other.step.sensor_errors - as_assumed.step.sensor_errors for other in moved]
    return np.asarray(np.linalg.solve(covariance, np.reshape(changes, (-1, len(covariance))).T).T)


def _sensor_errors(linearized: _Linearized, aircraft: ExpectedAircraft, gust_mps: float) -> Array:
    problem = linearized.problem
    flown = len(problem.blocks.t_s[problem.blocks.airborne])
    assumed, length = problem.conditions.in_cruise(gust_mps), aircraft.aircraft.uncertainty.gust_length
    slow = planned_ratios(flown, problem.blocks.step_s, assumed, length)
    estimate = Estimate(linearized.errors, linearized.step.covariance)
    prior = Estimate(linearized.errors, np.diag(problem.error_sigma**2))
    return with_slow_power(estimate, prior, gust_mps, slow).covariance


def linearized_trajectory(
    history: TimeHistory, aircraft: ExpectedAircraft, gust_mps: float, *, alpha_scale_sigma: float
) -> Trajectory:
    """Return the trajectory that the estimator would find without noise, with its covariance and sensitivities."""
    return _trajectory(_linearized(history, aircraft, gust_mps, alpha_scale_sigma), aircraft, gust_mps)


def _trajectory(linearized: _Linearized, aircraft: ExpectedAircraft, gust_mps: float) -> Trajectory:
    problem, x, errors, inputs, step = linearized
    actual = replace(inputs, predicted_inputs=inputs.measurement_inputs)
    return Trajectory(
        states=pd.DataFrame(x, pd.Index(problem.blocks.t_s, name="t_s"), list(STATES)),
        sensor_errors=errors,
        covariance=_sensor_errors(linearized, aircraft, gust_mps),
        prior_sigma=problem.error_sigma,
        states_given_errors=step.conditional,
        state_sensitivity=step.conditional.state_sensitivity(problem.equations.linearize(x, errors, actual)),
        draws=step.conditional.draws(len(STATES), SOLVER.draws),
        predicted_flow=_predicted_flow(inputs),
        gust_mps=gust_mps,
        residuals={},
        converged=True,
        block_means=problem.blocks,
    )


def _predicted_flow(inputs: EquationInputs) -> Array:
    return inputs.measurement_inputs[:, [MEASUREMENT_INPUTS.index(name) for name in PREDICTED_FLOW]]


def expected(
    history: TimeHistory, aircraft: ExpectedAircraft, gust_mps: float, *, alpha_scale_sigma: float
) -> Expected:
    """Compute the covariances of the sensor errors and of the drag polar after such a flight.

    Raises InputError if none of its maneuvers would be taken for a run.
    """
    linearized = _linearized(history, aircraft, gust_mps, alpha_scale_sigma)
    trajectory = _trajectory(linearized, aircraft, gust_mps)
    runs, _ = find_runs(history.table, noise_mps=math.inf)
    forces = FlightForces(trajectory, aircraft.aircraft, aircraft.propeller)
    states, errors = trajectory.states.to_numpy(), trajectory.sensor_errors
    inside = rows_within(forces.t_s, [(run.start_s, run.end_s) for run in runs])
    along = forces.nominal
    inside &= along[["CL", "CD", "J"]].notna().all(axis=1).to_numpy()
    if not inside.any():
        raise InputError(
            f"{aircraft.aircraft.name}: no acceleration or deceleration is clear enough to be measured between its"
            f" stall, {aircraft.stall_mps:.1f} m/s, and {aircraft.fastest_mps:.1f} m/s, the fastest that motor, battery"
            " and propeller's table allow; check weight and propeller, or plan for less wind"
        )
    uncertainty = aircraft.aircraft.uncertainty
    prior = np.diag([0, 0, 0, uncertainty.thrust_scale_fraction**-2, uncertainty.thrust_slope**-2, 1.0])
    prior[3:5, 3:5] += stand_information(aircraft.aircraft)

    residual_mps2 = float(np.interp(gust_mps, *np.transpose(NOISE.residuals_in_gusts)))

    def regression(f: pd.DataFrame) -> tuple[Array, Array]:
        """Return regressors (n, 6) and drag over mass (n,) inside the runs, both divided by the residuals' size."""
        f = f[inside]
        qS, CL = f["qS_over_m_mps2"].to_numpy(), f["CL"].to_numpy()
        T = f["thrust_along_V_over_m_mps2"].to_numpy()
        CL_squared, J = f["CL_squared"].to_numpy(), f["J"].to_numpy()
        X = np.column_stack(
            [qS, qS * CL, qS * CL_squared, -T, -T * (J - J_REFERENCE), -f["thrust_beyond_over_m_mps2"].to_numpy()]
        )
        return X / residual_mps2, qS * f["CD"].to_numpy() / residual_mps2

    def normal(f: pd.DataFrame) -> tuple[Array, Array]:
        X, z = regression(f)
        return X.T @ X + prior, X.T @ z

    def values(states: Array, errors: Array, aircraft_forces: FlightForces = forces) -> Array:
        return np.asarray(np.linalg.solve(*normal(aircraft_forces.forces(states, errors))))

    fit, D = values(states, errors), np.linalg.inv(normal(along)[0])
    S, z = regression(along)
    gradient = np.zeros((*states.shape, len(fit)))
    for i, change_of_state in enumerate(STATE_STEP * np.eye(states.shape[1])):
        X, moved_z = regression(forces.forces(states + change_of_state, errors))
        gradient[inside, i] = (moved_z - X @ fit - z + S @ fit)[:, None] * S / STATE_STEP
    by_states = D @ trajectory.states_given_errors.covariance_of(gradient) @ D
    by_rest = D @ (NOISE.rest_share**2 * S.T @ S + prior) @ D
    noise = polar_part(by_states + by_rest)
    shared = np.empty((len(POLAR), len(SENSOR_ERRORS)))
    for j, sigma in enumerate(np.sqrt(np.diag(trajectory.covariance))):
        error = np.zeros(len(SENSOR_ERRORS))
        error[j] = sigma
        moved = values(states + trajectory.state_sensitivity @ error, errors + error)
        shared[:, j] = polar_part(moved - fit) / sigma
    systematic = shared @ trajectory.covariance @ shared.T
    for change in (
        covariance.at_nominal_weight(
            values(states, errors, covariance.forces_with_more_weight(forces)), aircraft.aircraft
        )
        - fit,
        covariance.at_nominal_density(
            values(states, errors, covariance.forces_in_denser_air(forces)), aircraft.aircraft
        )
        - fit,
    ):
        systematic += np.outer(polar_part(change), polar_part(change))

    def values_after_step(linear_model: _Linearized, forces: FlightForces) -> Array:
        return values(states + linear_model.step.states, errors + linear_model.step.sensor_errors, forces)

    as_assumed, changes = values_after_step(linearized, forces), []
    with_other_values = _with_other_values(history, aircraft, gust_mps, alpha_scale_sigma)
    for other, step in with_other_values:
        measured = replace(trajectory, block_means=step.problem.blocks, predicted_flow=_predicted_flow(step.inputs))
        change = values_after_step(step, FlightForces(measured, other, aircraft.propeller)) - as_assumed
        changes.append(polar_part(change))
    scores = _scores(trajectory.covariance, linearized, [step for _, step in with_other_values])
    direct = np.reshape(changes, (-1, len(POLAR))) - scores @ trajectory.covariance @ shared.T
    assumed = AssumedErrors(scores, direct)
    return Expected(trajectory.covariance, np.asarray(noise), systematic, shared, runs, assumed)
