"""Estimates of one flight by all methods and from each run alone, pairs that disagree, and the curve by a fallback."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from flightpower.analysis.curve import Condition, Polar, drag_and_error, unphysical
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.maneuvers.kinds import LEVEL_RUNS, Maneuver
from flightpower.analysis.methods.causes import ErrorEstimate, estimate_errors
from flightpower.analysis.methods.comparison import disagreements
from flightpower.analysis.methods.dynamic import TRAJECTORY_DID_NOT_CONVERGE, DynamicEstimate, parameter_list
from flightpower.analysis.methods.forces import FlightForces
from flightpower.analysis.methods.method import Method, MethodEstimate, MethodInputs, estimate_with, method_inputs
from flightpower.analysis.methods.methods_from_runs import (
    ACCELERATIONS,
    DECELERATIONS,
    DIRECT,
    ENERGY,
    FROM_SPEED,
    ONE_RUN,
    VARIED_LIFT,
)
from flightpower.analysis.methods.steady_points import PIW_VIW_THREE, PIW_VIW_TWO, W_DELTA, W_DELTA_SLOW
from flightpower.analysis.methods.thrust_prior import THRUST, thrust_prior
from flightpower.analysis.records.flight import CurveStatus, DisagreementResult, MethodRejection, MethodTried
from flightpower.analysis.settings import CURVES
from flightpower.analysis.sources.grid import rows_within
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller import Propeller
from flightpower.flight.runs import ACCELERATION, DECELERATION

ALL_METHODS: tuple[Method, ...] = (
    PIW_VIW_THREE, PIW_VIW_TWO, W_DELTA, W_DELTA_SLOW, DIRECT, FROM_SPEED, VARIED_LIFT, ENERGY, ACCELERATIONS,
    DECELERATIONS,
)  # fmt: skip


class MethodEstimates(NamedTuple):
    """The estimates of all methods. single_runs: estimates from each acceleration and deceleration alone"""

    by_method: list[MethodEstimate]
    single_runs: list[MethodEstimate]
    disagreements: list[DisagreementResult]


def every_method(
    trajectory: Trajectory,
    runs: list[Maneuver],
    aircraft: Aircraft,
    propeller: Propeller,
    condition: Condition,
    *,
    dynamic: DynamicEstimate | None = None,
    dynamic_CL: tuple[float, float] = (0.0, 0.0),
) -> MethodEstimates:
    """Apply ALL_METHODS to runs of any kind and to each run alone, and compare them at one weight and density.

    dynamic: None if the flight has no run for it, or it is not to be compared. dynamic_CL: its lift coefficients.
    """
    inputs, errors = _inputs(FlightForces(trajectory, aircraft, propeller), runs)
    by_method = [estimate_with(method, inputs) for method in ALL_METHODS]
    differ = disagreements(dynamic, dynamic_CL, by_method, errors, condition)
    return MethodEstimates(by_method, _single_run_estimates(ONE_RUN, inputs), differ)


def _inputs(flight_forces: FlightForces, runs: list[Maneuver]) -> tuple[MethodInputs, dict[str, ErrorEstimate]]:
    t, trajectory = flight_forces.t_s, flight_forces.trajectory
    in_level_runs = rows_within(t, [(run.start_s, run.end_s) for run in runs if run.kind in LEVEL_RUNS])
    errors = estimate_errors(flight_forces, trajectory, in_level_runs)
    kinds = {kind for method in (*ALL_METHODS, ONE_RUN) for kind in method.kinds}
    return method_inputs(flight_forces, trajectory, [run for run in runs if run.kind in kinds], errors), errors


def _single_run_estimates(method: Method, inputs: MethodInputs) -> list[MethodEstimate]:
    """An estimate from each acceleration and deceleration alone."""
    return [
        estimate_with(replace(method, title=run.name, kinds=(run.kind,)), replace(inputs, runs=[run]))
        for run in inputs.runs
        if run.kind in LEVEL_RUNS
    ]


class EnergyOfRuns(NamedTuple):
    """Estimates by the energy method: from each run alone, from all accelerations, and from all decelerations."""

    single_runs: list[MethodEstimate]
    accelerations: MethodEstimate
    decelerations: MethodEstimate


def energy_of_runs(
    trajectory: Trajectory, runs: list[Maneuver], aircraft: Aircraft, propeller: Propeller
) -> EnergyOfRuns:
    """Estimates by the energy method that show whether runs agree. runs: accelerations and decelerations"""
    inputs, _ = _inputs(FlightForces(trajectory, aircraft, propeller), runs)
    accelerations, decelerations = (
        estimate_with(replace(ENERGY, title=f"{kind}s", kinds=(kind,)), inputs) for kind in (ACCELERATION, DECELERATION)
    )
    return EnergyOfRuns(_single_run_estimates(ENERGY, inputs), accelerations, decelerations)


def one_method(
    name: str, trajectory: Trajectory, runs: list[Maneuver], aircraft: Aircraft, propeller: Propeller
) -> MethodEstimate:
    """The estimate of one of ALL_METHODS, without comparisons."""
    inputs, _ = _inputs(FlightForces(trajectory, aircraft, propeller), runs)
    (method,) = (candidate for candidate in ALL_METHODS if candidate.name == name)
    return estimate_with(method, inputs)


# The methods below the dynamic one, the best first. The energy of runs needs only speed and height as measured; the
# others need other maneuvers.
LADDER = (ENERGY.name, PIW_VIW_THREE.name, VARIED_LIFT.name)


def rejection_of(polar: Polar | None, flown_CL: tuple[float, float]) -> MethodRejection:
    """The reason why a polar gives no curve over these lift coefficients; NONE if it gives one."""
    if polar is None:
        return MethodRejection.NO_ESTIMATE
    if unphysical(polar, flown_CL):
        return MethodRejection.UNPHYSICAL
    return MethodRejection.NONE if informative(polar, flown_CL) else MethodRejection.NO_INFORMATION


def informative(polar: Polar, flown_CL: tuple[float, float]) -> bool:
    """Whether the 95 % interval of drag stays above zero over most of these lift coefficients."""
    drag, sigma = drag_and_error(polar, np.linspace(*flown_CL, CURVES.points))
    return bool(np.mean(drag > NORMAL_95 * sigma) > 0.5)


def narrower(polars: tuple[Polar, tuple[float, float]], other: tuple[Polar, tuple[float, float]]) -> bool:
    """Whether the first polar's relative interval of drag is narrower, averaged over the lift coefficients common to
    both. Each polar comes with its range of lift coefficients."""
    (a, of_a), (b, of_b) = polars, other
    common = max(of_a[0], of_b[0]), min(of_a[1], of_b[1])
    CL = np.linspace(*common, CURVES.points)
    (drag_a, error_a), (drag_b, error_b) = (drag_and_error(polar, CL) for polar in (a, b))
    return bool(common[0] < common[1] and np.mean(error_a / drag_a) < np.mean(error_b / drag_b))


def tried(name: str, title: str, reason: MethodRejection, details: str = "") -> MethodTried:
    """A method on the ladder, with its reason in words. details: cause to add to the reason"""
    text = f"{reason}: {details}" if reason and details else str(reason)
    return MethodTried(name=name, title=title, reason=reason, text=text)


class NoMethod(InputError):
    """Error for a flight of which no method of the ladder gives a curve. tried: all, with reasons, the best first"""

    def __init__(self, text: str, tried: Sequence[MethodTried]):
        super().__init__(text)
        self.tried = tried


class Fallback(NamedTuple):
    """The power curve by another method than the dynamic one, and the range of lift coefficients of its data.

    tried : the methods of the ladder down to this method, the best first
    """

    estimate: DynamicEstimate
    flown_CL: tuple[float, float]
    tried: list[MethodTried]


def fallback(estimates: list[MethodEstimate], trajectory: Trajectory, aircraft: Aircraft, log: str) -> Fallback:
    """The power curve of a flight by the best method of the LADDER that gives one.

    It has the form of the dynamic method's estimate, with prior means as corrections of thrust. If no method gives a
    curve, raises NoMethod with the reasons; its message begins with `log`.
    """
    by_method = {estimate.method.name: estimate for estimate in estimates}
    candidates = [by_method[name] for name in LADDER if name in by_method]
    reasons: list[MethodTried] = []
    for best in candidates:
        reason = MethodRejection.NOT_FLOWN if best.not_flown else rejection_of(best.polar, best.flown_CL)
        details = unphysical(best.polar, best.flown_CL) if best.polar else ", ".join(best.notes)
        details = " or ".join(best.not_flown) or details
        reasons.append(tried(best.method.name, best.method.title, reason, details))
        if reason is MethodRejection.NONE:
            break
    if not reasons or reasons[-1].reason is not MethodRejection.NONE or best.polar is None:
        listed = "; ".join(f"{reason.title}: {reason.text}" for reason in reasons)
        flown = any(reason.name == ENERGY.name and reason.reason is not MethodRejection.NOT_FLOWN for reason in reasons)
        without = "" if flown else "no acceleration or deceleration to analyze, and "
        raise NoMethod(f"{log}: {without}no method gives a curve: {listed}", reasons)
    # The method's own covariance assumes that the errors of the table are independent.
    prior = thrust_prior(aircraft)
    sensitivity = np.stack([best.sensitivities[name] for name in THRUST], axis=1)
    independent = np.diag([aircraft.uncertainty.thrust_scale_fraction**2, aircraft.uncertainty.thrust_slope**2])
    by_stand = sensitivity @ (prior.covariance - independent) @ sensitivity.T
    with_thrust = sensitivity @ prior.covariance
    noise = block_diag(best.noise, np.zeros_like(prior.covariance))
    systematic = np.block([[best.systematic + by_stand, with_thrust], [with_thrust.T, prior.covariance]])
    polar = Polar(best.polar.A + sensitivity @ prior.mean, best.polar.covariance + by_stand)
    values = np.concatenate([polar.A, prior.mean])
    warning = f"The curve is from another method, {best.method.title}; it is not pooled with those of other flights."
    usable_path = trajectory.converged or trajectory.as_measured
    estimate = DynamicEstimate(
        polar=polar,
        parameters=parameter_list(values, noise + systematic, trajectory),
        status=CurveStatus.BY_ANOTHER_METHOD if usable_path else CurveStatus.TRAJECTORY_NOT_CONVERGED,
        verdict=f"by {best.method.title}" if usable_path else TRAJECTORY_DID_NOT_CONVERGE,
        warnings=[warning],
        fits=[],
        values=values,
        noise=noise,
        systematic=systematic,
    )
    return Fallback(estimate, best.flown_CL, reasons)
