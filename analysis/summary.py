"""Estimates in the form that `results.json` has: curves with their intervals, special speeds, polars, runs."""

import numpy as np
import pandas as pd

from analysis.airdata.air import FLYING_PA
from analysis.channels import COLUMNS
from analysis.intervals import NORMAL_95
from analysis.path.consistency import ANGLES, SPEED, Consistency, spread
from analysis.path.observability import Learnt
from analysis.path.reconstruct import Path
from analysis.performance import thrust_known
from analysis.power import curve
from analysis.power.method import ROBUST_RANGE
from analysis.power.output_error import CrossCheck
from analysis.results import (
    Check,
    ConsistencyCheck,
    DragPolar,
    PathResult,
    PowerPoint,
    RejectedResult,
    RunResult,
    SensorError,
    SpeedInterval,
)
from analysis.runs import Rejected, Run
from flight.aircraft import Aircraft
from flight.errors import InputError

CURVE_POINTS = 61
PRESSURES = ("q_c_Pa", "dp_alpha_Pa", "static_Pa")  # without any of these nothing looks like flight
UNCERTAIN_ALPHA_DEG, TURBULENT_MPS = 0.3, 0.3  # W20 = 6 kt and more, as the path finds it


def flown_lift(flown: pd.DataFrame, aircraft: Aircraft) -> tuple[float, float]:
    """Range of lift coefficients at which lift would equal weight at the speeds flown: what the curve is drawn over."""
    CL = 2 * aircraft.mass.weight_N / (flown["rho"] * flown["V_mps"] ** 2 * aircraft.geometry.wing_area_m2)
    low, high = np.percentile(CL.dropna(), ROBUST_RANGE)
    return float(low), float(high)


def points(
    polar: curve.Polar,
    at: curve.Condition,
    flown_CL: tuple[float, float],
    flown: tuple[pd.DataFrame, curve.Condition] | None = None,
) -> list[PowerPoint]:
    """A curve over a range of lift coefficients.

    flown: rows of the runs, flown at a condition; what rests on a continued propeller table is marked as extrapolated.
    """
    V = np.linspace(curve.speed_at(flown_CL[1], at), curve.speed_at(flown_CL[0], at), CURVE_POINTS)
    power, error = curve.power_required(V, polar, at)
    half = NORMAL_95 * error
    known = np.ones(len(V), dtype=bool)
    if flown:
        rows, there = flown
        known = thrust_known(rows, curve.speed_at(curve.lift_coefficient(V, at), there))
    return [
        PowerPoint(
            speed_mps=float(v),
            power_W=float(p),
            power_lo_W=float(p - h),
            power_hi_W=float(p + h),
            extrapolated=not sure,
        )
        for v, p, h, sure in zip(V, power, half, known.tolist(), strict=True)
    ]


def special(lift_of, polar: curve.Polar, at: curve.Condition, flown_CL: tuple[float, float]) -> SpeedInterval:
    """The speed of least power or of best range, whichever `lift_of` gives the lift coefficient of."""
    CL = lift_of(polar.A)
    if not np.isfinite(CL):
        return SpeedInterval(speed_mps=None, lo_mps=None, hi_mps=None, inside_flown_range=False)
    speed, lo, hi = curve.special_speed(lift_of, polar, at)
    return SpeedInterval(
        speed_mps=speed, lo_mps=lo or None, hi_mps=hi, inside_flown_range=bool(flown_CL[0] <= CL <= flown_CL[1])
    )


def drag_polar(polar: curve.Polar, aircraft: Aircraft) -> DragPolar:
    A0, A1, A2 = (float(a) for a in polar.A)
    classic, best = curve.classic_form(polar.A, aircraft.aspect_ratio), curve.maximum_lift_to_drag(polar.A)
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


def run_result(run: Run) -> RunResult:
    return RunResult(
        kind=run.kind,
        start_s=run.start_s,
        end_s=run.end_s,
        lowest_speed_mps=run.lowest_speed_mps,
        highest_speed_mps=run.highest_speed_mps,
        altitude_change_m=run.altitude_change_m,
        notes=list(run.notes),
    )


