"""All estimates of drag from one flight: by the best method that it allows, by all others, and the cross-check."""

from dataclasses import dataclass, field

import numpy as np

from analysis.drag import cross_check, dynamic, likelihood
from analysis.drag.assumed_values import (
    AssumptionUncertainty,
    assumption_uncertainty,
    with_assumption_uncertainty,
    with_transducer_uncertainty,
)
from analysis.drag.cross_check import CrossCheck
from analysis.drag.dynamic import DynamicEstimate
from analysis.drag.likelihood import LikelihoodEstimates
from analysis.drag.method import MethodEstimate
from analysis.drag.methods import every_method, fallback
from analysis.drag.rerun import EstimateRerun
from analysis.drag.run_agreement import runs_against_others
from analysis.flight import Reconstructed
from analysis.polar import unphysical
from analysis.schema import DisagreementResult, RunAgainstOthers
from flight.errors import InputError


@dataclass(frozen=True)
class DragEstimates:
    """All estimates of drag from one flight.

    main : the polar of the power curve, valid over the lift coefficients flown_CL, which are others than those of
        `Reconstructed` where there was no run
    methods, one_by_one : by all other methods; from each acceleration and deceleration alone
    cross_check : None where the flight has no run for it, in gusts, and where it failed
    cross_check_differs : it leaves the simultaneous 95 % band of the difference from the power curve
    runs_against_others : each run against the others of its kind
    likelihood : the maximum-likelihood methods, where these were asked for
    """

    main: DynamicEstimate
    flown_CL: tuple[float, float]
    methods: list[MethodEstimate]
    one_by_one: list[MethodEstimate]
    disagreements: list[DisagreementResult]
    cross_check: CrossCheck | None
    warnings: list[str]
    cross_check_differs: bool = False
    runs_against_others: list[RunAgainstOthers] = field(default_factory=list)
    likelihood: LikelihoodEstimates = field(default_factory=lambda: LikelihoodEstimates([], None, {}))


@dataclass(frozen=True, kw_only=True)
class Estimated(Reconstructed):
    """The record of a flight with all estimates of drag."""

    drag: DragEstimates


def estimated(flight: Reconstructed, *, by_likelihood: bool = False) -> Estimated:
    """The record with `estimate`."""
    flight.progress(f"estimating drag from {len(flight.maneuvers.for_drag)} runs")
    drag = estimate(flight, by_likelihood=by_likelihood)
    return Estimated(**flight.known() | {"drag": drag, "notes": (*flight.notes, *drag.warnings)})


def estimate(flight: Reconstructed, *, by_likelihood: bool = False) -> DragEstimates:
    """Dynamic method, all other methods, and cross-check.

    by_likelihood: the two maximum-likelihood methods are applied, too.
    Raises InputError, beginning with the log's name, when the maneuvers do not determine a physical polar.
    """
    runs, trajectory, aircraft = flight.maneuvers.level_runs, flight.trajectory, flight.aircraft
    assumptions = _uncertainty_by_assumptions(flight)
    by_runs = _by_runs(flight, assumptions) if runs else None
    flight.progress("applying all other methods")
    others = every_method(
        trajectory, flight.maneuvers.maneuvers, aircraft, flight.propeller, flight.condition,
        dynamic=by_runs, dynamic_CL=flight.flown_CL,
    )  # fmt: skip
    by_source = LikelihoodEstimates([], None, {})
    if by_likelihood:
        flight.progress("applying the maximum-likelihood methods")
        by_source = likelihood.estimate(flight)
    main, flown_CL = by_runs, flight.flown_CL
    if main is None:
        other, flown_CL = fallback(others.by_method, trajectory, aircraft, flight.name)
        main = with_assumption_uncertainty(other, assumptions)
    check, differs, check_warnings = _cross_checked(flight, main)
    return DragEstimates(
        main=main,
        flown_CL=flown_CL,
        methods=[*others.by_method, *by_source.methods],
        one_by_one=others.one_by_one,
        disagreements=others.disagreements,
        cross_check=check,
        warnings=[
            *(assumptions.notes if assumptions else []),
            *main.warnings,
            *check_warnings,
        ],
        cross_check_differs=differs,
        runs_against_others=runs_against_others(others.one_by_one, flight.condition, aircraft.uncertainty),
        likelihood=by_source,
    )


def _uncertainty_by_assumptions(flight: Reconstructed) -> AssumptionUncertainty | None:
    """By what the aircraft file lacks, and by errors of the transducers that no residual shows: the analysis is run
    again with each of them."""
    rerun, aircraft = EstimateRerun(flight), flight.aircraft
    by_file = assumption_uncertainty(rerun, aircraft, flight.propeller, flight.condition, flight.flown_CL)
    return with_transducer_uncertainty(by_file, rerun.values_with_air, flight.table, aircraft)


def _by_runs(flight: Reconstructed, assumptions: AssumptionUncertainty | None) -> DynamicEstimate:
    runs = flight.maneuvers.level_runs
    estimate = dynamic.estimate_polar(flight.trajectory, runs, flight.aircraft, flight.propeller)
    estimate = with_assumption_uncertainty(estimate, assumptions)
    if reason := unphysical(estimate.polar, flight.flown_CL):
        source = "one run" if len(runs) == 1 else f"{len(runs)} runs"
        raise InputError(
            f"{flight.name}: unphysical drag polar from {source}: {reason}; keep or fly more runs, longer, over more"
            " speeds; or weight, wing area, propeller table, or a unit or delay in the log is wrong"
        )
    return estimate


def _cross_checked(flight: Reconstructed, main: DynamicEstimate) -> tuple[CrossCheck | None, bool, list[str]]:
    """The cross-check on the runs alone, whether it differs from the power curve, and warnings."""
    if not flight.maneuvers.level_runs:
        return None, False, []
    flight.progress("cross-checking on the runs alone")
    try:
        check = cross_check.on_runs_alone(
            flight.table, flight.maneuvers.level_runs, flight.aircraft, flight.propeller,
            gust_mps=flight.trajectory.gust_mps, zeroed=flight.data.zeroed,
        )  # fmt: skip
    except (InputError, np.linalg.LinAlgError) as error:
        return None, False, [f"The cross-check on the runs alone failed: {error}."]
    if check is None:
        return None, False, []
    compared = cross_check.disagreement(main.polar, check, flight.condition, flight.flown_CL)
    return check, compared.differs, compared.warnings
