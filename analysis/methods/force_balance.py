"""Drag polar, thrust and sensor errors in one estimate: the balance of forces along the path, in windows of the runs.

`dynamic` regresses drag along the most probable path, and propagates the uncertainty of the path afterwards. Whatever
of an error of the path looks like thrust then becomes one of thrust. Here every independent direction of the path's
covariance is a parameter beside those of drag and thrust, with a unit normal prior, so that the balance of forces may
also move the path. Both are one posterior:

    Y = X A - T s - G d + e,    d ~ N(0, 1),    s ~ N(0, prior),    e ~ N(0, C)

Y (k,) drag over mass by the specific force, means over windows; X (k, 3) its regressors on A; T s the thrust beyond
that of the table; G (k, m) change of the balance along the directions d of the sensor errors. C is what it is made of:
errors of the states for given sensor errors, as the path has them; and what these do not explain, white and correlated
within a run over a time, which the runs show themselves (restricted maximum likelihood; Patterson & Thompson 1971,
Biometrika 58, 545).

`dynamic` takes the polar from it with `considered` sensor errors, which the balance does not move. Errors, half
widths and coverage then are those of `dynamic`: 99 and 97 % for 100 and 98 % with two pairs of runs at 3 and 15 kt (24
flights each). Where the balance moves the sensor errors, it is a third too certain in gusts: 79 % at 15 kt; and 75 %,
with an error of -6 %, where drag is no parabola, which bends them (12 flights).

The derivatives G follow gusts, and so does Y by the same errors of the states; their correlation would bend the sensor
errors: power at the slowest speed was 2 % too low on average in 8 flights. So G is a smooth function of time in each
run, as the derivatives of the path's measurement equations are taken at predicted states (instrumental variables).
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, solve_triangular

from analysis.maneuvers.kinds import Maneuver
from analysis.methods.consider import STATE_STEP
from analysis.methods.forces import THRUST_BY_MOTOR_SPEED, FlightForces
from analysis.methods.settings import MOTOR_SPEED, STEADY_POINTS
from analysis.methods.thrust_prior import J_REFERENCE, THRUST, stand_measurements
from flight.errors import InputError

Array = NDArray[np.float64]
PARAMETERS = ("A0", "A1", "A2", *THRUST, "thrust_beyond")
MOTOR_SPEED_ERROR = "motor_speed"


class Window(NamedTuple):
    """Rows (n,) of the forces, and the index of their run."""

    rows: NDArray[np.intp]
    run: int


class Balance(NamedTuple):
    """The balance of forces of k windows, linear in its parameters.

    Y : (k,) [m/s^2]    X, thrust : (k, 3), (k, t) derivatives by the polar and, negative, by the errors of thrust
    path : (k, m) by the directions of the sensor errors' covariance    by_states : (k, k) covariance of Y by states
    t_s, run : (k,)    names : of the errors of thrust    information, vector : (t, t), (t,) of their prior
    """

    Y: Array
    X: Array
    thrust: Array
    path: Array
    by_states: Array
    t_s: Array
    run: NDArray[np.intp]
    names: tuple[str, ...]
    information: Array
    vector: Array


class Unexplained(NamedTuple):
    """What is left of the balance: white and correlated over a time, standard deviations [m/s^2] and [s]."""

    white_mps2: float
    correlated_mps2: float
    time_s: float


class ForceBalance(NamedTuple):
    """The posterior.

    names : (p,) PARAMETERS, and the error of motor speed where one is estimated
    values : (p,)    directions : (m,) of the sensor errors' covariance, unit prior; what the balance moves them by
    sensor_errors : (m,)    covariance : (p + m, p + m) of values and sensor errors
    given_sensor_errors : (p, p) covariance of the values for known sensor errors    residuals : (k,) [m/s^2]
    """

    names: tuple[str, ...]
    values: Array
    directions: Array
    sensor_errors: Array
    covariance: Array
    given_sensor_errors: Array
    unexplained: Unexplained
    residuals: Array

    def value(self, name: str) -> float:
        return float(self.values[self.names.index(name)])

    def standard_error(self, name: str) -> float:
        i = self.names.index(name)
        return float(np.sqrt(self.covariance[i, i]))


def force_balance(
    flight_forces: FlightForces, runs: list[Maneuver], level: NDArray[np.bool_], *, considered: bool = False
) -> ForceBalance:
    """The estimate from all runs at once.

    level : (n,) rows of the forces in level flight
    considered : the sensor errors stay those of the path, and only widen the covariance (Schmidt 1966)
    Raises InputError when the runs have too few windows.
    """
    trajectory = flight_forces.trajectory
    return posterior(
        linear_balance(flight_forces, runs, level), trajectory.sensor_errors,
        np.asarray(np.linalg.cholesky(trajectory.covariance), dtype=np.float64),
        considered=considered,
    )  # fmt: skip


def posterior(balance: Balance, sensor_errors: Array, factor: Array, *, considered: bool = False) -> ForceBalance:
    """The posterior of a balance. sensor_errors, factor : (m,) and (m, m), those of the path and the Cholesky factor of
    their covariance, whose columns are the directions of the balance."""
    C, unexplained = _most_probable_covariance(balance)
    parameters = np.column_stack([balance.X, balance.thrust])
    p, m = parameters.shape[1], balance.path.shape[1]
    prior, vector = _prior(balance)
    noise = np.linalg.cholesky(C)
    weighted, path, Y = (solve_triangular(noise, one, lower=True) for one in (parameters, balance.path, balance.Y))
    given: Array = np.asarray(np.linalg.inv(weighted.T @ weighted + prior[:p, :p]), dtype=np.float64)
    # Values for given sensor errors are affine in these: values = at_path + slope d.
    at_path, slope = given @ (weighted.T @ Y + vector[:p]), -given @ weighted.T @ path
    directions, of_directions = np.zeros(m), np.eye(m)
    if not considered:
        both = np.column_stack([weighted, path])
        of_both = np.linalg.inv(both.T @ both + prior)
        directions, of_directions = (of_both @ (both.T @ Y + vector))[p:], of_both[p:, p:]
    values = at_path + slope @ directions
    cross = slope @ of_directions
    covariance = np.block(
        [[given + cross @ slope.T, cross @ factor.T], [factor @ cross.T, factor @ of_directions @ factor.T]]
    )
    return ForceBalance(
        names=("A0", "A1", "A2", *balance.names),
        values=values,
        directions=directions,
        sensor_errors=sensor_errors + factor @ directions,
        covariance=(covariance + covariance.T) / 2,
        given_sensor_errors=given,
        unexplained=unexplained,
        residuals=balance.Y - parameters @ values - balance.path @ directions,
    )


def windows(t_s: Array, usable: NDArray[np.bool_], runs: list[Maneuver], most: int = 100) -> Iterator[Window]:
    """The usable rows (n,) of each run in windows of half `STEADY_POINTS.correlation_s`, or longer, so that there are
    at most about `most`: the work goes with their number.

    Windows of fewer than three rows are left out. Means over windows leave the balance linear in the polar: with one
    second and with three the estimates differ by a tenth of their standard errors.
    """
    width_s = max(STEADY_POINTS.correlation_s / 2, sum(run.end_s - run.start_s for run in runs) / most)
    for i, run in enumerate(runs):
        rows = np.flatnonzero(usable & (t_s >= run.start_s) & (t_s <= run.end_s))
        for part in np.split(rows, np.flatnonzero(np.diff(np.floor((t_s[rows] - run.start_s) / width_s))) + 1):
            if len(part) >= 3:
                yield Window(part, i)


def linear_balance(flight_forces: FlightForces, runs: list[Maneuver], level: NDArray[np.bool_]) -> Balance:
    """The balance of forces along the path and its derivatives. Raises InputError when there are too few windows."""
    trajectory, nominal, t_s = flight_forces.trajectory, flight_forces.nominal, flight_forces.t_s
    found = list(windows(t_s, level & np.isfinite(nominal["CD"].to_numpy()), runs))
    if len(found) <= len(PARAMETERS):
        raise InputError(f"{len(found)} seconds of level runs are too few for a balance of forces")

    def mean(values: Array) -> Array:
        return np.array([values[one.rows].mean(axis=0) for one in found])

    def balance_at(states: Array, errors: Array) -> tuple[Array, Array]:
        forces = flight_forces.forces(states, errors)
        qS, CL, squared, CD = (
            np.nan_to_num(forces[name].to_numpy()) for name in ("qS_over_m_mps2", "CL", "CL_squared", "CD")
        )
        return qS * CD, np.column_stack([qS, qS * CL, qS * squared])

    states, errors = trajectory.states.to_numpy(), trajectory.sensor_errors
    y, X = balance_at(states, errors)
    Y, X_mean = mean(y), mean(X)
    A = np.linalg.lstsq(X_mean, Y, rcond=None)[0]
    left = y - X @ A
    run, time_s = np.array([one.run for one in found]), mean(t_s)
    path = np.empty((len(found), len(errors)))
    for i, error in enumerate(np.linalg.cholesky(trajectory.covariance).T):
        moved, with_X = balance_at(states + trajectory.state_sensitivity @ error, errors + error)
        path[:, i] = -mean(moved - with_X @ A - left)
    gradient = np.zeros((*states.shape, len(found)))
    for i, step in enumerate(STATE_STEP * np.eye(states.shape[1])):
        moved, with_X = balance_at(states + step, errors)
        change = (moved - with_X @ A - left) / STATE_STEP
        for k, one in enumerate(found):
            gradient[one.rows, i, k] = change[one.rows] / len(one.rows)
    thrust, names, information, vector = _thrust(flight_forces, mean)
    return Balance(
        Y, X_mean, thrust, _smooth_in_runs(path, time_s, run),
        trajectory.states_given_errors.covariance_of(gradient), time_s, run, names, information, vector,
    )  # fmt: skip


def _thrust(flight_forces: FlightForces, mean: Any) -> tuple[Array, tuple[str, ...], Array, Array]:
    """Derivatives (k, t) of the balance by the errors of thrust, their names, and information and vector of the
    prior, with a measurement on a stand."""
    forces, uncertainty = flight_forces.nominal, flight_forces.aircraft.uncertainty
    along, beyond, J = (
        np.nan_to_num(forces[name].to_numpy())
        for name in ("thrust_along_V_over_m_mps2", "thrust_beyond_over_m_mps2", "J")
    )
    columns, names = [along, along * (J - J_REFERENCE), beyond], [*PARAMETERS[3:]]
    sigma = [max(uncertainty.thrust_scale_fraction, 1e-9), max(uncertainty.thrust_slope, 1e-9), 1.0]  # may be stated 0
    if flight_forces.motor_speed is not None:
        columns.append(np.nan_to_num(forces[THRUST_BY_MOTOR_SPEED].to_numpy()))
        names.append(MOTOR_SPEED_ERROR)
        sigma.append(MOTOR_SPEED.least_pole_share)
    information, vector = np.diag(np.array(sigma) ** -2), np.zeros(len(sigma))
    for measured in stand_measurements(flight_forces.aircraft):
        row = measured.row(names)
        information, vector = information + np.outer(row, row), vector + row * measured.value / measured.sigma
    return -mean(np.column_stack(columns)), tuple(names), information, vector


def _smooth_in_runs(derivatives: Array, t_s: Array, run: NDArray[np.intp]) -> Array:
    """The derivatives (k, m) by a parabola of time in each run: what the gusts of a window make of them is left out."""
    smooth = derivatives.copy()
    for i in np.unique(run):
        rows = np.flatnonzero(run == i)
        powers = np.vander(t_s[rows] - t_s[rows].mean(), min(3, len(rows)))
        smooth[rows] = powers @ np.linalg.lstsq(powers, derivatives[rows], rcond=None)[0]
    return smooth


def _prior(balance: Balance) -> tuple[Array, Array]:
    """Information matrix and vector of polar, errors of thrust and directions of the path."""
    t, m = len(balance.names), balance.path.shape[1]
    information = np.zeros((3 + t + m, 3 + t + m))
    information[3 : 3 + t, 3 : 3 + t] = balance.information
    information[3 + t :, 3 + t :] = np.eye(m)
    return information, np.concatenate([np.zeros(3), balance.vector, np.zeros(m)])


def _most_probable_covariance(balance: Balance) -> tuple[Array, Unexplained]:
    """The covariance (k, k) of the errors of the balance, with what is unexplained by restricted likelihood."""
    from scipy.optimize import minimize  # here: most analyses do without it

    B = np.column_stack([balance.X, balance.thrust, balance.path])
    prior, vector = _prior(balance)
    same_run = balance.run[:, None] == balance.run
    apart_s = np.abs(balance.t_s[:, None] - balance.t_s)

    def covariance(unexplained: Unexplained) -> Array:
        correlated = unexplained.correlated_mps2**2 * np.exp(-apart_s / unexplained.time_s) * same_run
        return np.asarray(balance.by_states + correlated + unexplained.white_mps2**2 * np.eye(len(balance.Y)))

    def minus_2_log_likelihood(logarithms: Array) -> float:
        C = covariance(Unexplained(*np.exp(logarithms)))
        factor = np.linalg.cholesky(C)
        b, y = solve_triangular(factor, B, lower=True), solve_triangular(factor, balance.Y, lower=True)
        information = np.linalg.cholesky(b.T @ b + prior)
        right = b.T @ y + vector
        explained = right @ cho_solve((information, True), right)
        return float(y @ y - explained + 2 * np.log(np.diag(factor)).sum() + 2 * np.log(np.diag(information)).sum())

    scatter = float(np.std(balance.Y - balance.X @ np.linalg.lstsq(balance.X, balance.Y, rcond=None)[0]))
    longest_run_s = float(max(np.ptp(balance.t_s[balance.run == i]) for i in np.unique(balance.run)))
    # Noise that lasts much longer than a run is an error of each run of its own.
    shortest_s, longest_s = STEADY_POINTS.correlation_s / 2, 10 * max(longest_run_s, STEADY_POINTS.correlation_s)
    sizes = (np.log(1e-3 * scatter), np.log(10 * scatter))  # below the least, nothing is left that shows
    limits = [sizes, sizes, (np.log(shortest_s), np.log(longest_s))]
    start = np.log([scatter / 2, scatter / 2, np.sqrt(shortest_s * longest_s / 10)])
    found = minimize(minus_2_log_likelihood, start, bounds=limits, method="L-BFGS-B", options={"eps": 1e-3})
    unexplained = Unexplained(*np.exp(found.x).tolist())
    return covariance(unexplained), unexplained
