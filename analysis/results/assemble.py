"""Puts all results of an analysis into the form of `results.json`."""

import hashlib
from functools import partial

import msgspec
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.air.flight_data import Calibrations
from flightpower.analysis.curve import Condition, speed_at
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.methods.interval_sources import variance_by_source
from flightpower.analysis.methods.ladder import Estimated
from flightpower.analysis.methods.method import MethodEstimate, SteadyPoint
from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate
from flightpower.analysis.performance.autopilot_parameters import of_power_required
from flightpower.analysis.performance.full_throttle import speed_over_motor_constant
from flightpower.analysis.records.flight import (
    AircraftResult,
    BatteryResult,
    Kind,
    MethodPoint,
    MethodResult,
    PerformanceResult,
    PoolingStatistics,
    PriorMeasurementStatistics,
    RejectedResult,
    Results,
    RunResult,
)
from flightpower.analysis.results import assemble as methods
from flightpower.analysis.results import curves as power_curves
from flightpower.analysis.results import flight_found
from flightpower.analysis.results.curves import power_curve
from flightpower.analysis.results.energy_balance import against_field_table, electrical_curve
from flightpower.analysis.results.next_flight import next_flight
from flightpower.analysis.results.provenance import provenance
from flightpower.analysis.trajectory.consistency import Consistency
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY
from flightpower.flight.propeller import Propeller
from flightpower.flight.version import version


def assemble(
    flight: Estimated,
    agreement: Consistency,
    performance: PerformanceResult | None,
    electrical: ElectricalEstimate | None,
    battery: BatteryResult | None,
    command_line: str,
) -> Results:
    """Return the contents of `results.json` except for its trust. electrical: None if the log does not determine the
    electrical curve. command_line: the one that started the analysis.
    """
    aircraft, propeller, drag = flight.aircraft, flight.propeller, flight.drag
    condition, maneuvers, rows_flown, trajectory = (
        flight.condition,
        flight.maneuvers,
        flight.rows_flown,
        flight.trajectory,
    )
    polar, flown_CL = drag.main.polar, drag.flown_CL
    standard = Condition(aircraft.mass.standard_weight_N, SEA_LEVEL_DENSITY, aircraft.geometry.wing_area_m2)
    curve = power_curves.power_curve(polar, condition, flown_CL, (rows_flown, condition))
    parts = power_curves.interval_parts(drag.main, aircraft, condition, curve.V_mps)
    curves = {Kind.POWER_REQUIRED: power_curves.curve_result(curve, standard, parts=parts, statistics=_pooling(flight))}
    notes = list(flight.notes)
    if electrical:
        curves[Kind.ELECTRICAL] = electrical_curve(electrical, standard, battery)
        rows = performance.field_table if performance else []
        notes += against_field_table(curves[Kind.ELECTRICAL], curves[Kind.POWER_REQUIRED].points, rows)
    check = drag.cross_check
    sources = partial(variance_by_source, drag.main, aircraft, condition)
    advice = next_flight(trajectory, polar, condition, flown_CL, sources)
    results = Results(
        software_version=version(),
        log=flight.name,
        aircraft=AircraftResult(
            name=aircraft.name,
            title=aircraft.title,
            wing_area_m2=aircraft.geometry.wing_area_m2,
            span_m=aircraft.geometry.span_m,
            propeller=propeller.name,
        ),
        test=power_curves.condition_result(condition),
        standard=power_curves.condition_result(standard),
        kind=Kind.POWER_REQUIRED,
        curves=curves,
        battery=battery,
        runs=msgspec.convert(maneuvers.maneuvers, list[RunResult], from_attributes=True),
        rejected=msgspec.convert(maneuvers.rejected, list[RejectedResult], from_attributes=True),
        parameters=drag.main.parameters
        + ([flight_found.static_thrust(drag.main)] if aircraft.propulsion.static_thrust_ratio is not None else []),
        drag_polar=power_curves.drag_polar(polar, aircraft),
        cross_check=power_curves.power_curve(check.polar, condition, flown_CL, (rows_flown, condition)).points()
        if check and check.converged
        else [],
        cross_check_differs=drag.cross_check_differs,
        slowest_flown=power_curves.slowest_flown(flight.table, flown_CL, condition),
        status=drag.main.status,
        verdict=drag.main.verdict,
        warnings=notes,
        methods_tried=drag.ladder,
        methods=[methods.method_result(estimate, condition, flown_CL[1]) for estimate in drag.methods],
        single_runs=[methods.method_result(estimate, condition, flown_CL[1]) for estimate in drag.single_runs],
        runs_against_others=drag.runs_against_others,
        accelerations_against_decelerations=drag.accelerations_against_decelerations or msgspec.UNSET,
        other_blades_gain=drag.main.other_blades_gain or msgspec.UNSET,
        disagreements=drag.disagreements,
        path=flight_found.path_result(trajectory, agreement, flight.prior_conflict),
        speed_over_motor_constant=speed_over_motor_constant(flight.table, aircraft.propulsion),
        use=performance,
        provenance=provenance(flight, flight.runs_file, command_line),
        air=flight_found.air_found(trajectory, rows_flown, condition),
        run_residuals=flight_found.run_residuals(drag.main, {run.name: run.kind for run in maneuvers.level_runs}),
        parameter_correlation=flight_found.parameter_correlation(drag.main),
        track=flight_found.track(trajectory),
        pitch_rate=drag.likelihood.pitch_rate,
        next_flight=list(advice.sentences),
        next_flight_lowers=advice.lowers,
    )
    parameters, withheld = of_power_required(results, performance, *power_curves.two_term_polar(polar, flown_CL))
    return msgspec.structs.replace(results, autopilot_parameters=parameters, autopilot_parameters_withheld=withheld)


