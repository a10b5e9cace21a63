"""The dynamic method: drag polar from accelerations and decelerations, in two steps.

It is named for its data, which come from dynamic maneuvers instead of steady points. First the trajectory and the
sensor errors are reconstructed over the whole flight; then drag along the trajectory is regressed on lift. All runs of
a flight are fitted at once, because their aerodynamics and sensor errors are the same.

The uncertainty of the trajectory is propagated into the covariance of the polar. Each independent direction of the
sensor errors' covariance is passed through trajectory and regression. The covariance of the state errors, which are not
common to the runs, is propagated by the derivatives of the regression (`consider.noise_covariance`). Without these two
parts, the 95 % interval from one deceleration covered the truth in only 75 to 85 % of simulated flights at its lowest
speeds.

A gust near the stall raises the angle of attack above that of level flight, where drag is no longer a parabola of lift.
Such samples are left out. With them, power at 1.1 V_stall was overestimated by 1.1 % at W20 = 15 kt (200 flights).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.curve import POLAR, Polar, polar_part
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.fit import Convergence, Fit
from flightpower.analysis.estimation.model import Model, NamedValues, Parameter
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.maneuvers.kinds import Maneuver
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods import motor_lag, motor_speed
from flightpower.analysis.methods.consider import JointEstimate, joint_estimate, noise_covariance
from flightpower.analysis.methods.forces import THRUST_BY_MOTOR_SPEED, THRUST_RATE, FlightForces, MotorSpeedError
from flightpower.analysis.methods.regression import rows_of
from flightpower.analysis.methods.rejected_assumptions import Assumption, rejected_assumptions
from flightpower.analysis.methods.settings import MOTOR_SPEED, REGRESSION
from flightpower.analysis.methods.thrust_prior import J_REFERENCE, THRUST, stand_measurements
from flightpower.analysis.records.flight import CurveStatus, ParameterResult
from flightpower.analysis.settings import EVIDENCE, FLOWN
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.observability import SENSOR_ERROR_KINDS
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.propeller import FOLD, WINDMILL, Propeller
from flightpower.flight.units import GRAVITY_MPS2


def _drag(_: NamedValues, u: NamedValues, p: NamedValues) -> Sequence[Any]:
    """Drag over mass [m/s^2] as computed from specific force with the uncorrected propeller table.

    The true thrust is the table's times 1 + thrust_scale + thrust_slope (J - J_REFERENCE), plus, beyond the table's
    last J, thrust_beyond standard deviations of its continuation. Where true thrust exceeds the table's, the computed
    drag is smaller than the true drag by the difference of the two thrusts along the flight path.
    """
    drag_over_m = u.qS_over_m * (p.A0 + p.A1 * u.CL + p.A2 * u.CL_squared)
    excess = u.thrust_along_V_over_m * (p.thrust_scale + p.thrust_slope * (u.J - J_REFERENCE))
    return (drag_over_m - excess - u.thrust_beyond_over_m * p.thrust_beyond,)


# Inputs of the model, and the columns of `FlightForces.forces` that they come from.
INPUTS = {
    "CL": "CL",
    "CL_squared": "CL_squared",
    "qS_over_m": "qS_over_m_mps2",
    "thrust_along_V_over_m": "thrust_along_V_over_m_mps2",
    "thrust_beyond_over_m": "thrust_beyond_over_m_mps2",
    "J": "J",
}
KEPT = len(POLAR + THRUST)  # parameters in the estimate; thrust beyond the table only contributes to their covariance


def drag_model(aircraft: Aircraft) -> Model:
    """The regression model of drag on lift, with thrust as uncertain as the aircraft file states."""
    uncertainty = aircraft.uncertainty
    return Model(
        name="drag",
        inputs=tuple(INPUTS),
        outputs=("drag",),
        output_function=_drag,
        parameters=(
            Parameter(name="A0", start=0.04),
            Parameter(name="A1", start=0.0),
            Parameter(name="A2", start=0.06),
            Parameter(name="thrust_scale", start=0.0, prior_sigma=uncertainty.thrust_scale_fraction),
            Parameter(name="thrust_slope", start=0.0, prior_sigma=uncertainty.thrust_slope),
            Parameter(name="thrust_beyond", start=0.0, prior_sigma=1.0),
        ),
        prior_measurements=stand_measurements(aircraft),
    )


TRAJECTORY_DID_NOT_CONVERGE = "the trajectory did not converge"


SPEED_TITLE, DRAG_TITLE = "V, m/s", "drag / mass, m/s²"


class RunFit(NamedTuple):
    """Measured and modeled quantities (n,) of one run at times t_s (n,), by name and unit."""

    run: str
    t_s: Array
    measured: dict[str, Array]
    modeled: dict[str, Array]


class RunShares(NamedTuple):
    """The normal equations of the regression at its solution, by run. They give the curve without some of the runs.

    information : (m, m) of all runs and priors     by_run : S^T S (m, m) and S^T e (m,), whitened, by name of the run
    noise_factor : ratio of the polar's noise covariance to the inverse of `information`, due to colored residuals
    """

    information: Array
    by_run: dict[str, tuple[Array, Array]]
    noise_factor: float


@dataclass(frozen=True)
class DynamicEstimate:
    """A drag polar with its covariance, and data for the report.

    `joint`, `convergence` and `shares` are None, and `other_blades_gain` is 0, if another method gave the estimate.
    verdict : reason why the estimation ended, in words
    values : (5,) of POLAR and THRUST
    noise, systematic : the parts (5, 5) of their covariance due to noise and to errors common to all runs
    joint : the estimate together with the sensor errors, for the joint estimate of several flights
    convergence : of the regression of drag     shares : contributions of the runs
    other_blades_gain : gain of the log likelihood if the blades fold beyond zero thrust although they are assumed to
        windmill, or the other way around; 0 where no run has such thrust
    """

    polar: Polar
    parameters: list[ParameterResult]
    status: CurveStatus
    verdict: str
    warnings: list[str]
    fits: list[RunFit]
    values: Array
    noise: Array
    systematic: Array
    joint: JointEstimate | None = None
    convergence: Convergence | None = None
    shares: RunShares | None = None
    other_blades_gain: float = 0.0


class _Nominal(NamedTuple):
    """The fit along the trajectory, and a mask (n,) of samples in level flight. miscounted: the error of motor speed
    for which the forces are corrected, in standard errors; 0 if there is none. as_measured: the estimate without
    corrections for this error and for a lag of the motor speed; None if neither is corrected."""

    flight_forces: FlightForces
    level: NDArray[np.bool_]
    fit: Fit
    miscounted: float = 0.0
    as_measured: Array | None = None


def estimate_polar(
    trajectory: Trajectory, runs: list[Maneuver], aircraft: Aircraft, propeller: Propeller
) -> DynamicEstimate:
    """Fit all runs at once along the reconstructed trajectory."""
    states, sensor_errors = trajectory.states.to_numpy(), trajectory.sensor_errors
    nominal = _nominal(FlightForces(trajectory, aircraft, propeller), runs)
    flight_forces, level, fit, miscounted, as_measured = nominal
    forces, model = flight_forces.nominal, fit.model

    def segments_along(states: Array, sensor_errors: Array = sensor_errors) -> list[Segment]:
        return _segments(flight_forces.forces(states, sensor_errors), level, runs)

    noise = noise_covariance(fit, trajectory, segments_along)
    systematic = np.zeros_like(noise)
    by_sensor_errors = []
    for error in np.linalg.cholesky(trajectory.covariance).T:
        perturbed = segments_along(states + trajectory.state_sensitivity @ error, sensor_errors + error)
        by_sensor_errors.append(np.asarray(fit_output_error(model, perturbed).values - fit.values))
        systematic += np.outer(by_sensor_errors[-1], by_sensor_errors[-1])

    def values_of(forces: pd.DataFrame) -> Array:
        return _fitted(model, forces, level, runs).values

    changes = covariance.changes(values_of, fit.values, flight_forces)
    by_density = covariance.by_density(values_of, fit.values, flight_forces)
    changes[covariance.DENSITY] = covariance.at_nominal_density(fit.values + by_density, aircraft) - fit.values
    rejected = rejected_assumptions(fit)
    changes |= {str(rejected_assumption.assumption): rejected_assumption.change for rejected_assumption in rejected}
    if as_measured is not None:  # the defect may be another, so the interval also contains the uncorrected curve
        without = np.pad(as_measured, (0, len(fit.values) - len(as_measured)))
        changes[str(Assumption.MOTOR_SPEED)] = (fit.values - without) / NORMAL_95
    values = fit.values
    for by_error in changes.values():
        systematic += np.outer(by_error, by_error)
    prior_sigma = np.array([parameter.prior_sigma for parameter in model.parameters])
    joint = joint_estimate(fit, noise, prior_sigma, np.stack(by_sensor_errors, axis=1), trajectory)
    joint = joint.with_changes(changes)._replace(prior_measurements=model.prior_measurements)
    # Several flights are compared at one density, so `joint` keeps the errors of density and airspeed scale together.
    joint = joint.with_density_error(by_density, covariance.airspeed_scale_by_density(aircraft))
    if flight_forces.motor_speed is not None:
        joint = joint.with_value(motor_speed.PARAMETER, flight_forces.motor_speed.share)
    values, noise, systematic = values[:KEPT], noise[:KEPT, :KEPT], systematic[:KEPT, :KEPT]
    total = noise + systematic
    warnings = [rejected_assumption.warning for rejected_assumption in rejected]
    if flight_forces.motor_speed is not None:
        warnings.append(_miscounted_note(flight_forces.motor_speed, miscounted))
    if not (fit.verdict.ok and trajectory.converged):
        ended = "converged" if trajectory.converged else "not converged"
        warnings.append(f"The estimation did not converge. Drag polar: {fit.verdict.text}; trajectory: {ended}.")
    share_left_out = float(
        np.mean([np.isnan(segment_fit.segment.z["drag"]).mean() for segment_fit in fit.segment_fits])
    )
    if share_left_out > STATISTICS.unmentioned_share:
        warnings.append(
            f"During {100 * share_left_out:.0f} % of the time of the runs gusts raised the angle of attack"
            " beyond that of level flight, towards the stall, where drag exceeds the parabolic polar. These moments"
            " were left out."
        )
    return DynamicEstimate(
        polar=Polar(polar_part(values), polar_part(total)),
        parameters=parameter_list(values, total, trajectory),
        status=_status(fit, trajectory),
        verdict=fit.verdict.text if trajectory.converged else TRAJECTORY_DID_NOT_CONVERGE,
        warnings=warnings,
        fits=_run_fits(flight_forces, forces, trajectory, fit),
        values=values,
        noise=noise,
        systematic=systematic,
        joint=joint,
        convergence=fit.convergence,
        shares=_run_shares(fit, polar_part(noise)),
        other_blades_gain=_other_blades_gain(nominal, runs),
    )


def _other_blades_gain(nominal: _Nominal, runs: list[Maneuver]) -> float:
    """Compute `DynamicEstimate.other_blades_gain`."""
    forces, propeller = nominal.flight_forces, nominal.flight_forces.propeller
    thrust = np.concatenate(
        [segment_fit.segment.u["thrust_along_V_over_m"] for segment_fit in nominal.fit.segment_fits]
    )
    if not np.mean(thrust < 0) > STATISTICS.unmentioned_share:
        return 0.0
    other = propeller.with_beyond_zero_thrust(WINDMILL if propeller.beyond_zero_thrust == FOLD else FOLD)
    with_other = FlightForces(forces.trajectory, forces.aircraft, other, motor_speed=forces.motor_speed)
    fit = _fitted(nominal.fit.model, with_other.nominal, nominal.level, runs)
    return float(nominal.fit.negative_log_likelihood - fit.negative_log_likelihood)


def _run_shares(fit: Fit, polar_noise: Array) -> RunShares:
    """The normal equations of a fit, by run. polar_noise : (3, 3), the noise part of the polar's covariance"""
    by_run = {}
    for segment_fit in fit.segment_fits:
        weight = np.sqrt(segment_fit.white.weight)
        S = np.zeros((weight.size, len(fit.values)))
        S[:, segment_fit.columns] = (weight[..., None] * segment_fit.white.S).reshape(weight.size, -1)
        by_run[segment_fit.segment.name] = (S.T @ S, S.T @ (weight * segment_fit.white.e).ravel())
    information = fit.information + fit.prior_information
    white_noise = np.linalg.inv(information)[:3, :3]
    return RunShares(information, by_run, float(np.trace(np.linalg.solve(white_noise, polar_noise))) / 3)


