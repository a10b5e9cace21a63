"""All methods on one flight, each run alone, and the pairs of methods that disagree; the curve without runs."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from analysis.drag.comparison import disagreements
from analysis.drag.dynamic import TRAJECTORY_DID_NOT_CONVERGE, DynamicEstimate, parameter_list
from analysis.drag.forces import FlightForces
from analysis.drag.method import Method, MethodEstimate, estimate_with
from analysis.drag.method_inputs import method_inputs
from analysis.drag.methods_from_runs import (
    ACCELERATIONS,
    DECELERATIONS,
    DIRECT,
    ENERGY,
    FROM_SPEED,
    ONE_RUN,
    VARIED_LIFT,
)
from analysis.drag.sensor_errors import estimate_errors
from analysis.drag.steady_points import PIW_VIW_THREE, PIW_VIW_TWO, W_DELTA, W_DELTA_SLOW
from analysis.ground.thrust_prior import THRUST, thrust_prior
from analysis.maneuvers.kinds import LEVEL_RUNS, Maneuver
from analysis.polar import Condition, Polar
from analysis.schema import CurveStatus, DisagreementResult
from analysis.trajectory.reconstruction import Trajectory
from flight.aircraft import Aircraft
from flight.errors import InputError
from flight.propeller import Propeller

ALL_METHODS: tuple[Method, ...] = (
    PIW_VIW_THREE, PIW_VIW_TWO, W_DELTA, W_DELTA_SLOW, DIRECT, FROM_SPEED, VARIED_LIFT, ENERGY, ACCELERATIONS,
    DECELERATIONS,
)  # fmt: skip


class MethodEstimates(NamedTuple):
    """The estimates of all methods; one_by_one: of each acceleration and deceleration alone."""

    by_method: list[MethodEstimate]
    one_by_one: list[MethodEstimate]
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
    """ALL_METHODS on the runs of any kind, each run alone, and the pairs that disagree at one weight and density.

    dynamic: None where the flight has no run for it, or it is not compared. dynamic_CL: its lift coefficients.
    """
    flight_forces = FlightForces(trajectory, aircraft, propeller)
    t = flight_forces.t_s
    level = [run for run in runs if run.kind in LEVEL_RUNS]
    in_level_runs = np.zeros(len(t), dtype=bool)
    for run in level:
        in_level_runs |= (t >= run.start_s) & (t <= run.end_s)
    errors = estimate_errors(flight_forces, trajectory, in_level_runs)
    inputs = method_inputs(flight_forces, trajectory, runs, errors)
    by_method = [estimate_with(method, inputs) for method in ALL_METHODS]
    one_by_one = [
        estimate_with(replace(ONE_RUN, title=run.name, kinds=(run.kind,)), replace(inputs, runs=[run])) for run in level
    ]
    return MethodEstimates(by_method, one_by_one, disagreements(dynamic, dynamic_CL, by_method, errors, condition))


class Fallback(NamedTuple):
    """The power curve by another method, and the range of lift coefficients of its data."""

    estimate: DynamicEstimate
    flown_CL: tuple[float, float]


def fallback(estimates: list[MethodEstimate], trajectory: Trajectory, aircraft: Aircraft, log: str) -> Fallback:
    """The power curve of a flight without runs: by steady points, else by roller coasters and wind-up turns.

    It has the form of the dynamic method's estimate; the corrections of thrust are those of their prior.
    Raises InputError, beginning with `log`, with the reasons when neither gives a polar.
    """
    by_method = {estimate.method.name: estimate for estimate in estimates}
    candidates = [by_method[PIW_VIW_THREE.name], by_method[VARIED_LIFT.name]]
    best = next((one for one in candidates if one.polar is not None and one.polar.A[2] > 0), None)
    if best is None or best.polar is None:
        reasons = "; ".join(f"{one.method.title}: {', '.join(one.notes)}" for one in candidates)
        raise InputError(
            f"{log}: no acceleration or deceleration to analyze, and no polar from other maneuvers: {reasons}"
        )
    noise, systematic = np.zeros((5, 5)), np.zeros((5, 5))
    noise[:3, :3], systematic[:3, :3] = best.noise, best.systematic
    # The method's own covariance is that of independent errors of the table.
    prior = thrust_prior(aircraft)
    sensitivity = np.stack([best.sensitivities[name] for name in THRUST], axis=1)
    independent = np.diag([aircraft.uncertainty.thrust_scale_fraction**2, aircraft.uncertainty.thrust_slope**2])
    by_stand = sensitivity @ (prior.covariance - independent) @ sensitivity.T
    systematic[:3, :3] += by_stand
    systematic[3:, 3:] = prior.covariance
    systematic[:3, 3:] = sensitivity @ prior.covariance
    systematic[3:, :3] = systematic[:3, 3:].T
    polar = Polar(best.polar.A + sensitivity @ prior.mean, best.polar.covariance + by_stand)
    values = np.concatenate([polar.A, prior.mean])
    warning = f"No acceleration or deceleration was flown: the curve is from another method, {best.method.title}."
    estimate = DynamicEstimate(
        polar=polar,
        parameters=parameter_list(values, noise + systematic, trajectory),
        status=CurveStatus.BY_ANOTHER_METHOD if trajectory.converged else CurveStatus.TRAJECTORY_NOT_CONVERGED,
        verdict=f"by {best.method.title}" if trajectory.converged else TRAJECTORY_DID_NOT_CONVERGE,
        warnings=[warning],
        fits=[],
        values=values,
        noise=noise,
        systematic=systematic,
    )
    return Fallback(estimate, best.flown_CL)