def _pooling(flight: Estimated) -> PoolingStatistics | None:
    statistics = pooling_statistics(
        flight.drag.main, flight.drag.flown_CL, flight.aircraft, flight.propeller, flight.contents.calibrations
    )
    return statistics and msgspec.structs.replace(
        statistics, start_unix_s=flight.fix.unix_at_zero_s, battery_V=mean_battery_V(flight.rows_flown)
    )


def pooling_statistics(
    estimate: DynamicEstimate,
    flown_CL: tuple[float, float],
    aircraft: Aircraft,
    propeller: Propeller,
    calibrations: Calibrations,
) -> PoolingStatistics | None:
    """Return statistics for pooling; None unless the method is the dynamic one, as others have no sensor errors."""
    joint = estimate.joint
    if joint is None:
        return None
    return PoolingStatistics(
        names=list(joint.names),
        values=joint.parameters.value.tolist(),
        covariance=_lower_triangle(joint.parameters.own),
        weighting_covariance=_lower_triangle(joint.weighting_covariance),
        prior_mean=joint.prior_mean.tolist(),
        prior_sigma=[float(sigma) if np.isfinite(sigma) else None for sigma in joint.prior_sigma],
        prior_measurements=[
            PriorMeasurementStatistics(
                name=prior_measurement.name,
                coefficients=dict(prior_measurement.coefficients),
                value=prior_measurement.value,
                sigma=prior_measurement.sigma,
            )
            for prior_measurement in joint.prior_measurements
        ]
        or msgspec.UNSET,
        changes={name: change.tolist() for name, change in joint.parameters.shared.items() if np.any(change)},
        polar_covariance=estimate.polar.covariance.tolist(),
        flown_CL=flown_CL,
        installation=aircraft.installation.name,
        propeller_table=_fingerprint(
            repr((propeller.diameter_m, propeller.beyond_zero_thrust, propeller.rows)).encode()
        ),
        probe_calibration=_fingerprint(
            msgspec.json.encode(calibrations.probe)
            + (msgspec.json.encode(calibrations.transducers) if calibrations.transducers else b"")
            + (msgspec.json.encode(calibrations.airspeed) if calibrations.airspeed else b"")
        ),
    )


def mean_battery_V(rows_flown: pd.DataFrame) -> float | None:
    """Return the mean battery voltage over the runs; None if it was not measured. rows_flown: from `air_data`."""
    if "battery_V" not in rows_flown or rows_flown["battery_V"].isna().all():
        return None
    return float(rows_flown["battery_V"].mean())


def _lower_triangle(matrix: NDArray[np.float64]) -> list[list[float]]:
    return [row[: i + 1] for i, row in enumerate(matrix.tolist())]


def _fingerprint(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:12]


def method_result(estimate: MethodEstimate, condition: Condition, largest_CL: float) -> MethodResult:
    """Return a method's curve over the lift coefficients of its data, and its points, at one weight and density.

    largest_CL : in level flight at the slowest speed flown. Gusts and pull-ups require larger lift coefficients; the
    curve ends at largest_CL, or at the method's own slowest steady point if that is slower.
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
        power_required=power_curve(polar, condition, (smallest, largest)).points()
        if polar and smallest < largest
        else [],
        points=[_point(point, condition) for point in estimate.points],
        notes=list(estimate.notes),
        not_flown=list(estimate.not_flown),
    )


def _point(point: SteadyPoint, condition: Condition) -> MethodPoint:
    """Convert a steady point to another weight and density, with the same lift and drag coefficients."""
    V = float(speed_at(point.CL, condition))
    unit = condition.rho * V**3 * condition.wing_area_m2 / 2
    power, half = unit * point.CD, NORMAL_95 * unit * point.CD_error
    return MethodPoint(
        speed_mps=V, power_W=power, power_lo_W=power - half, power_hi_W=power + half, start_s=point.start_s
    )
