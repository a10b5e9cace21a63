"""The drag polar of a flight by the best method it allows, every other method beside it, and the cross-check."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from analysis.drag import cross_check, dynamic
from analysis.drag.comparison import Disagreement
from analysis.drag.cross_check import CrossCheck
from analysis.drag.dynamic import DynamicEstimate
from analysis.drag.method import MethodEstimate
from analysis.drag.methods import every_method, fallback, scatter
from analysis.drag.polar import Condition, unphysical
from analysis.drag.stand_ins import Doubt, widened
from analysis.maneuvers.kinds import Maneuvers
from analysis.trajectory.reconstruction import Trajectory
from flight.aircraft import Aircraft
from flight.errors import InputError
from flight.propeller import Propeller


@dataclass(frozen=True)
class DragEstimates:
    """Everything that was estimated of drag from one flight.

    main : the polar of the power curve, and the range of lift coefficients `flown_CL` that it holds for
    methods, one_by_one : every other method; each acceleration and deceleration by itself
    cross_check : None where there is no run for it, or it could not be made
    """

    main: DynamicEstimate
    flown_CL: tuple[float, float]
    methods: list[MethodEstimate]
    one_by_one: list[MethodEstimate]
    disagreements: list[Disagreement]
    cross_check: CrossCheck | None
    warnings: list[str]


def estimate(
    table: pd.DataFrame,
    trajectory: Trajectory,
    maneuvers: Maneuvers,
    aircraft: Aircraft,
    propeller: Propeller,
    at: Condition,
    flown_CL: tuple[float, float],
    *,
    zeroed: bool,
    log: str,
    progress: Callable[[str], None],
    doubt: Doubt | None = None,
) -> DragEstimates:
    """Dynamic method, all other methods, and cross-check.

    table: of `air_data`. at: weight and density of the flight, at which methods are compared. flown_CL: lift
    coefficients of level flight at the speeds flown. zeroed: the gyro biases at rest were subtracted.
    doubt: by what stands in for keys of the aircraft file.
    Raises InputError, beginning with `log`, when the maneuvers do not determine a physical polar.
    """
    runs = maneuvers.level_runs
    by_runs = widened(dynamic.estimate_polar(table, trajectory, runs, aircraft, propeller), doubt) if runs else None
    if by_runs and (reason := unphysical(by_runs.polar, flown_CL)):
        source = "one run alone" if len(runs) == 1 else f"these {len(runs)} runs"
        raise InputError(f"{log}: by {source} {reason}; keep or fly more runs, longer, over more speeds")
    progress("applying every other method")
    others = every_method(table, trajectory, maneuvers.maneuvers, by_runs, flown_CL, aircraft, propeller, at)
    if by_runs:
        main = by_runs
    else:
        main, flown_CL = fallback(others.by_method, trajectory, log)
        main = widened(main, doubt)
    warnings = (doubt.notes if doubt else []) + main.warnings + scatter(others.one_by_one, at)
    check = None
    if runs:
        progress("cross-checking by the runs alone")
        try:
            check = cross_check.estimate_polar(table, runs, aircraft, zeroed=zeroed, propeller=propeller)
        except (InputError, np.linalg.LinAlgError) as error:
            warnings.append(f"The cross-check over the runs alone could not be made: {error}.")
        else:
            warnings += cross_check.disagreement(main.polar, check, at, flown_CL)
    return DragEstimates(main, flown_CL, others.by_method, others.one_by_one, others.disagreements, check, warnings)


def main_polar(
    table: pd.DataFrame,
    trajectory: Trajectory,
    maneuvers: Maneuvers,
    aircraft: Aircraft,
    propeller: Propeller,
    at: Condition,
    flown_CL: tuple[float, float],
    log: str,
) -> DynamicEstimate:
    """The polar of the power curve alone, as `estimate` has it."""
    runs = maneuvers.level_runs
    if runs:
        return dynamic.estimate_polar(table, trajectory, runs, aircraft, propeller)
    others = every_method(table, trajectory, maneuvers.maneuvers, None, flown_CL, aircraft, propeller, at)
    return fallback(others.by_method, trajectory, log)[0]