def _miscounted_note(error: MotorSpeedError, standard_errors: float) -> str:
    where = "at every speed" if error.by_poles else f"above {error.above_revps:.0f} rev/s"
    return (
        f"The motor turns {abs(100 * error.share):.1f} % {'faster' if error.share > 0 else 'slower'} than counted"
        f" {where}, {abs(standard_errors):.0f} standard errors. The curve is corrected for it. Check"
        " `propulsion.pole_pairs` and the pulses of the motor."
    )


def _status(fit: Fit, trajectory: Trajectory) -> CurveStatus:
    if not trajectory.converged:
        return CurveStatus.TRAJECTORY_NOT_CONVERGED
    return CurveStatus.CONVERGED if fit.verdict.ok else CurveStatus.NOT_CONVERGED


def estimate_values(trajectory: Trajectory, runs: list[Maneuver], aircraft: Aircraft, propeller: Propeller) -> Array:
    """The `values` (5,) of `estimate_polar`, without computing their covariance."""
    nominal = _nominal(FlightForces(trajectory, aircraft, propeller), runs)
    return nominal.fit.values[:KEPT]


def _nominal(counted: FlightForces, runs: list[Maneuver]) -> _Nominal:
    """Fit the drag model, with a lag or an error of motor speed as a parameter if the runs clearly show it."""
    level = _within_level_flight(counted.nominal, _airborne(counted), runs)
    model = drag_model(counted.aircraft)
    as_counted = _Nominal(counted, level, _fitted(model, counted.nominal, level, runs))
    as_measured = as_counted.fit.values
    with_lag = motor_lag.with_motor_lag(model)
    late = _fitted(with_lag, counted.nominal, level, runs)
    if motor_lag.beyond_doubt(late):
        model, as_counted = with_lag, as_counted._replace(fit=late, as_measured=as_measured)
    suspect = motor_speed.suspect(as_counted.fit, counted)
    if suspect is None:
        return as_counted
    error, with_speed = suspect._replace(share=0.0), motor_speed.with_motor_speed(model)
    for _ in range(5):  # Gauss-Newton steps, because thrust varies as the square of motor speed
        forces = FlightForces(counted.trajectory, counted.aircraft, counted.propeller, motor_speed=error)
        fit = _fitted(with_speed, forces.nominal, level, runs)
        left, standard_error = motor_speed.value_and_error(fit, motor_speed.PARAMETER)
        total = (1 + error.share) * (1 + left) - 1
        least = MOTOR_SPEED.least_pole_share if error.by_poles else EVIDENCE.negligible
        if abs(total) < max(least, MOTOR_SPEED.least_errors * standard_error):
            return as_counted
        error = error._replace(share=total)
    return _Nominal(forces, level, fit, total / standard_error, as_measured)


