"""The parts that all methods share: the definition of a method, its application, and the form of its estimate.

A method turns a table (from `input_tables`) and runs into a linear regression for the drag polar. All methods solve it
in the same way, and propagate noise, sensor errors and trajectory errors in the same way.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.curve import Polar
from flightpower.analysis.maneuvers.kinds import Maneuver
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods.causes import CAUSES, ErrorEstimate, error_prior_sigma
from flightpower.analysis.methods.forces import FlightForces
from flightpower.analysis.methods.regression import PolarRegression, Tables, rows_of
from flightpower.analysis.methods.settings import REGRESSION
from flightpower.analysis.methods.thrust_prior import J_REFERENCE
from flightpower.analysis.records.flight import Cause
from flightpower.analysis.settings import FLOWN
from flightpower.analysis.sources.grid import rows_within
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.trajectory import dryden
from flightpower.analysis.trajectory.dryden import GaussMarkov
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS, NamedArrays
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2 as g

MEASURED = ("alpha_rad", "V_mps", "height_m", "static_Pa", "temperature_K", "propeller_covered")  # means of blocks
ALONG = ("V", "alpha", "gamma", "climb", "bank", "Vdot", "rho", "J")  # columns of the forces that tables contain


@dataclass(frozen=True)
class MethodInputs:
    """The runs of one flight, and tables (from `input_tables`) with the rows of those runs that the methods use.

    tables : the first is along the trajectory, without corrections; the next are along the trajectory perturbed by each
        independent error of one standard deviation; the next are each corrected for one of `errors`, as if it were one
        standard deviation large; the last are each corrected for the estimated errors of one of `causes`
    errors : names of `error_prior_sigma`
    """

    aircraft: Aircraft
    runs: list[Maneuver]
    tables: Tables
    errors: tuple[str, ...]
    causes: tuple[Cause, ...] = tuple(CAUSES)

    @cached_property
    def nominal(self) -> Tables:
        """The first table, which is along the trajectory without corrections."""
        return self.tables.first()


def method_inputs(
    flight_forces: FlightForces, trajectory: Trajectory, runs: list[Maneuver], errors: Mapping[str, ErrorEstimate]
) -> MethodInputs:
    """The tables of one flight. errors: from `estimate_errors`."""
    rows = np.flatnonzero(rows_within(flight_forces.t_s, [(run.start_s, run.end_s) for run in runs]))
    sigmas = error_prior_sigma(flight_forces.aircraft.uncertainty)
    flying = np.isfinite(flight_forces.block_means["V_mps"])
    height_m, V = (float(np.nanmedian(flight_forces.block_means[name][flying])) for name in ("height_m", "V_mps"))
    gusts = (
        dryden.vertical(trajectory.gust_mps, height_m, V / trajectory.gust_length).as_gauss_markov(),
        dryden.longitudinal(trajectory.gust_mps, height_m, V / trajectory.gust_length),
    )
    removed: list[Mapping[str, float]] = [{name: sigma} for name, sigma in sigmas.items()]
    removed += [{name: errors[name].value for name in names} for names in CAUSES.values()]
    perturbed = np.linalg.cholesky(trajectory.covariance).T
    along = [
        path_along(flight_forces, flight_forces.nominal, trajectory.sensor_errors, rows),
        *(_perturbed_path(flight_forces, trajectory, error, rows) for error in perturbed),
    ]
    along += [along[0]] * len(removed)
    tables = input_tables(flight_forces, along, [{}] * (1 + len(perturbed)) + removed, gusts)
    return MethodInputs(flight_forces.aircraft, runs, tables, tuple(sigmas))


class PathAlong(NamedTuple):
    """The data that methods use along a trajectory, in some rows of the flight's blocks.

    rows : (n,)     forces : columns (n,) of `FlightForces.forces` by name, with alpha_dot [rad/s], and the specific
        force ax, az [m/s^2] less the accelerometers' errors     sensor_errors : by name
    """

    rows: NDArray[np.intp]
    forces: Mapping[str, Array]
    sensor_errors: Mapping[str, float]


def path_along(
    flight_forces: FlightForces, forces: pd.DataFrame, sensor_errors: Array, rows: NDArray[np.intp]
) -> PathAlong:
    """The path with these forces (from `FlightForces.forces`) and sensor errors (len(SENSOR_ERRORS),)."""
    ax, az = flight_forces.corrected_force(NamedArrays(SENSOR_ERRORS, sensor_errors))
    columns = {name: forces[name].to_numpy() for name in (*ALONG, "theta", "n")}
    columns |= {"ax": ax, "az": az, "alpha_dot": np.gradient(columns["alpha"], flight_forces.t_s)}
    errors = dict(zip(SENSOR_ERRORS, sensor_errors.tolist(), strict=True))
    return PathAlong(rows, {name: column[rows] for name, column in columns.items()}, errors)


def _perturbed_path(
    flight_forces: FlightForces, trajectory: Trajectory, error: Array, rows: NDArray[np.intp]
) -> PathAlong:
    """The path if the sensor errors are larger by `error`, which the trajectory cannot exclude."""
    states, sensor_errors = trajectory.states.to_numpy(), trajectory.sensor_errors + error
    moved = trajectory.state_sensitivity.reshape(-1, len(error)) @ error
    forces = flight_forces.forces(states + moved.reshape(states.shape), sensor_errors)
    return path_along(flight_forces, forces, sensor_errors, rows)


def input_tables(
    flight_forces: FlightForces,
    along: Sequence[PathAlong],
    removed: Sequence[Mapping[str, float]],
    gusts: tuple[GaussMarkov, GaussMarkov],
) -> Tables:
    """The data that methods use, as a table for each of the k paths, with errors subtracted from measured quantities.

    removed : for each table, the errors to subtract, by names of `error_prior_sigma`
    gusts : vertical gusts and gusts along the flight path
    Columns along the path: V, alpha, gamma, climb, bank, Vdot, rho, J; specific force ax, az [m/s^2]; qS_over_m_mps2;
    thrust_x_over_m_mps2, which is the propeller table's thrust along body x.
    Columns as measured: alpha_measured [rad]; theta_measured [rad], a pitch attitude leveled by the accelerometer;
    height_measured [m]; V_measured [m/s], and qS_over_m and thrust_x_over_m computed from it; static_Pa [Pa];
    temperature_K [K]. Columns named "lagged" use the measured airspeed corrected for its estimated scale error, so that
    only the error of the air-data lag remains.
    covered: share of the block within the propeller table.
    gust_mps, gust_s, gust_along_mps, gust_along_s: standard deviations and correlation times of `gusts`, the same in
    all rows.
    """
    vertical_gust, longitudinal_gust = gusts
    rows, names = along[0].rows, [name for names in CAUSES.values() for name in names]
    e = {name: np.array([[of_table.get(name, 0.0)] for of_table in removed]) for name in names}
    errors = {name: np.array([[path.sensor_errors[name]] for path in along]) for name in ("V_scale", "ax_bias")}
    f = {name: np.stack([path.forces[name] for path in along]) for name in along[0].forces}
    mean = {name: flight_forces.block_means[name][rows] for name in MEASURED}
    m, S = flight_forces.aircraft.mass_kg, flight_forces.aircraft.geometry.wing_area_m2
    V, alpha, theta, Vdot, rho, n = (f[name] for name in ("V", "alpha", "theta", "Vdot", "rho", "n"))
    # Flow angles are computed from pressures over dynamic pressure, so the estimated airspeed scale corrects them too.
    alpha_measured = mean["alpha_rad"] + 2 * errors["V_scale"] * alpha
    alpha_measured = alpha_measured - e["alpha_bias"] - e["alpha_scale"] * alpha + e["lag"] * f["alpha_dot"]
    V_measured = mean["V_mps"] / (1 + e["airspeed_scale"]) + e["lag"] * Vdot
    V_lagged = mean["V_mps"] / (1 + errors["V_scale"]) + e["lag"] * Vdot
    tilt = errors["ax_bias"] / g - e["pitch"]

    def qS_over_m(V: Array) -> Array:
        return np.asarray(rho * V**2 / 2 * S / m)

    def thrust_over_m(V: Array) -> Array:
        table_N, _ = flight_forces.propeller.thrust_and_power(V, n, rho)
        J = V / (n * flight_forces.propeller.diameter_m)
        return np.asarray(table_N * (1 + e["thrust_scale"] + e["thrust_slope"] * (J - J_REFERENCE)) / m)

    columns = {
        **{name: f[name] for name in ALONG},
        "ax": f["ax"] + flight_forces.cov_az_alpha[rows],  # excludes the force of gusts
        "az": f["az"],
        "qS_over_m_mps2": qS_over_m(V),
        "thrust_x_over_m_mps2": thrust_over_m(V),
        "alpha_measured": alpha_measured,
        "theta_measured": theta + tilt / np.cos(theta),
        "height_measured": mean["height_m"] + e["lag"] * f["climb"],
        "V_measured": V_measured,
        "qS_over_m_measured_mps2": qS_over_m(V_measured),
        "thrust_x_over_m_measured_mps2": thrust_over_m(V_measured),
        "qS_over_m_lagged_mps2": qS_over_m(V_lagged),
        "thrust_x_over_m_lagged_mps2": thrust_over_m(V_lagged),
        "static_Pa": mean["static_Pa"],
        "temperature_K": mean["temperature_K"],
        "covered": mean["propeller_covered"],
        "gust_mps": np.full(len(rows), vertical_gust.sigma_mps),
        "gust_s": np.full(len(rows), vertical_gust.time_s),
        "gust_along_mps": np.full(len(rows), longitudinal_gust.sigma_mps),
        "gust_along_s": np.full(len(rows), longitudinal_gust.time_s),
    }
    return Tables(flight_forces.t_s[rows], columns)


class SteadyPoint(NamedTuple):
    """Lift and drag coefficient of one steady point, the standard error of the drag coefficient, and the start [s]."""

    CL: float
    CD: float
    CD_error: float
    start_s: float


@dataclass(frozen=True)
class MethodDescription:
    """A method for power required, without its computation.

    kinds : the kinds of runs that it uses
    taken_as_measured : the errors that it does not correct, by names of `error_prior_sigma`
    """

    name: str
    title: str
    equations: str
    kinds: tuple[str, ...]
    taken_as_measured: tuple[str, ...]


@dataclass(frozen=True)
class Method(MethodDescription):
    """A method that is a linear regression.

    regression : function of (table, runs, aircraft); raises InputError where the runs do not allow a regression
    points : function of (table, runs, aircraft) that gives the measured points; None for most methods
    two_term : whether its form lacks CL_minD
    """

    regression: Callable[[Tables, list[Maneuver], Aircraft], PolarRegression]
    points: Callable[[Tables, list[Maneuver], Aircraft], list[SteadyPoint]] | None = None
    two_term: bool = False


@dataclass(frozen=True)
class MethodEstimate:
    """A drag polar by one method, and the range of lift coefficients of its data.

    noise, systematic : the two parts of the polar's covariance (3, 3); systematic errors are common to all runs
    sensitivities : derivative of A (3,) with respect to each error of `Method.taken_as_measured`
    trajectory_deviations : (3, m) change of A by each independent trajectory error of one standard deviation
    cause_effects : the part of A (3,) that is due to the estimated errors of each cause
    polar : None where there is no estimate; `notes` then say why
    not_flown : the kinds of runs that the method needs, if none of them was flown
    """

    method: MethodDescription
    polar: Polar | None = None
    noise: Array = field(default_factory=lambda: np.zeros((3, 3)))
    systematic: Array = field(default_factory=lambda: np.zeros((3, 3)))
    sensitivities: dict[str, Array] = field(default_factory=dict)
    trajectory_deviations: Array = field(default_factory=lambda: np.zeros((3, 0)))
    cause_effects: dict[Cause, Array] = field(default_factory=dict)
    flown_CL: tuple[float, float] = (0.0, 0.0)
    points: tuple[SteadyPoint, ...] = ()
    notes: tuple[str, ...] = ()
    not_flown: tuple[str, ...] = ()


def estimate_with(method: Method, inputs: MethodInputs) -> MethodEstimate:
    """A method's estimate. If the flight lacks something that the method needs, it has a note instead of a polar."""
    runs = [run for run in inputs.runs if run.kind in method.kinds]
    if not runs:
        return not_flown(method)
    try:
        return _estimate(method, inputs, runs)
    except InputError as error:
        return MethodEstimate(method, notes=(str(error),))