def rejected_result(stretch: Rejected) -> RejectedResult:
    return RejectedResult(kind=stretch.kind, start_s=stretch.start_s, end_s=stretch.end_s, reason=stretch.reason)


_CHECKS = (
    (ANGLES, "pitch attitude less angle of attack less climb angle, wings level", float(np.degrees(1.0)), "deg"),
    (SPEED, "airspeed less GPS ground speed with the wind taken out", 1.0, "m/s"),
)


def path_result(path: Path, agreement: Consistency, errors: list[Learnt]) -> PathResult:
    """What the flight says of its sensors."""
    checks = []
    for column, title, factor, unit in _CHECKS:
        both = [spread(factor * differences[column]) for differences in agreement]
        said = [
            Check(title=title, unit=unit, mean=s.mean, mean_standard_error=s.standard_error, sigma=s.sigma)
            for s in both
            if s is not None
        ]
        if len(said) == len(both):
            checks.append(ConsistencyCheck(before=said[0], after=said[1]))
    return PathResult(
        converged=path.converged,
        gust_mps=path.gust_mps,
        residuals=path.residuals,
        checks=checks,
        sensor_errors=[
            SensorError(
                name=e.name, title=e.title, value=e.value, standard_error=e.standard_error, assumed_sigma=e.prior_sigma,
                unit=e.unit, determined=e.determined, missing=list(e.missing),
            )
            for e in errors
        ],
    )  # fmt: skip


def nearest_miss(rejected: list[Rejected], table: pd.DataFrame) -> str:
    """Why there is no run: by the longest stretch that was not taken, or since nothing looks like flight."""
    if not table["flying"].any():
        dead = sorted({COLUMNS[name][0] for name in PRESSURES if table[name].isna().all()})
        if dead:
            return f": {', '.join(dead)} showed nothing (a broken transducer or a blocked tube)"
        return (
            f": nothing in it is flight (dynamic pressure stayed below {FLYING_PA:g} Pa, or angles beyond the probe's)"
        )
    if not rejected:
        return " (speed never changed steadily in level flight)"
    longest = max(rejected, key=lambda r: r.end_s - r.start_s)
    return f"; the longest stretch, {longest.start_s:.0f} to {longest.end_s:.0f} s: {longest.reason}"


def cross_check_said(
    polar: curve.Polar, check: CrossCheck, at: curve.Condition, flown_CL: tuple[float, float]
) -> list[str]:
    """Whether curve and cross-check differ by more than both their intervals allow, and where most."""
    if not check.converged:
        return [f"The cross-check by {check.by} did not end well, and is left out: {check.verdict}."]
    V = np.linspace(curve.speed_at(flown_CL[1], at), curve.speed_at(flown_CL[0], at), CURVE_POINTS)
    (power, error), (other, other_error) = (curve.power_required(V, p, at) for p in (polar, check.polar))
    excess = np.abs(other - power) / (NORMAL_95 * np.hypot(error, other_error))
    worst = int(np.argmax(excess))
    if excess[worst] <= 1:
        return []
    return [
        f"{check.by.capitalize()} over the runs alone differs by {100 * (other[worst] / power[worst] - 1):+.0f} % at"
        f" {V[worst]:.1f} m/s, more than both intervals allow: look at the fits below."
    ]


def gusts_said(path: Path, runs: int, log: str) -> list[str]:
    """What turbulence leaves unknown, in words.

    Raises InputError where all there is is one run, and gusts leave the angle of attack more uncertain than one run can
    stand: a degree is 20 % of power near the stall (method section 6).
    """
    sigma_deg = float(np.degrees(path.standard_error("alpha_bias")))
    if sigma_deg < UNCERTAIN_ALPHA_DEG or path.gust_mps < TURBULENT_MPS:
        return []
    said = f"vertical gusts of {path.gust_mps:.1f} m/s leave the angle of attack uncertain by {sigma_deg:.1f} deg"
    if runs == 1:
        raise InputError(f"{log}: one run alone, and {said}; fly more runs, longer, or on a calmer day")
    return [f"In this air {said}: the interval is wide. A longer or a calmer flight makes it narrower."]
