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
from analysis.estimation.noise import NORMAL_95
from analysis.ground.thrust_prior import THRUST, thrust_prior
from analysis.maneuvers.kinds import LEVEL_RUNS, Maneuver
from analysis.polar import Condition, Polar, unphysical
from analysis.schema import CurveStatus, DisagreementResult, MethodTried, WhyNot
from analysis.settings import CURVES
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


# The ladder below the dynamic method: the energy of runs takes speed and height alone, the others other maneuvers.
LADDER = (ENERGY.name, PIW_VIW_THREE.name, VARIED_LIFT.name)


def why_not(polar: Polar | None, flown_CL: tuple[float, float]) -> WhyNot:
    """Why a polar is no curve over these lift coefficients."""
    if polar is None:
        return WhyNot.NO_ESTIMATE
    if unphysical(polar, flown_CL):
        return WhyNot.UNPHYSICAL
    return WhyNot.NONE if informative(polar, flown_CL) else WhyNot.NO_INFORMATION


def informative(polar: Polar, flown_CL: tuple[float, float]) -> bool:
    """Whether the 95 % interval of drag stays above zero over most of these lift coefficients."""
    CL = np.linspace(*flown_CL, CURVES.points)
    terms = np.stack([np.ones_like(CL), CL, CL**2], axis=1)
    sigma = np.sqrt(np.einsum("ni,ij,nj->n", terms, polar.covariance, terms))
    return bool(np.mean(terms @ polar.A > NORMAL_95 * sigma) > 0.5)


def tried(name: str, title: str, reason: WhyNot, details: str = "") -> MethodTried:
    """A method on the ladder with its reason in words. details: what the reason does not tell."""
    text = f"{reason}: {details}" if reason and details else str(reason)
    return MethodTried(name=name, title=title, reason=reason, text=text)


class Fallback(NamedTuple):
    """The power curve by another method, and the range of lift coefficients of its data.

    tried : the methods of the ladder down to it, the best first
    """

    estimate: DynamicEstimate
    flown_CL: tuple[float, float]
    tried: list[MethodTried]


def fallback(
    estimates: list[MethodEstimate], trajectory: Trajectory, aircraft: Aircraft, log: str, *, only: str = ""
) -> Fallback:
    """The power curve of a flight by the best of the LADDER that gives one; only: by the method of that name.

    It has the form of the dynamic method's estimate; the corrections of thrust are those of their prior.
    Raises InputError, beginning with `log`, with the reasons when none gives a polar.
    """
    by_method = {estimate.method.name: estimate for estimate in estimates}
    candidates = [by_method[name] for name in LADDER if name in by_method and only in ("", name)]
    reasons: list[MethodTried] = []
    for best in candidates:
        reason = WhyNot.NOT_FLOWN if best.not_flown else why_not(best.polar, best.flown_CL)
        details = unphysical(best.polar, best.flown_CL) if best.polar else ", ".join(best.notes)
        details = " or ".join(best.not_flown) or details
        reasons.append(tried(best.method.name, best.method.title, reason, details))
        if reason is WhyNot.NONE:
            break
    if not reasons or reasons[-1].reason is not WhyNot.NONE or best.polar is None:
        listed = "; ".join(f"{one.title}: {one.text}" for one in reasons)
        flown = any(one.name == ENERGY.name and one.reason is not WhyNot.NOT_FLOWN for one in reasons)
        without = "" if flown else "no acceleration or deceleration to analyze, and "
        raise InputError(f"{log}: {without}no method gives a curve: {listed}")
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
    warning = f"The curve is from another method, {best.method.title}."
    known = trajectory.converged or trajectory.as_measured
    estimate = DynamicEstimate(
        polar=polar,
        parameters=parameter_list(values, noise + systematic, trajectory),
        status=CurveStatus.BY_ANOTHER_METHOD if known else CurveStatus.TRAJECTORY_NOT_CONVERGED,
        verdict=f"by {best.method.title}" if known else TRAJECTORY_DID_NOT_CONVERGE,
        warnings=[warning],
        fits=[],
        values=values,
        noise=noise,
        systematic=systematic,
    )
    return Fallback(estimate, best.flown_CL, reasons)