def _fitted(model: Model, forces: pd.DataFrame, level: NDArray[np.bool_], runs: list[Maneuver]) -> Fit:
    return fit_output_error(model, _segments(forces, level, runs))


def parameter_list(values: Array, covariance: Array, trajectory: Trajectory) -> list[ParameterResult]:
    """Name, value, standard error and unit of POLAR and THRUST, and of the sensor errors of the trajectory."""
    errors = np.sqrt(np.diag(covariance))
    parameters = [
        ParameterResult(name=name, value=float(value), standard_error=float(error), unit="")
        for name, value, error in zip(POLAR + THRUST, values, errors, strict=True)
    ]
    return parameters + [
        ParameterResult(
            name=name,
            value=trajectory.value(name),
            standard_error=trajectory.standard_error(name),
            unit=SENSOR_ERROR_KINDS[name].unit,
        )
        for name in SENSOR_ERRORS
    ]


def _airborne(flight_forces: FlightForces) -> NDArray[np.bool_]:
    means = flight_forces.block_means
    return np.asarray((means["height_m"] > means.least_height_m) & (means["flying"] == 1))


def _within_level_flight(forces: pd.DataFrame, airborne: NDArray[np.bool_], runs: list[Maneuver]) -> NDArray[np.bool_]:
    """Mark samples whose angle of attack is at most `REGRESSION.level_margin_rad` above the largest of level flight.

    That largest angle comes from a straight line fitted to alpha over CL of this flight, at the largest lift
    coefficient that level flight requires at the speeds of the flight or of the runs.
    """
    flown = forces.loc[airborne, ["CL", "alpha", "qS_over_m_mps2"]].dropna()
    if len(flown) < REGRESSION.fewest_blocks:
        return np.ones(len(forces), dtype=bool)
    slope, offset = np.polyfit(flown["CL"], flown["alpha"], 1)
    CL_level = GRAVITY_MPS2 / forces["qS_over_m_mps2"]
    in_runs = pd.concat([CL_level.loc[run.start_s : run.end_s] for run in runs])
    largest_CL = max(np.nanpercentile(CL, FLOWN.robust_percentiles[1]) for CL in (CL_level[airborne], in_runs))
    return np.asarray(~(forces["alpha"].to_numpy() > offset + slope * largest_CL + REGRESSION.level_margin_rad))


