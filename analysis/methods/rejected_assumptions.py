"""Assumptions that the runs themselves may contradict: a parabolic polar, and a propeller table as good as assumed.

Each assumption is tested by an estimate without it. If the test rejects it, the change of the estimate is added to the
interval, with a warning. An error of thrust that the priors of the table hardly allow need not be the propeller's: a
wrong weight, density or airspeed looks the same in runs, and then the correction of thrust is wrong. The interval
therefore contains the estimate without the correction, and extends as far beyond it.
"""

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from flightpower.analysis.curve import polar_part
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.fit import Fit
from flightpower.analysis.estimation.model import Model, NamedValues, Parameter
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods.thrust_prior import STAND
from flightpower.analysis.settings import EVIDENCE, FLOWN
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.flight.arrays import Array

THRUST_TITLES = {
    "thrust_scale": "scale of thrust",
    "thrust_slope": "slope of thrust over advance ratio",
    "thrust_beyond": "thrust beyond the propeller's table",
    STAND: "thrust at rest, against the stand",
}


class Assumption(StrEnum):
    """Assumptions that a flight may reject. The values are keys of `pooling.changes` in results.json."""

    THRUST_TABLE = "doubt of thrust"
    PARABOLIC_POLAR = "doubt of the polar's shape"
    MOTOR_SPEED = "doubt of the motor speed"


class RejectedAssumption(NamedTuple):
    """A rejected assumption. change : (m,) change of the estimates without it     warning : for the reader"""

    assumption: Assumption
    change: Array
    warning: str


def rejected_assumptions(fit: Fit) -> list[RejectedAssumption]:
    """Assumptions of the drag model that this fit rejects."""
    return _thrust_rejected(fit) + _shape_rejected(fit)


def thrust_beyond_prior(model: Model, values: Mapping[str, float]) -> dict[str, float]:
    """Errors of thrust outside the 95 % interval of their prior or of the stand measurement, in standard deviations.

    values : values of the parameters of the model, by name
    """
    sigma = {q.name: q.prior_sigma for q in model.parameters if q.name in THRUST_TITLES}
    estimated = {name: values[name] / s for name, s in sigma.items() if s and abs(values[name]) > NORMAL_95 * s}
    measured = {m.name: m.deviation(values) for m in model.prior_measurements}
    return estimated | {name: z for name, z in measured.items() if abs(z) > NORMAL_95}


def _thrust_rejected(fit: Fit) -> list[RejectedAssumption]:
    """Test for thrust errors larger than the prior allows, or a stand measurement that the flight contradicts.

    The estimate is repeated with the table's thrust, as if something other than the propeller were wrong.
    """
    rejected = thrust_beyond_prior(fit.model, dict(zip(fit.names, fit.values, strict=True)))
    if not rejected:
        return []
    fixed = tuple(
        replace(q, prior_sigma=EVIDENCE.negligible * q.prior_sigma) if q.name in THRUST_TITLES and q.prior_sigma else q
        for q in fit.model.parameters
    )
    repeated = fit_output_error(replace(fit.model, parameters=fixed, prior_measurements=()), _segments(fit))
    named = "; ".join(f"{THRUST_TITLES[name]}: {z:+.1f} standard deviations" for name, z in rejected.items())
    return [
        RejectedAssumption(
            Assumption.THRUST_TABLE,
            repeated.values - fit.values,
            f"The propeller's thrust differs from its table by more than assumed ({named}). The interval is wider by"
            " what that changes. Check the weight, the propeller, its table, and the number of pole pairs"
            f"{', and repeat the measurement on the stand' if STAND in rejected else ''}.",
        )
    ]


def _shape_rejected(fit: Fit) -> list[RejectedAssumption]:
    """Test for a quartic term of lift that the residuals require. The change leads to the parabola through the quartic
    polar at the ends and in the middle of the lift coefficients flown."""
    with_quartic = fit_output_error(_quartic(fit.model), _segments(fit))
    i = with_quartic.names.index("A4")
    error = float(np.sqrt(covariance.of_noise(with_quartic)[i, i]))
    quartic = float(with_quartic.values[i])
    low, high = np.percentile(np.concatenate([segment.u["CL"] for segment in _segments(fit)]), FLOWN.robust_percentiles)
    CL = np.array([low, (low + high) / 2, high])
    powers = np.vander(CL, 3, increasing=True)
    values = np.delete(with_quartic.values, i)
    A = polar_part(values)
    A += np.linalg.solve(powers, quartic * CL**4)
    significant = with_quartic.verdict.ok and abs(quartic) > STATISTICS.sigmas * error
    if not significant or np.max(np.abs(powers @ A / (powers @ polar_part(fit.values)) - 1)) < EVIDENCE.negligible:
        return []
    return [
        RejectedAssumption(
            Assumption.PARABOLIC_POLAR,
            values - fit.values,
            f"Drag is no parabola of lift: a quartic term is {abs(quartic) / error:.1f} times its standard error. The"
            " interval has been widened accordingly, most at the slowest and the fastest speed.",
        )
    ]


def _quartic(model: Model) -> Model:
    def drag(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[object, ...]:
        (parabolic,) = model.output_function(x, u, p)
        return (parabolic + u.qS_over_m * p.A4 * u.CL**4,)

    return replace(
        model,
        name=f"{model.name}, quartic",
        output_function=drag,
        parameters=(*model.parameters, Parameter(name="A4", start=0.0)),
    )


def _segments(fit: Fit) -> list[Segment]:
    return [segment_fit.segment for segment_fit in fit.segment_fits]
