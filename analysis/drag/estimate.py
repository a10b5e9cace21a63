"""All estimates of drag from one flight: by the best method that it allows, by all others, and the cross-check."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from analysis.drag import cross_check, dynamic, likelihood
from analysis.drag.assumed_values import AssumptionUncertainty, with_assumption_uncertainty
from analysis.drag.comparison import MethodDisagreement
from analysis.drag.cross_check import CrossCheck
from analysis.drag.dynamic import DynamicEstimate
from analysis.drag.fallback import fallback
from analysis.drag.likelihood import PitchRate
from analysis.drag.method import MethodEstimate
from analysis.drag.methods import every_method
from analysis.drag.polar import Condition, unphysical
from analysis.drag.run_scatter import run_scatter
from analysis.estimation.fit import Fit
from analysis.maneuvers.kinds import Maneuvers
from analysis.trajectory.reconstruction import Trajectory
from flight.aircraft import Aircraft
from flight.errors import InputError
from flight.propeller import Propeller


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
