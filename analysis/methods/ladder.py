"""All estimates of drag from one flight, by the best method that it allows and by all others, and the cross-check."""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.beside import beside
from flightpower.analysis.curve import unphysical
from flightpower.analysis.flight import Reconstructed
from flightpower.analysis.maneuvers.runs_file import NoCurve
from flightpower.analysis.methods import dynamic, likelihood
from flightpower.analysis.methods.assumed_values import (
    AssumptionUncertainty,
    assumption_uncertainty,
    with_assumption_uncertainty,
    with_step_of_motor_speed,
    with_transducer_uncertainty,
)
from flightpower.analysis.methods.comparison import DYNAMIC
from flightpower.analysis.methods.cross_check import CrossCheck, disagreement, on_runs_alone
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.methods.likelihood import LikelihoodEstimates
from flightpower.analysis.methods.method import MethodEstimate
from flightpower.analysis.methods.methods import (
    NoMethod,
    energy_of_runs,
    every_method,
    fallback,
    narrower,
    rejection_of,
    tried,
)
from flightpower.analysis.methods.methods_from_runs import ENERGY
from flightpower.analysis.methods.rerun import EstimateRerun
from flightpower.analysis.methods.run_agreement import one_kind_against_another, runs_against_others
from flightpower.analysis.records.flight import DisagreementResult, MethodRejection, MethodTried, RunAgainstOthers
from flightpower.analysis.trajectory.equations import vibration
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2


@dataclass(frozen=True)
class DragEstimates:
    """All estimates of drag from one flight.

    main : the polar of the power curve, valid over the lift coefficients flown_CL; if a simpler method gives the curve,
        this is the range of its data instead of the range in `Reconstructed`
    methods, single_runs : estimates by all other methods, and from each acceleration and deceleration alone
    cross_check : None where the flight has no run for it, in gusts, and where it failed
    cross_check_differs : whether it differs from the power curve by more than the simultaneous 95 % band allows
    runs_against_others : each run compared with the others of its kind, by the method of the curve
    accelerations_against_decelerations : from the energy of the runs, if that gives the curve
    likelihood : the maximum-likelihood methods, if they were requested
    ladder : the methods that were tried for the curve, the best first, down to the method that gives it
    """

    main: DynamicEstimate
    flown_CL: tuple[float, float]
    methods: list[MethodEstimate]
    single_runs: list[MethodEstimate]
    disagreements: list[DisagreementResult]
    cross_check: CrossCheck | None
    warnings: list[str]
    cross_check_differs: bool = False
    runs_against_others: list[RunAgainstOthers] = field(default_factory=list)
    accelerations_against_decelerations: RunAgainstOthers | None = None
    likelihood: LikelihoodEstimates = field(default_factory=lambda: LikelihoodEstimates([], None, {}))
    ladder: list[MethodTried] = field(default_factory=list)


class _Curve(NamedTuple):
    """The fields of DragEstimates that depend on the method that gives the power curve."""

    main: DynamicEstimate
    flown_CL: tuple[float, float]
    ladder: list[MethodTried]
    warnings: list[str]
    runs_against_others: list[RunAgainstOthers]
    accelerations_against_decelerations: RunAgainstOthers | None = None
    cross_check: CrossCheck | None = None
    cross_check_differs: bool = False


@dataclass(frozen=True, kw_only=True)
class Estimated(Reconstructed):
    """The record of a flight with all estimates of drag."""

    drag: DragEstimates


def estimated(flight: Reconstructed, *, by_likelihood: bool = False) -> Estimated:
    """Add the estimates of drag (`estimate`) to the record of a flight."""
    flight.progress(f"estimating drag from {len(flight.maneuvers.for_drag)} runs")
    drag = estimate(flight, by_likelihood=by_likelihood)
    return Estimated(**flight.fields_so_far() | {"drag": drag, "notes": (*flight.notes, *drag.warnings)})


