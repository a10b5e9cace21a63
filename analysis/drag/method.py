"""What all methods have in common: what a method is, how it is applied, and what it estimates.

A method turns a table (of `method_inputs.input_table`) and runs into a linear regression for the drag polar. Solving
it and propagating noise, sensor errors and trajectory errors are the same for all methods.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pandas as pd

from analysis.drag import covariance
from analysis.drag.method_inputs import MethodInputs
from analysis.drag.regression import PolarRegression
from analysis.drag.sensor_errors import CAUSES, error_prior_sigma
from analysis.drag.settings import REGRESSION
from analysis.maneuvers.kinds import Maneuver
from analysis.polar import Polar
from analysis.schema import Cause
from analysis.settings import FLOWN
from analysis.signals.settings import STATISTICS
from flight.aircraft import Aircraft
from flight.arrays import Array
from flight.errors import InputError


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
    A1 = -2 * A[2] * REGRESSION.CL_minD_sigma
    X = np.stack([np.ones_like(CL), CL**2], axis=1)
    (A0, A2), *_ = np.linalg.lstsq(X, A1 * CL, rcond=None)
    return _outer(np.array([A0, -A1, A2]))


def _notes(A: Array, table: pd.DataFrame, runs: list[Maneuver]) -> tuple[str, ...]:
    notes = []
    if A[2] <= 0:
        notes.append("the drag polar curves downward in this fit: the range of lift coefficients flown is too narrow")
    covered = pd.concat([table.loc[run.start_s : run.end_s, "covered"] for run in runs])
    outside = 1 - float(covered.mean())
    if outside > STATISTICS.unmentioned_share:
        notes.append(f"{100 * outside:.0f} % of its data lie outside the propeller table")
    return tuple(notes)
