"""All methods on one flight, each run alone, and the pairs of methods that disagree.

The power curve of a flight without accelerations and decelerations: that of another method.

Whether runs of one kind scatter more than their noise allows.

All estimates of drag from one flight: by the best method that it allows, by all others, and the cross-check.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import special

from analysis.drag import cross_check, dynamic, likelihood
from analysis.drag.assumed_values import AssumptionUncertainty, with_assumption_uncertainty
from analysis.drag.comparison import MethodDisagreement, disagreements
from analysis.drag.cross_check import CrossCheck
from analysis.drag.dynamic import DynamicEstimate, parameter_list
from analysis.drag.forces import FlightForces
from analysis.drag.likelihood import PitchRate
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
from analysis.estimation.fit import Fit
from analysis.ground.thrust_prior import THRUST, thrust_prior
from analysis.maneuvers.kinds import LEVEL_RUNS, Maneuver, Maneuvers
from analysis.polar import Condition, Polar, power_required, speed_at, unphysical
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
    disagreements: list[MethodDisagreement]


def every_method(
    trajectory: Trajectory,
    runs: list[Maneuver],
    dynamic: DynamicEstimate | None,
    dynamic_CL: tuple[float, float],
    aircraft: Aircraft,
    propeller: Propeller,
    condition: Condition,
) -> MethodEstimates:
    """ALL_METHODS on the runs of any kind, each run alone, and the pairs that disagree at one weight and density.

    dynamic: None where the flight has no run for it. dynamic_CL: its lift coefficients.
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
    one_by_one = [estimate_with(replace(ONE_RUN, title=run.name), replace(inputs, runs=[run])) for run in level]
    return MethodEstimates(by_method, one_by_one, disagreements(dynamic, dynamic_CL, by_method, errors, condition))