def estimate(flight: Reconstructed, *, by_likelihood: bool = False) -> DragEstimates:
    """Apply the dynamic method, all other methods, and the cross-check.

    by_likelihood: also apply the two maximum-likelihood methods.
    The flight's curve comes from the best method that gives one. Raises NoCurve, with a message that begins with the
    log's name, if none does.
    """
    trajectory, aircraft = flight.trajectory, flight.aircraft
    checking = beside(lambda: _cross_check(flight))
    by_runs, first, assumptions = estimate_by_runs(flight)
    flight.progress("applying all other methods")
    others = every_method(
        trajectory, flight.maneuvers.maneuvers, aircraft, flight.propeller, flight.condition,
        dynamic=by_runs, dynamic_CL=flight.flown_CL,
    )  # fmt: skip
    by_source = LikelihoodEstimates([], None, {})
    if by_likelihood:
        flight.progress("applying the maximum-likelihood methods")
        by_source = likelihood.estimate(flight)
    if by_runs is None:
        try:
            curve = _by_another_method(flight, others.by_method, first)
        except InputError as error:
            by_dynamic = f"; {first.title}: {first.text}" if flight.maneuvers.level_runs else ""
            advice = "fly or keep more runs, longer, over more speeds; or weight, wing area, propeller table, a unit or"
            lower = error.tried if isinstance(error, NoMethod) else ()
            text = f"{error}{by_dynamic}; {advice} delay in the log is wrong"
            raise NoCurve(text, flight.maneuvers, [first, *lower]) from None
    else:
        agreement = runs_against_others(others.single_runs, flight.condition, aircraft.uncertainty)
        flight.progress("cross-checking on the runs alone")
        check, failures = checking()
        differs, differences = disagreement(by_runs.polar, check, flight.condition, flight.flown_CL)
        notes = [*(assumptions.notes if assumptions else []), *by_runs.warnings, *failures, *differences]
        curve = _Curve(by_runs, flight.flown_CL, [first], notes, agreement, None, check, differs)
    return DragEstimates(
        methods=[*others.by_method, *by_source.methods],
        single_runs=others.single_runs,
        disagreements=others.disagreements,
        likelihood=by_source,
        **curve._asdict(),
    )


def by_simpler_method(flight: Reconstructed, dynamic: DragEstimates) -> Estimated | None:
    """The record with the curve of a simpler method, if the dynamic method's flight path does not fit the measurements.

    Such a path has an error that no residual locates. The dynamic method uses its attitude and angle of attack; the
    simpler methods do not. None if these give no curve, or only one without a narrower interval.
    flight : with the path as measured     dynamic : the estimates along the path that does not fit
    """
    try:
        drag = estimate(flight)
    except NoCurve:
        return None
    if not narrower((drag.main.polar, drag.flown_CL), (dynamic.main.polar, dynamic.flown_CL)):
        return None
    ladder = [tried(DYNAMIC, DYNAMIC_TITLE, MethodRejection.MISFIT), *drag.ladder[1:]]
    likelihood = dynamic.likelihood
    drag = replace(drag, ladder=ladder, methods=[*drag.methods, *likelihood.methods], likelihood=likelihood)
    return Estimated(**flight.fields_so_far() | {"drag": drag, "notes": (*flight.notes, *drag.warnings)})


def _by_another_method(flight: Reconstructed, methods: list[MethodEstimate], first: MethodTried) -> _Curve:
    """The curve of the best method below the dynamic one, which failed for the reason in `first`. Raises InputError."""
    other, flown_CL, lower = fallback(methods, flight.trajectory, flight.aircraft, flight.name)
    by, ladder = lower[-1], [first, *lower]
    assumptions = _uncertainty_by_assumptions(flight, by.name)
    main = with_assumption_uncertainty(other, assumptions)
    reasons = "; ".join(f"{step.title}: {step.text}" for step in ladder[:-1])
    warnings = [f"{main.warnings[0]} Better methods gave no curve: {reasons}.", *main.warnings[1:]]
    notes = [*(assumptions.notes if assumptions else []), *warnings]
    if by.name != ENERGY.name:
        return _Curve(replace(main, warnings=warnings), flown_CL, ladder, notes, [])
    runs = energy_of_runs(flight.trajectory, flight.maneuvers.level_runs, flight.aircraft, flight.propeller)
    condition, uncertainty = flight.condition, flight.aircraft.uncertainty
    return _Curve(
        replace(main, warnings=warnings),
        flown_CL,
        ladder,
        notes,
        runs_against_others(runs.single_runs, condition, uncertainty),
        one_kind_against_another(runs.accelerations, runs.decelerations, condition, uncertainty),
    )