def not_flown(method: MethodDescription) -> MethodEstimate:
    """An estimate without a polar, because no run of the kinds that the method needs was flown."""
    note = f"no run of the required kind was flown: {' or '.join(method.kinds)}"
    return MethodEstimate(method, not_flown=method.kinds, notes=(note,))


def _estimate(method: Method, inputs: MethodInputs, runs: list[Maneuver]) -> MethodEstimate:
    regression = method.regression(inputs.nominal, runs, inputs.aircraft)
    A, noise = regression.coefficients(), regression.noise_covariance()
    changes = method.regression(inputs.tables, runs, inputs.aircraft).coefficients() - A
    with_causes = len(changes) - len(inputs.causes)
    _, moved, by_errors, by_causes = np.split(changes, (1, with_causes - len(inputs.errors), with_causes))
    deviations = moved.T
    sigma = error_prior_sigma(inputs.aircraft.uncertainty)
    by_error = dict(zip(inputs.errors, by_errors, strict=True))
    sensitivities = {name: by_error[name] / sigma[name] for name in method.taken_as_measured}
    systematic = deviations @ deviations.T
    systematic = systematic + sum(_outer(s * sigma[name]) for name, s in sensitivities.items())
    systematic = systematic + covariance.floor()
    if method.two_term:
        systematic += _missing_term(regression.CL, A)
    cause_effects = {
        cause: -change
        for cause, change in zip(inputs.causes, by_causes, strict=True)
        if set(CAUSES[cause]) & set(method.taken_as_measured)
    }
    points = method.points(inputs.nominal, runs, inputs.aircraft) if method.points else []
    CL = regression.CL
    low, high = (CL.min(), CL.max()) if points else np.percentile(CL, FLOWN.robust_percentiles)
    return MethodEstimate(
        method,
        Polar(A, noise + systematic),
        noise,
        systematic,
        sensitivities,
        deviations,
        cause_effects,
        (float(low), float(high)),
        tuple(points),
        _notes(A, inputs.nominal, runs),
    )


