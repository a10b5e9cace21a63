"""The whole way from a log to results: the order of the steps, and nothing else."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np
import pandas as pd
from msgspec.structs import replace

from analysis.airdata import lines
from analysis.airdata.air import air_data
from analysis.airdata.probe import parse_probe
from analysis.channels import COLUMNS, synchronise
from analysis.path.reconstruct import reconstruct
from analysis.power import curve, dynamic, output_error
from analysis.questions import Questions
from analysis.results import (
    AircraftResult,
    ConditionResult,
    DragPolar,
    ParameterResult,
    PowerPoint,
    RejectedResult,
    Results,
    RunResult,
    SpeedInterval,
)
from analysis.runs import Rejected, Run, find_runs
from analysis.stillness import still_segments, zeros
from analysis.use import Day, flight_data, interval_parts, thrust_coverage, thrust_known, use
from flight.aircraft import Aircraft, parse_aircraft
from flight.atmosphere import SEA_LEVEL_DENSITY
from flight.errors import InputError
from flight.log_reader import Log
from flight.propeller import Propeller, parse_propeller

CURVE_POINTS = 61
LARGEST_UNMENTIONED_LOSS = 0.02
ROBUST_RANGE = (1.0, 99.0)  # percentiles of the flown lift coefficients between which the curve is drawn

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Analysis:
    """Everything the report draws."""

    results: Results
    table: pd.DataFrame
    runs: list[Run]
    estimate: dynamic.DynamicEstimate
    polar: curve.Polar
    flown_CL: tuple[float, float]


def analyze(
    log: Log,
    aircraft: Aircraft | None = None,
    progress: Progress = lambda _: None,
    *,
    propeller: Propeller | None = None,
    questions: Questions = Questions(),
) -> Analysis:
    """A log to power required.

    aircraft, propeller: to use instead of those the log carries. questions: what the curve is to answer.
    Raises InputError when the log lacks something that nothing can replace, or holds no run.
    """
    aircraft = aircraft or _aircraft_of(log)
    if propeller is None:
        propeller = _propeller_of(log, aircraft)
    propeller = propeller.beyond(aircraft.propulsion.beyond_zero_thrust)
    probe = parse_probe(
        _attachment(log, "probe.json", "calibrate the probe and name the file in the tray"), "probe.json"
    )
    warnings = [f"The log is torn ({log.torn}); what came before is used."] if log.torn else []
    if log.undecodable:
        warnings.append(f"{log.undecodable} messages could not be decoded and are left out.")

    progress("synchronising")
    gas = lines.air_in(log)
    channels = synchronise(log, lines.lags_s(aircraft, gas))
    table, said_of_lines = lines.sharpened(channels.table, aircraft, gas)
    warnings += said_of_lines
    still = still_segments(table, channels.rate_Hz)
    at_rest = zeros(table, still)
    air = air_data(table, aircraft, probe, propeller, at_rest)
    warnings += air.notes + _silent_topics(air.table)

    progress("finding runs")
    runs, rejected = find_runs(air.table)
    if not runs:
        raise InputError(f"{log.path}: no acceleration or deceleration to analyse{_nearest_miss(rejected)}")

    flown = pd.concat([air.table.iloc[run.rows] for run in runs])
    warnings += thrust_coverage(flown, propeller)

    progress("reconstructing the flight path")
    path = reconstruct(air.table, still)
    progress(f"estimating drag from {len(runs)} runs")
    estimate = dynamic.estimate_polar(air.table, path, runs, aircraft, propeller)
    warnings += estimate.warnings
    progress("checking by output error")
    check = output_error.estimate_polar(air.table, runs, aircraft, zeroed=at_rest is not None)

    progress("computing the curve")
    flown_CL = _flown_lift(flown, aircraft)
    test = curve.Condition(aircraft.mass.weight_N, float(flown["rho"].mean()), aircraft.geometry.wing_area_m2)
    standard = curve.Condition(aircraft.mass.standard_weight_N, SEA_LEVEL_DENSITY, aircraft.geometry.wing_area_m2)
    warnings += _disagreement(estimate.polar, check, test, flown_CL)
    pressure_Pa, temperature_K = float(flown["static_Pa"].mean()), float(flown["temperature_K"].mean())
    power_required = _flagged(_points(estimate.polar, test, flown_CL), flown)
    progress("answering")
    data = flight_data(air.table, path, aircraft, propeller)
    day = Day(test, pressure_Pa, temperature_K)
    answered = use(questions, data, estimate, aircraft, propeller, day, flown_CL)
    results = Results(
        software_version=version("flightpower"),
        log=str(log.path),
        aircraft=AircraftResult(
            name=aircraft.name,
            title=aircraft.title,
            wing_area_m2=aircraft.geometry.wing_area_m2,
            span_m=aircraft.geometry.span_m,
            propeller=propeller.name,
        ),
        test=ConditionResult(weight_N=test.weight_N, air_density_kgpm3=test.rho),
        standard=ConditionResult(weight_N=standard.weight_N, air_density_kgpm3=standard.rho),
        air_temperature_K=temperature_K,
        air_pressure_Pa=pressure_Pa,
        runs=[
            RunResult(
                kind=run.kind,
                start_s=run.start_s,
                end_s=run.end_s,
                lowest_speed_mps=run.lowest_speed_mps,
                highest_speed_mps=run.highest_speed_mps,
                altitude_change_m=run.altitude_change_m,
                notes=list(run.notes),
            )
            for run in runs
        ],
        rejected=[RejectedResult(kind=r.kind, start_s=r.start_s, end_s=r.end_s, reason=r.reason) for r in rejected],
        parameters=[
            ParameterResult(name=name, value=value, standard_error=error, unit=unit)
            for name, value, error, unit in estimate.parameters
        ],
        drag_polar=_drag_polar(estimate.polar, aircraft),
        power_required=power_required,
        power_required_standard=_points(estimate.polar, standard, flown_CL),
        cross_check=_points(check.polar, test, flown_CL),
        minimum_power_speed=_special(curve.minimum_power_lift, estimate.polar, test, flown_CL),
        best_range_speed=_special(curve.best_range_lift, estimate.polar, test, flown_CL),
        verdict=estimate.verdict,
        warnings=warnings,
        interval_parts=interval_parts(estimate, test, np.array([point.speed_mps for point in power_required])),
        use=answered,
    )
    return Analysis(results, air.table, runs, estimate, estimate.polar, flown_CL)


def _attachment(log: Log, name: str, remedy: str) -> bytes:
    if name not in log.attachments:
        raise InputError(f"{log.path}: carries no {name}; {remedy}")
    return log.attachments[name]


def _aircraft_of(log: Log) -> Aircraft:
    text = _attachment(log, "aircraft.toml", "give one with --aircraft FILE")
    return parse_aircraft(text.decode("utf-8", errors="replace"), f"{log.path}: aircraft.toml")


def _propeller_of(log: Log, aircraft: Aircraft) -> Propeller:
    table = _attachment(log, "propeller.csv", "the tray's aircraft file names the propeller that goes into logs")
    return parse_propeller(table.decode("utf-8", errors="replace"), aircraft.propulsion.propeller)


def _silent_topics(table: pd.DataFrame) -> list[str]:
    """What was lost in flight, for each topic that lost something the curve is made of."""
    lost = table.loc[table["flying"], list(COLUMNS)].isna().mean()
    by_topic = {topic: float(lost[name]) for name, (topic, _) in COLUMNS.items() if topic != "/battery"}
    return [
        f"{topic} carried no value for {100 * share:.0f} % of the flight."
        for topic, share in by_topic.items()
        if share > LARGEST_UNMENTIONED_LOSS
    ]


def _nearest_miss(rejected: list[Rejected]) -> str:
    if not rejected:
        return " (speed never changed steadily in level flight)"
    longest = max(rejected, key=lambda r: r.end_s - r.start_s)
    return f"; the longest stretch, {longest.start_s:.0f} to {longest.end_s:.0f} s: {longest.reason}"


def _flown_lift(flown: pd.DataFrame, aircraft: Aircraft) -> tuple[float, float]:
    """Range of lift coefficients at which lift would equal weight at the speeds flown: what the curve is drawn over."""
    CL = 2 * aircraft.mass.weight_N / (flown["rho"] * flown["V_mps"] ** 2 * aircraft.geometry.wing_area_m2)
    low, high = np.percentile(CL.dropna(), ROBUST_RANGE)
    return float(low), float(high)


def _points(polar: curve.Polar, at: curve.Condition, flown_CL: tuple[float, float]) -> list[PowerPoint]:
    V = np.linspace(curve.speed_at(flown_CL[1], at), curve.speed_at(flown_CL[0], at), CURVE_POINTS)
    power, error = curve.power_required(V, polar, at)
    half = curve.NORMAL_95 * error
    return [
        PowerPoint(speed_mps=float(v), power_W=float(p), power_lo_W=float(p - h), power_hi_W=float(p + h))
        for v, p, h in zip(V, power, half, strict=True)
    ]


def _flagged(points: list[PowerPoint], flown: pd.DataFrame) -> list[PowerPoint]:
    """The curve, with what rests on a continued propeller table marked as extrapolated."""
    known = thrust_known(flown, np.array([point.speed_mps for point in points]))
    return [replace(point, extrapolated=not sure) for point, sure in zip(points, known, strict=True)]


def _disagreement(
    polar: curve.Polar, check: output_error.CrossCheck, at: curve.Condition, flown_CL: tuple[float, float]
) -> list[str]:
    """Whether the two methods differ by more than both their intervals allow, and where most."""
    if not check.converged:
        return [f"The cross-check by output error did not end well: {check.verdict}."]
    V = np.linspace(curve.speed_at(flown_CL[1], at), curve.speed_at(flown_CL[0], at), CURVE_POINTS)
    (power, error), (other, other_error) = (curve.power_required(V, p, at) for p in (polar, check.polar))
    excess = np.abs(other - power) / (curve.NORMAL_95 * np.hypot(error, other_error))
    worst = int(np.argmax(excess))
    if excess[worst] <= 1:
        return []
    return [
        f"Output error over the runs alone differs by {100 * (other[worst] / power[worst] - 1):+.0f} % at"
        f" {V[worst]:.1f} m/s, more than both intervals allow: look at the fits below."
    ]


def _special(lift_of, polar: curve.Polar, at: curve.Condition, flown_CL: tuple[float, float]) -> SpeedInterval:
    CL = lift_of(polar.A)
    if not np.isfinite(CL):
        return SpeedInterval(speed_mps=None, lo_mps=None, hi_mps=None, inside_flown_range=False)
    speed, lo, hi = curve.special_speed(lift_of, polar, at)
    return SpeedInterval(
        speed_mps=speed, lo_mps=lo, hi_mps=hi, inside_flown_range=bool(flown_CL[0] <= CL <= flown_CL[1])
    )


def _drag_polar(polar: curve.Polar, aircraft: Aircraft) -> DragPolar:
    A0, A1, A2 = (float(a) for a in polar.A)
    classic = curve.classic_form(polar.A, aircraft.aspect_ratio)
    return DragPolar(
        A0=A0,
        A1=A1,
        A2=A2,
        CD0=classic.CD0,
        K=classic.K,
        CL_minD=classic.CL_minD,
        oswald_efficiency=classic.oswald,
        maximum_lift_to_drag=curve.maximum_lift_to_drag(polar.A),
    )