def _uncertainty_by_assumptions(flight: Reconstructed, method: str = "") -> AssumptionUncertainty | None:
    """Uncertainty due to keys that the aircraft file lacks, errors of the transducers that no residual shows, and steps
    of motor speed. The analysis is repeated with each of them. method: method of the curve, if not the dynamic one"""
    rerun, aircraft = EstimateRerun(flight, method), flight.aircraft
    by_file = assumption_uncertainty(rerun, aircraft, flight.propeller, flight.condition, flight.flown_CL)
    by_transducers = with_transducer_uncertainty(by_file, rerun.values_with_air, flight.table, aircraft)
    step_revps = flight.data.resolution.get("n_revps", 0.0)
    return with_step_of_motor_speed(by_transducers, rerun.values_with_air, flight.table, step_revps)


DYNAMIC_TITLE = "dynamic method"


def estimate_by_runs(flight: Reconstructed) -> tuple[DynamicEstimate | None, MethodTried, AssumptionUncertainty | None]:
    """The dynamic method's estimate (None if it gives no curve), the method with its reason, and the uncertainty due to
    assumptions, which the estimate contains."""
    runs = flight.maneuvers.level_runs
    if not runs:
        return None, tried(DYNAMIC, DYNAMIC_TITLE, MethodRejection.NOT_FLOWN, "accelerations or decelerations"), None
    if flight.trajectory.as_measured:
        return None, tried(DYNAMIC, DYNAMIC_TITLE, MethodRejection.NO_TRAJECTORY), None
    assumptions = _uncertainty_by_assumptions(flight)
    estimate = dynamic.estimate_polar(flight.trajectory, runs, flight.aircraft, flight.propeller)
    estimate = with_assumption_uncertainty(estimate, assumptions)
    reason, details = rejection_of(estimate.polar, flight.flown_CL), unphysical(estimate.polar, flight.flown_CL)
    return (None if reason else estimate), tried(DYNAMIC, DYNAMIC_TITLE, reason, details), assumptions


def without_model_errors(table: pd.DataFrame, trajectory: Trajectory) -> pd.DataFrame:
    """Correct air data for errors that grow with motor speed and load factor, as estimated from the whole flight.

    Runs alone cannot separate them from drag. table: as from `air_data`
    """
    shaken = vibration(table["n_revps"].to_numpy())
    excess_load = -table["az_mps2"] / GRAVITY_MPS2 - 1
    return table.assign(
        ax_mps2=table["ax_mps2"] - trajectory.value("ax_vibration") * shaken,
        az_mps2=table["az_mps2"] - trajectory.value("az_vibration") * shaken,
        alpha_rad=table["alpha_rad"] - trajectory.value("alpha_per_g") * excess_load,
    )


def _cross_check(flight: Reconstructed) -> tuple[CrossCheck | None, list[str]]:
    """The cross-check on the runs alone, and a warning if it failed."""
    runs, trajectory = flight.maneuvers.level_runs, flight.trajectory
    if not runs or trajectory.as_measured:
        return None, []
    table = without_model_errors(flight.table, trajectory)
    try:
        check = on_runs_alone(
            table, runs, flight.aircraft, flight.propeller, gust_mps=trajectory.gust_mps, zeroed=flight.data.zeroed
        )
    except (InputError, np.linalg.LinAlgError) as error:
        return None, [f"The cross-check on the runs alone failed: {error}."]
    return check, []