def _outer(x: Array) -> Array:
    return np.outer(x, x)


def _missing_term(CL: Array, A: Array) -> Array:
    """Covariance (3, 3) of a fit of only A0 and A2 to a polar whose CL_minD has the size `REGRESSION.CL_minD_sigma`.

    By (3.36), CL_minD adds -2 K CL_minD CL to C_D. The fit lacks this term in A1 and changes A0 and A2 instead.
    """
    _, _, K = A
    A1 = -2 * K * REGRESSION.CL_minD_sigma
    X = np.stack([np.ones_like(CL), CL**2], axis=1)
    (A0, A2), *_ = np.linalg.lstsq(X, A1 * CL, rcond=None)
    return _outer(np.array([A0, -A1, A2]))


def _notes(A: Array, tables: Tables, runs: list[Maneuver]) -> tuple[str, ...]:
    notes = []
    _, _, A2 = A
    if A2 <= 0:
        notes.append("the drag polar curves downward in this fit: the range of lift coefficients flown is too narrow")
    covered = [tables.columns["covered"][rows_of(tables.t_s, run)] for run in runs]
    outside = 1 - float(np.nanmean(np.concatenate(covered)))
    if outside > STATISTICS.unmentioned_share:
        notes.append(f"{100 * outside:.0f} % of its data lie outside the propeller table")
    return tuple(notes)
