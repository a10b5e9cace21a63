"""What all methods have in common: what a method is, how it is applied, and what it estimates.

A method turns a table (of `method_inputs.input_table`) and runs into a linear regression for the drag polar. Solving
it and propagating noise, sensor errors and trajectory errors are the same for all methods.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.curve import Polar
from flightpower.analysis.maneuvers.kinds import Maneuver
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods.causes import CAUSES, ErrorEstimate, error_prior_sigma
from flightpower.analysis.methods.forces import FlightForces
from flightpower.analysis.methods.regression import PolarRegression
from flightpower.analysis.methods.settings import REGRESSION
from flightpower.analysis.methods.thrust_prior import J_REFERENCE
from flightpower.analysis.records.flight import Cause
from flightpower.analysis.settings import FLOWN
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.trajectory import dryden
from flightpower.analysis.trajectory.dryden import GaussMarkov
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS, NamedArrays
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2 as g


@dataclass(frozen=True)
class MethodInputs:
    """The runs of one flight and the tables (of `input_table`) that methods are applied to.

    nominal : along the trajectory, nothing corrected
    trajectory_deviations : along the trajectory perturbed by each independent error of one standard deviation
    error_deviations : with each error of `error_prior_sigma` removed, as if it were one standard deviation
    cause_corrected : with the estimated errors of each of CAUSES removed
    """

    aircraft: Aircraft
    runs: list[Maneuver]
    nominal: pd.DataFrame
    trajectory_deviations: list[pd.DataFrame]
    error_deviations: dict[str, pd.DataFrame]
    cause_corrected: dict[str, pd.DataFrame]


def method_inputs(
    flight_forces: FlightForces, trajectory: Trajectory, runs: list[Maneuver], errors: Mapping[str, ErrorEstimate]
) -> MethodInputs:
    """The tables of one flight. errors: from `estimate_errors`."""
    states, sensor_errors = trajectory.states.to_numpy(), trajectory.sensor_errors
    perturbed = [
        (flight_forces.forces(states + trajectory.state_sensitivity @ error, sensor_errors + error), error)
        for error in np.linalg.cholesky(trajectory.covariance).T
    ]
    sigmas = error_prior_sigma(flight_forces.aircraft.uncertainty)
    flying = np.isfinite(flight_forces.block_means["V_mps"])
    height_m, V = (float(np.nanmedian(flight_forces.block_means[name][flying])) for name in ("height_m", "V_mps"))
    gusts = (
        dryden.vertical(trajectory.gust_mps, height_m, V / trajectory.gust_length).as_gauss_markov(),
        dryden.longitudinal(trajectory.gust_mps, height_m, V / trajectory.gust_length),
    )

    def corrected(removed: Mapping[str, float]) -> pd.DataFrame:
        return input_table(flight_forces, flight_forces.nominal, sensor_errors, removed, gusts)

    return MethodInputs(
        flight_forces.aircraft,
        runs,
        corrected({}),
        [input_table(flight_forces, forces, sensor_errors + error, {}, gusts) for forces, error in perturbed],
        {name: corrected({name: sigma}) for name, sigma in sigmas.items()},
        {cause: corrected({name: errors[name].value for name in names}) for cause, names in CAUSES.items()},
    )


def input_table(
    flight_forces: FlightForces,
    f: pd.DataFrame,
    sensor_errors: Array,
    removed: Mapping[str, float],
    gusts: tuple[GaussMarkov, GaussMarkov],
) -> pd.DataFrame:
    """The data that methods work on, one row per block, with the errors `removed` subtracted from measured quantities.

    f: of `FlightForces.forces`, along a trajectory with sensor errors (len(SENSOR_ERRORS),). From it V, alpha, gamma,
    climb, bank, Vdot, rho, J; specific force ax, az [m/s^2]; qS_over_m_mps2; thrust_x_over_m_mps2, the thrust of the
    table along body x.
    As measured: alpha_measured [rad]; theta_measured [rad], pitch attitude leveled by the accelerometer;
    height_measured [m]; V_measured [m/s], with the qS_over_m and thrust_x_over_m computed from it; static_Pa [Pa],
    temperature_K [K]. lagged: airspeed as measured with its estimated scale error corrected, so that only the error by
    air-data lag remains.
    covered: share of the block within the propeller table.
    Standard deviation and correlation time of vertical gusts (gust_mps, gust_s) and of those along the flight path
    (gust_along_mps, gust_along_s), the same in all rows. gusts: these two.
    """
    vertical_gust, longitudinal_gust = gusts
    e = {name: removed.get(name, 0.0) for names in CAUSES.values() for name in names}
    errors = dict(zip(SENSOR_ERRORS, sensor_errors, strict=True))
    ax, az = flight_forces.corrected_force(NamedArrays(SENSOR_ERRORS, sensor_errors))
    mean, m = flight_forces.block_means, flight_forces.aircraft.mass_kg
    V, alpha, theta, Vdot = (f[name].to_numpy() for name in ("V", "alpha", "theta", "Vdot"))
    rho, climb = f["rho"].to_numpy(), f["climb"].to_numpy()
    # Flow angles are pressures over dynamic pressure: the estimated airspeed scale corrects them too.
    alpha_measured = mean["alpha_rad"] + 2 * errors["V_scale"] * alpha
    alpha_measured = (
        alpha_measured - e["alpha_bias"] - e["alpha_scale"] * alpha + e["lag"] * np.gradient(alpha, flight_forces.t_s)
    )
    V_measured = mean["V_mps"] / (1 + e["airspeed_scale"]) + e["lag"] * Vdot
    V_lagged = mean["V_mps"] / (1 + errors["V_scale"]) + e["lag"] * Vdot
    tilt = errors["ax_bias"] / g - e["pitch"]
    n, S = f["n"].to_numpy(), flight_forces.aircraft.geometry.wing_area_m2

    def qS_over_m(V: Array) -> Array:
        return np.asarray(rho * V**2 / 2 * S / m)

    def thrust_over_m(V: Array) -> Array:
        table_N, _ = flight_forces.propeller.thrust_and_power(V, n, rho)
        J = V / (n * flight_forces.propeller.diameter_m)
        return np.asarray(table_N * (1 + e["thrust_scale"] + e["thrust_slope"] * (J - J_REFERENCE)) / m)

    columns = {
        **{name: f[name].to_numpy() for name in ("V", "alpha", "gamma", "climb", "bank", "Vdot", "rho", "J")},
        "ax": ax + flight_forces.cov_az_alpha,  # without the push by gusts
        "az": az,
        "qS_over_m_mps2": qS_over_m(V),
        "thrust_x_over_m_mps2": thrust_over_m(V),
        "alpha_measured": alpha_measured,
        "theta_measured": theta + tilt / np.cos(theta),
        "height_measured": mean["height_m"] + e["lag"] * climb,
        "V_measured": V_measured,
        "qS_over_m_measured_mps2": qS_over_m(V_measured),
        "thrust_x_over_m_measured_mps2": thrust_over_m(V_measured),
        "qS_over_m_lagged_mps2": qS_over_m(V_lagged),
        "thrust_x_over_m_lagged_mps2": thrust_over_m(V_lagged),
        "static_Pa": mean["static_Pa"],
        "temperature_K": mean["temperature_K"],
        "covered": mean["propeller_covered"],
        "gust_mps": vertical_gust.sigma_mps,
        "gust_s": vertical_gust.time_s,
        "gust_along_mps": longitudinal_gust.sigma_mps,
        "gust_along_s": longitudinal_gust.time_s,
    }
    return pd.DataFrame(columns, index=f.index)


class SteadyPoint(NamedTuple):
    """Lift and drag coefficient of one steady point, the standard error of the latter, and its start."""

    CL: float
    CD: float
    CD_error: float
    start_s: float


@dataclass(frozen=True)
class MethodDescription:
    """One way to power required.

    kinds : of runs that it uses
    taken_as_measured : the errors that it does not correct, names of `error_prior_sigma`
    """

    name: str
    title: str
    equations: str
    kinds: tuple[str, ...]
    taken_as_measured: tuple[str, ...]


@dataclass(frozen=True)
class Method(MethodDescription):
    """A method that is a linear regression.

    regression : of (table, runs, aircraft); raises InputError where the runs do not allow one
    points : of (table, runs, aircraft); the measured points, None for most methods
    two_term : its form lacks CL_minD
    """

    regression: Callable[[pd.DataFrame, list[Maneuver], Aircraft], PolarRegression]
    points: Callable[[pd.DataFrame, list[Maneuver], Aircraft], list[SteadyPoint]] | None = None
    two_term: bool = False


@dataclass(frozen=True)
class MethodEstimate:
    """A drag polar by one method, and the range of lift coefficients of its data.

    noise, systematic : the two parts of the polar's covariance (3, 3); systematic is common to all runs
    sensitivities : derivative of A (3,) by each error of `Method.taken_as_measured`
    trajectory_deviations : (3, m) change of A with each independent trajectory error of one standard deviation
    cause_effects : the part of A (3,) that is due to the estimated errors of each of CAUSES
    polar : None where there is no estimate; `notes` then say why     not_flown : kinds of runs, where none was flown
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
    """A method's estimate. Where the flight lacks something it needs, the estimate has no polar but a note."""
    runs = [run for run in inputs.runs if run.kind in method.kinds]
    if not runs:
        return not_flown(method)
    try:
        return _estimate(method, inputs, runs)
    except InputError as error:
        return MethodEstimate(method, notes=(str(error),))


