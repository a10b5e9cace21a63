"""The estimates of all methods in the form of `results.json`."""

from analysis.drag.method import MethodEstimate, SteadyPoint
from analysis.estimation.noise import NORMAL_95
from analysis.polar import Condition, speed_at
from analysis.results.power_curves import power_curve
from analysis.schema import MethodPoint, MethodResult


def method_result(estimate: MethodEstimate, condition: Condition, largest_CL: float) -> MethodResult:
    """A method's curve over the lift coefficients of its data, and its points, at one weight and density.

    largest_CL : of level flight at the slowest speed flown. Gusts and pull-ups take lift coefficients beyond that; the
    curve ends there, or at a method's own slowest steady point.
    """
    polar = estimate.polar
    smallest, largest = estimate.flown_CL
    largest = min(largest, max([largest_CL, *(point.CL for point in estimate.points)]))
    return MethodResult(
        name=estimate.method.name,
        title=estimate.method.title,
        equations=estimate.method.equations,
        taken_as_measured=list(estimate.method.taken_as_measured),
        drag_polar=[] if polar is None else polar.A.tolist(),
        power_required=power_curve(polar, condition, (smallest, largest)) if polar and smallest < largest else [],
        points=[_point(point, condition) for point in estimate.points],
        notes=list(estimate.notes),
        not_flown=list(estimate.not_flown),
    )


def _point(point: SteadyPoint, condition: Condition) -> MethodPoint:
    """A steady point at another weight and density, with the same lift and drag coefficients."""
    V = float(speed_at(point.CL, condition))
    unit = condition.rho * V**3 * condition.wing_area_m2 / 2
    power, half = unit * point.CD, NORMAL_95 * unit * point.CD_error
    return MethodPoint(
        speed_mps=V, power_W=power, power_lo_W=power - half, power_hi_W=power + half, start_s=point.start_s
    )
