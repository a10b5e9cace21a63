"""Curves with their intervals, optimum speeds, and the drag polar, in the form of `results.json`."""

from dataclasses import replace

import numpy as np
import pandas as pd

from flightpower.analysis.curve import (
    Condition,
    Cost,
    Curve,
    Polar,
    PolarCurve,
    classic_form,
    drag_terms,
    lift_coefficient,
    maximum_lift_to_drag,
    polar_curve,
    speed_at,
)
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.maneuvers.flown import largest_lift, thrust_known
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.methods.interval_sources import Share, variance_by_source
from flightpower.analysis.records.flight import (
    BatteryResult,
    ConditionResult,
    CurveResult,
    DragPolar,
    Interval,
    IntervalPart,
    Kind,
    PoolingStatistics,
    PowerStatistics,
    SlowestFlown,
)
from flightpower.analysis.settings import CURVES
from flightpower.analysis.uncertain import Uncertain
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array


def condition_result(condition: Condition) -> ConditionResult:
    return ConditionResult(weight_N=condition.weight_N, air_density_kgpm3=condition.rho)


def curve_result(
    curve: Curve,
    standard: Condition | None = None,
    *,
    parts: list[IntervalPart] | None = None,
    statistics: PoolingStatistics | PowerStatistics | None = None,
    battery: BatteryResult | None = None,
) -> CurveResult:
    """Return a curve of any kind with its best speeds, in the form of the results.

    parts : of the interval; by default those from the curve's own and shared errors
    battery : the one that supplies the power of the curve
    """
    longest = {}
    if battery and curve.kind is Kind.ELECTRICAL:
        longest = {
            "endurance_s": curve.longest(Cost.POWER, battery.usable_J),
            "range_m": curve.longest(Cost.ENERGY_PER_METER, battery.usable_J),
        }
    return CurveResult(
        condition=condition_result(curve.condition),
        points=curve.points(),
        standard=curve.at(standard).points() if standard else [],
        least_power_speed=curve.best(Cost.POWER),
        best_range_speed=curve.best(Cost.ENERGY_PER_METER),
        interval_parts=_parts(curve) if parts is None else parts,
        idle_power_W=curve.idle_W,
        statistics=statistics,
        **longest,
    )


def _parts(curve: Curve) -> list[IntervalPart]:
    noise, systematic = (NORMAL_95 * np.sqrt(np.diag(part)) for part in (curve.power_W.own, curve.power_W.by_shared))
    return [
        IntervalPart(speed_mps=v, noise_W=n, systematic_W=s)
        for v, n, s in zip(curve.V_mps.tolist(), noise.tolist(), systematic.tolist(), strict=True)
    ]


def power_statistics(V_mps: Array, power_W: Uncertain) -> PowerStatistics:
    """Return power at speeds (n,) with the flight's own errors and those shared with other flights, as in results."""
    return PowerStatistics(
        speed_mps=V_mps.tolist(),
        power_W=power_W.value.tolist(),
        own_covariance=power_W.own.tolist(),
        shared={str(name): change.tolist() for name, change in power_W.shared.items()},
    )


def power_curve(
    polar: Polar,
    condition: Condition,
    flown_CL: tuple[float, float],
    flown: tuple[pd.DataFrame, Condition] | None = None,
) -> PolarCurve:
    """Return power required over a range of lift coefficients.

    flown: rows of the runs and their condition; used to mark points that depend on linear extrapolation of the
    propeller table.
    """
    curve = polar_curve(polar, condition, flown_CL)
    if flown is None:
        return curve
    rows, flown_condition = flown
    covered = thrust_known(rows, speed_at(lift_coefficient(curve.V_mps, condition), flown_condition))
    return replace(curve, extrapolated=~covered)


def slowest_flown(table: pd.DataFrame, flown_CL: tuple[float, float], condition: Condition) -> SlowestFlown:
    """Return the slowest speed flown and the largest lift coefficient. table: from `air_data`, for the whole flight."""
    carried = largest_lift(table, condition)
    return SlowestFlown(
        speed_mps=float(speed_at(flown_CL[1], condition)),
        lift_coefficient=flown_CL[1],
        largest_lift_coefficient=carried if np.isfinite(carried) else flown_CL[1],
    )


def drag_polar(polar: Polar, aircraft: Aircraft) -> DragPolar:
    A0, A1, A2 = (float(a) for a in polar.A)
    classic, best = classic_form(polar.A, aircraft.aspect_ratio), maximum_lift_to_drag(polar.A)
    return DragPolar(
        A0=A0,
        A1=A1,
        A2=A2,
        CD0=classic.CD0,
        K=classic.K,
        CL_minD=classic.CL_minD,
        oswald_efficiency=classic.oswald,
        maximum_lift_to_drag=best if np.isfinite(best) else None,
    )


def two_term_polar(polar: Polar, flown_CL: tuple[float, float]) -> tuple[Interval, Interval]:
    """Return C_D0 and B of the C_D = C_D0 + B C_L^2 that is closest over the lift coefficients flown."""
    CL = np.linspace(*flown_CL, CURVES.points)
    terms = drag_terms(CL)
    nearest = np.linalg.pinv(terms[:, [0, 2]]) @ terms
    values, errors = nearest @ polar.A, np.sqrt(np.diag(nearest @ polar.covariance @ nearest.T))
    CD0, B = (
        Interval(value=float(x), lo=float(x - NORMAL_95 * e), hi=float(x + NORMAL_95 * e))
        for x, e in zip(values, errors, strict=True)
    )
    return CD0, B


def interval_parts(estimate: DynamicEstimate, aircraft: Aircraft, condition: Condition, V: Array) -> list[IntervalPart]:
    """Return half widths of the curve's interval due to noise, and due to the errors that all runs share."""
    variances = variance_by_source(estimate, aircraft, condition, V)
    nothing = np.zeros(len(V))
    noise = variances.pop(Share.NOISE, nothing)
    half_widths = NORMAL_95 * np.sqrt([noise, sum(variances.values(), start=nothing)])
    return [
        IntervalPart(speed_mps=v, noise_W=by_noise, systematic_W=systematic)
        for v, by_noise, systematic in zip(V.tolist(), *half_widths.tolist(), strict=True)
    ]