def not_flown(method: MethodDescription) -> MethodEstimate:
    """No estimate, because no run was flown of any kind that the method takes."""
    note = f"no run of the required kind was flown: {' or '.join(method.kinds)}"
    return MethodEstimate(method, not_flown=method.kinds, notes=(note,))


def _estimate(method: Method, inputs: MethodInputs, runs: list[Maneuver]) -> MethodEstimate:
    def coefficients(table: pd.DataFrame) -> Array:
        return method.regression(table, runs, inputs.aircraft).coefficients()

    regression = method.regression(inputs.nominal, runs, inputs.aircraft)
    A, noise = regression.coefficients(), regression.noise_covariance()
    deviations = np.stack([coefficients(table) - A for table in inputs.trajectory_deviations], axis=1)
    sigma = error_prior_sigma(inputs.aircraft.uncertainty)
    sensitivities = {
        name: (coefficients(inputs.error_deviations[name]) - A) / sigma[name] for name in method.taken_as_measured
    }
    systematic = deviations @ deviations.T
    systematic = systematic + sum(_outer(s * sigma[name]) for name, s in sensitivities.items())
    systematic = systematic + covariance.floor()
    if method.two_term:
        systematic += _missing_term(regression.CL, A)
    cause_effects = {
        cause: A - coefficients(inputs.cause_corrected[cause])
        for cause, names in CAUSES.items()
        if set(names) & set(method.taken_as_measured)
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
    """Covariance (3, 3) of a fit of A0 and A2 alone to a polar that has a CL_minD, of `REGRESSION.CL_minD_sigma`.

    (3.36): CL_minD adds -2 K CL_minD CL to C_D; the fit takes it for a change of A0 and A2, and lacks it in A1.
    """
    _, _, K = A
    A1 = -2 * K * REGRESSION.CL_minD_sigma
    X = np.stack([np.ones_like(CL), CL**2], axis=1)
    (A0, A2), *_ = np.linalg.lstsq(X, A1 * CL, rcond=None)
    return _outer(np.array([A0, -A1, A2]))


def _notes(A: Array, table: pd.DataFrame, runs: list[Maneuver]) -> tuple[str, ...]:
    notes = []
    _, _, A2 = A
    if A2 <= 0:
        notes.append("the drag polar curves downward in this fit: the range of lift coefficients flown is too narrow")
    covered = pd.concat([table.loc[run.start_s : run.end_s, "covered"] for run in runs])
    outside = 1 - float(covered.mean())
    if outside > STATISTICS.unmentioned_share:
        notes.append(f"{100 * outside:.0f} % of its data lie outside the propeller table")
    return tuple(notes)