def _segments(forces: pd.DataFrame, level: NDArray[np.bool_], runs: list[Maneuver]) -> list[Segment]:
    """The data of each run; drag is NaN where the angle of attack is larger than in level flight."""
    forces = forces.assign(CD=forces["CD"].where(level))
    segments = []
    t_s = forces.index.to_numpy()
    inputs = INPUTS | {name: name for name in (THRUST_RATE, THRUST_BY_MOTOR_SPEED) if name in forces}
    table = np.stack([forces[name].to_numpy() for name in (*inputs.values(), "CD")])
    for run in runs:
        rows = rows_of(t_s, run)
        measured = table[:, rows]
        data = measured
        if np.isnan(measured).any():
            data = pd.DataFrame(measured.T).interpolate(limit_direction="both").to_numpy().T
        if data.shape[1] >= REGRESSION.fewest_blocks and np.isfinite(data).all():
            u = dict(zip(inputs, data, strict=False))
            z = {"drag": u["qS_over_m"] * measured[-1]}
            segments.append(Segment(name=run.name, t_s=t_s[rows], u=u, z=z))
    return segments


def _run_fits(flight_forces: FlightForces, forces: pd.DataFrame, trajectory: Trajectory, fit: Fit) -> list[RunFit]:
    """Speed, angle of attack, height and drag of each run, as measured and as trajectory and fit predict them."""
    scale, slope, bias = (trajectory.value(name) for name in ("V_scale", "alpha_scale", "alpha_bias"))
    fits = []
    for segment in (segment_fit.segment for segment_fit in fit.segment_fits):
        rows = (forces.index >= segment.t_s[0]) & (forces.index <= segment.t_s[-1])
        run, states = forces[rows], trajectory.states[rows]
        by_slope = flight_forces.block_means["dalpha_dlndp_alpha_rad"][rows]
        alpha = run["alpha"].to_numpy() + (slope - 2 * scale) * by_slope + bias
        measured = {
            SPEED_TITLE: flight_forces.block_means["V_mps"][rows],
            "α, deg": np.degrees(flight_forces.block_means["alpha_rad"][rows]),
            "height, m": flight_forces.block_means["height_m"][rows],
            DRAG_TITLE: segment.z["drag"],
        }
        modeled = {
            SPEED_TITLE: run["V"].to_numpy() * (1 + scale),
            "α, deg": np.degrees(alpha),
            "height, m": states["height"].to_numpy(),
            DRAG_TITLE: fit.responses[segment.name].y[:, 0],
        }
        fits.append(RunFit(segment.name, segment.t_s, measured, modeled))
    return fits