def fallback(
    estimates: list[MethodEstimate], trajectory: Trajectory, aircraft: Aircraft, log: str
) -> tuple[DynamicEstimate, tuple[float, float]]:
    """The polar from steady points, else from roller coasters and wind-up turns, and its range of lift coefficients.

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
    verdict = f"by {best.method.title}" if trajectory.converged else "the trajectory did not converge"
    parameters = parameter_list(values, noise + systematic, trajectory)
    return DynamicEstimate(polar, parameters, verdict, [warning], [], values, noise, systematic), best.flown_CL


FALSE_ALARM_RATE = 0.001  # probability of a warning where there is nothing but noise
FEWEST_RUNS = 3  # of one kind, for their scatter to be tested


def run_scatter(single_runs: list[MethodEstimate], condition: Condition) -> list[str]:
    """A warning per kind of run whose powers differ by more than noise, at a speed common to all of them."""
    warnings = []
    for kind in LEVEL_RUNS:
        runs = [run for run in single_runs if run.polar is not None and run.method.title.startswith(kind)]
        if len(runs) < FEWEST_RUNS:
            continue
        low, high = max(run.flown_CL[0] for run in runs), min(run.flown_CL[1] for run in runs)
        if low >= high:
            continue
        V = speed_at([np.sqrt(low * high)], condition)
        power, error = np.array(
            [power_required(V, Polar(run.polar.A, run.noise), condition) for run in runs if run.polar is not None]
        )[:, :, 0].T
        mean = np.average(power, weights=error**-2)
        chi_square, dof = np.sum(((power - mean) / error) ** 2), len(runs) - 1
        if chi_square > special.chdtri(dof, FALSE_ALARM_RATE):
            warnings.append(
                f"The {len(runs)} {kind}s differ from each other by {100 * np.std(power, ddof=1) / mean:.1f} % at"
                f" {V[0]:.1f} m/s, {np.sqrt(chi_square / dof):.1f} times what their noise allows."
            )
    return warnings


@dataclass(frozen=True)
class DragEstimates:
    """All estimates of drag from one flight.

    main : the polar of the power curve, valid over the lift coefficients flown_CL
    methods, one_by_one : by all other methods; from each acceleration and deceleration alone
    cross_check : None where the flight has no run for it, or it failed
    cross_check_differs : it leaves the simultaneous 95 % band of the difference from the power curve; False for filter
        error
    pitch_rate, likelihood_fits : of the maximum-likelihood methods, where these were asked for; the fits by method name
    """

    main: DynamicEstimate
    flown_CL: tuple[float, float]
    methods: list[MethodEstimate]
    one_by_one: list[MethodEstimate]
    disagreements: list[MethodDisagreement]
    cross_check: CrossCheck | None
    warnings: list[str]
    cross_check_differs: bool = False
    pitch_rate: PitchRate | None = None
    likelihood_fits: dict[str, Fit] = field(default_factory=dict)


def estimate(
    table: pd.DataFrame,
    trajectory: Trajectory,
    maneuvers: Maneuvers,
    aircraft: Aircraft,
    propeller: Propeller,
    condition: Condition,
    flown_CL: tuple[float, float],
    *,
    zeroed: bool,
    log: str,
    progress: Callable[[str], None],
    assumption_uncertainty: AssumptionUncertainty | None = None,
    by_likelihood: bool = False,
) -> DragEstimates:
    """Dynamic method, all other methods, and cross-check.

    table: from `air_data`. condition: weight and density of the flight, at which methods are compared. flown_CL: lift
    coefficients of level flight at the speeds flown. zeroed: the gyro biases at rest were subtracted.
    assumption_uncertainty: by values assumed for keys that the aircraft file lacks.
    by_likelihood: the two maximum-likelihood methods are applied, too.
    Raises InputError, beginning with `log`, when the maneuvers do not determine a physical polar.
    """
    runs = maneuvers.level_runs
    by_runs = None
    if runs:
        by_runs = dynamic.estimate_polar(trajectory, runs, aircraft, propeller)
        by_runs = with_assumption_uncertainty(by_runs, assumption_uncertainty)
    if by_runs and (reason := unphysical(by_runs.polar, flown_CL)):
        source = "one run" if len(runs) == 1 else f"{len(runs)} runs"
        raise InputError(
            f"{log}: unphysical drag polar from {source}: {reason}; keep or fly more runs, longer, over more speeds; or"
            " weight, wing area, propeller table, or a unit or delay in the log is wrong"
        )
    progress("applying all other methods")
    others = every_method(trajectory, maneuvers.maneuvers, by_runs, flown_CL, aircraft, propeller, condition)
    by_method, pitch_rate, fits = others.by_method, None, {}
    if by_likelihood:
        progress("applying the maximum-likelihood methods")
        found = likelihood.estimate(table, trajectory, runs, aircraft, propeller, flown_CL, zeroed=zeroed)
        by_method, pitch_rate, fits = [*by_method, *found.methods], found.pitch_rate, found.fits
    if by_runs:
        main = by_runs
    else:
        main, flown_CL = fallback(others.by_method, trajectory, aircraft, log)
        main = with_assumption_uncertainty(main, assumption_uncertainty)
    assumptions = assumption_uncertainty.notes if assumption_uncertainty else []
    warnings = assumptions + main.warnings + run_scatter(others.one_by_one, condition)
    check, differs = None, False
    if runs:
        progress("cross-checking on the runs alone")
        try:
            check = cross_check.on_runs_alone(
                table, runs, aircraft, zeroed=zeroed, propeller=propeller, gust_mps=trajectory.gust_mps
            )
        except (InputError, np.linalg.LinAlgError) as error:
            warnings.append(f"The cross-check on the runs alone failed: {error}.")
        else:
            compared = cross_check.disagreement(main.polar, check, condition, flown_CL)
            differs = compared.differs
            warnings += compared.warnings
    return DragEstimates(
        main, flown_CL, by_method, others.one_by_one, others.disagreements, check, warnings, differs, pitch_rate, fits
    )
