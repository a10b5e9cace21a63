"""The whole way from a log to results: the order of the steps, and nothing else."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd

from analysis import methods, recorded, summary
from analysis.airdata import lines, magnetometer, skew
from analysis.airdata.air import air_data
from analysis.channels import synchronise
from analysis.path.consistency import Consistency, consistency
from analysis.path.observability import heading_said, learnt, notes
from analysis.path.reconstruct import Path as FlightPath
from analysis.path.reconstruct import reconstruct
from analysis.performance import Day, flight_data, interval_parts, thrust_coverage, use
from analysis.power import curve, dynamic, output_error
from analysis.questions import Questions
from analysis.results import AircraftResult, ConditionResult, ParameterResult, PowerPoint, Results
from analysis.runs import Found, Run, edit
from analysis.runs.find import find
from analysis.runs.kinds import LEVEL, LOADS, STEADY
from analysis.stillness import still_segments, zero_of_attachment, zeros
from flight.aircraft import Aircraft
from flight.atmosphere import SEA_LEVEL_DENSITY
from flight.errors import InputError
from flight.log_reader import Log
from flight.propeller import Propeller

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
    found: Found
    path: FlightPath
    consistency: Consistency


def analyze(
    log: Log,
    aircraft: Aircraft | None = None,
    progress: Progress = lambda _: None,
    *,
    propeller: Propeller | None = None,
    questions: Questions = Questions(),
    runs_file: Path | None = None,
    magnetometer_calibration: magnetometer.MagnetometerCalibration | None = None,
) -> Analysis:
    """A log to power required.

    aircraft, propeller, magnetometer_calibration: to use instead of those the log carries. questions: what the curve is
    to answer. runs_file: runs to use instead of those found (`runs.edit`).
    Raises InputError when the log lacks something that nothing can replace, or holds no run.
    """
    entries = edit.load(runs_file) if runs_file else None
    aircraft = aircraft or recorded.aircraft_of(log)
    propeller = propeller or recorded.propeller_of(log, aircraft)
    propeller = propeller.with_beyond_zero_thrust(aircraft.propulsion.beyond_zero_thrust)
    probe = recorded.probe_of(log)
    of_compass = magnetometer_calibration or recorded.magnetometer_of(log)
    warnings = recorded.state_of(log)

    progress("synchronising")
    gas = lines.air_in(log)
    channels = synchronise(log, lines.lags_s(aircraft, gas))
    table, said_of_lines = lines.sharpened(channels.table, aircraft, gas)
    warnings += channels.notes + said_of_lines
    still = still_segments(table, channels.rate_Hz)
    at_rest = zeros(table, still, zero_of_attachment(log.attachments.get("zero.json"), f"{log.path}: zero.json"))
    air = air_data(table, aircraft, probe, propeller, at_rest)
    compass, said_of_compass = magnetometer.compass(air.table, of_compass) if of_compass else (None, [])
    warnings += air.notes + recorded.silent_topics(air.table) + said_of_compass

    progress("finding runs")
    found = find(air.table, still)
    if entries:
        found = edit.taken(entries, air.table, found.rejected, str(runs_file))
    runs = found.of(*LEVEL)
    used = runs or found.of(STEADY, *LOADS)
    if not used and runs_file:
        raise InputError(f"{runs_file}: keeps no run to analyse: none is {', '.join((*LEVEL, STEADY, *LOADS))}")
    if not used:
        missed = [stretch for stretch in found.rejected if stretch.kind in LEVEL]
        why = summary.nearest_miss(missed, air.table)
        raise InputError(f"{log.path}: no acceleration or deceleration to analyse{why}")

    flown = pd.concat([air.table.iloc[run.rows] for run in used])
    flown_CL = summary.flown_lift(flown, aircraft)
    test = curve.Condition(aircraft.mass.weight_N, float(flown["rho"].mean()), aircraft.geometry.wing_area_m2)
    standard = curve.Condition(aircraft.mass.standard_weight_N, SEA_LEVEL_DENSITY, aircraft.geometry.wing_area_m2)
    warnings += thrust_coverage(flown, propeller)

    progress("reconstructing the flight path")
    try:
        path = reconstruct(air.table, still, alpha_scale_sigma=probe.alpha_scale_sigma, compass=compass)
    except InputError as error:
        raise InputError(f"{log.path}: {error}") from None
    warnings += summary.gusts_said(path, len(runs), str(log.path))
    warnings += skew.notes(path)
    warnings += heading_said(air.table, path, calibrated=of_compass is not None)
    sensor_errors = learnt(air.table, path)
    warnings += notes(sensor_errors)
    agreement = consistency(air.table, path)
    progress(f"estimating drag from {len(used)} runs")
    by_runs = dynamic.estimate_polar(air.table, path, runs, aircraft, propeller) if runs else None
    absurd = curve.absurd(by_runs.polar, flown_CL) if by_runs else ""
    if absurd:
        whence = "one run alone" if len(runs) == 1 else f"these {len(runs)} runs"
        raise InputError(f"{log.path}: by {whence} {absurd}; keep or fly more runs, longer, over more speeds")
    progress("asking every other method")
    asked = methods.every_method(air.table, path, found.runs, by_runs, flown_CL, aircraft, propeller, test)
    estimate, flown_CL = (by_runs, flown_CL) if by_runs else methods.leading(asked.answers, path, str(log.path))
    warnings += estimate.warnings + methods.scatter(asked.one_by_one, test)
    cross_check: list[PowerPoint] = []
    cross_check_by = "output error"
    if runs:
        progress("checking by the runs alone")
        try:
            check = output_error.estimate_polar(
                air.table, runs, aircraft, zeroed=at_rest is not None, propeller=propeller
            )
        except (InputError, np.linalg.LinAlgError) as error:
            warnings.append(f"The cross-check over the runs alone could not be made: {error}.")
        else:
            cross_check_by = check.by
            if check.converged:
                cross_check = summary.points(check.polar, test, flown_CL, (flown, test))
            warnings += summary.cross_check_said(estimate.polar, check, test, flown_CL)

    pressure_Pa, temperature_K = float(flown["static_Pa"].mean()), float(flown["temperature_K"].mean())
    power_required = summary.points(estimate.polar, test, flown_CL, (flown, test))
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
        runs=[summary.run_result(run) for run in found.runs],
        rejected=[summary.rejected_result(stretch) for stretch in found.rejected],
        parameters=[
            ParameterResult(name=name, value=value, standard_error=error, unit=unit)
            for name, value, error, unit in estimate.parameters
        ],
        drag_polar=summary.drag_polar(estimate.polar, aircraft),
        power_required=power_required,
        power_required_standard=summary.points(estimate.polar, standard, flown_CL, (flown, test)),
        cross_check=cross_check,
        cross_check_by=cross_check_by,
        minimum_power_speed=summary.special(curve.minimum_power_lift, estimate.polar, test, flown_CL),
        best_range_speed=summary.special(curve.best_range_lift, estimate.polar, test, flown_CL),
        verdict=estimate.verdict,
        warnings=warnings,
        methods=[methods.method_result(answer, test) for answer in asked.answers],
        one_by_one=[methods.method_result(answer, test) for answer in asked.one_by_one],
        disagreements=[methods.disagreement_result(one) for one in asked.disagreements],
        interval_parts=interval_parts(estimate, test, np.array([point.speed_mps for point in power_required])),
        path=summary.path_result(path, agreement, sensor_errors),
        use=answered,
    )
    return Analysis(results, air.table, runs, estimate, estimate.polar, flown_CL, found, path, agreement)
