"""All results of an analysis in the form of `results.json`."""

import msgspec
import numpy as np

from analysis.drag.estimate import Estimated
from analysis.electrical.estimate import ElectricalEstimate
from analysis.performance.full_throttle import speed_over_motor_constant
from analysis.polar import Condition, best_range_lift, minimum_power_lift
from analysis.results import flight_found, methods, power_curves
from analysis.results.autopilot_parameters import of_power_required
from analysis.results.electrical import electrical_points
from analysis.results.pooling_statistics import mean_battery_V, pooling_statistics, start_unix_s
from analysis.results.provenance import provenance
from analysis.schema import (
    AircraftResult,
    ConditionResult,
    PerformanceResult,
    PoolingStatistics,
    RejectedResult,
    Results,
    RunResult,
)
from analysis.trajectory.consistency import Consistency
from flight.atmosphere import SEA_LEVEL_DENSITY
from flight.version import version


def assemble(
    flight: Estimated,
    agreement: Consistency,
    performance: PerformanceResult | None,
    electrical: ElectricalEstimate | None,
    command_line: str,
) -> Results:
    """The contents of `results.json` but for what to fly next.

    electrical: None where the log does not determine the electrical curve. command_line: that started the analysis.
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
    power_required = power_curves.power_curve(polar, condition, flown_CL, (rows_flown, condition))
    check = drag.cross_check
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
        test=ConditionResult(weight_N=condition.weight_N, air_density_kgpm3=condition.rho),
        standard=ConditionResult(weight_N=standard.weight_N, air_density_kgpm3=standard.rho),
        air_temperature_K=float(rows_flown["temperature_K"].mean()),
        air_pressure_Pa=float(rows_flown["static_Pa"].mean()),
        runs=msgspec.convert(maneuvers.maneuvers, list[RunResult], from_attributes=True),
        rejected=msgspec.convert(maneuvers.rejected, list[RejectedResult], from_attributes=True),
        parameters=drag.main.parameters
        + ([flight_found.static_thrust(drag.main)] if aircraft.propulsion.static_thrust_ratio is not None else []),
        drag_polar=power_curves.drag_polar(polar, aircraft),
        power_required=power_required,
        power_required_standard=power_curves.power_curve(polar, standard, flown_CL, (rows_flown, condition)),
        cross_check=power_curves.power_curve(check.polar, condition, flown_CL, (rows_flown, condition))
        if check and check.converged
        else [],
        cross_check_differs=drag.cross_check_differs,
        minimum_power_speed=power_curves.optimum(minimum_power_lift, polar, condition, flown_CL),
        best_range_speed=power_curves.optimum(best_range_lift, polar, condition, flown_CL),
        slowest_flown=power_curves.slowest_flown(flight.table, flown_CL, condition),
        status=drag.main.status,
        verdict=drag.main.verdict,
        warnings=list(flight.notes),
        methods_tried=drag.ladder,
        methods=[methods.method_result(estimate, condition, flown_CL[1]) for estimate in drag.methods],
        one_by_one=[methods.method_result(estimate, condition, flown_CL[1]) for estimate in drag.one_by_one],
        runs_against_others=drag.runs_against_others,
        accelerations_against_decelerations=drag.accelerations_against_decelerations or msgspec.UNSET,
        disagreements=drag.disagreements,
        interval_parts=power_curves.interval_parts(
            drag.main, aircraft, condition, np.array([point.speed_mps for point in power_required])
        ),
        path=flight_found.path_result(trajectory, agreement, flight.prior_conflict.beyond),
        speed_over_motor_constant=speed_over_motor_constant(flight.table, aircraft.propulsion),
        use=performance,
        pooling=_pooling(flight),
        provenance=provenance(flight, flight.runs_file, command_line),
        air=flight_found.air_found(trajectory, rows_flown, condition),
        run_residuals=flight_found.run_residuals(drag.main, {run.name: run.kind for run in maneuvers.level_runs}),
        parameter_correlation=flight_found.parameter_correlation(drag.main),
        track=flight_found.track(trajectory),
        electrical_power=electrical_points(electrical) if electrical else [],
        pitch_rate=drag.likelihood.pitch_rate,
    )
    parameters, withheld = of_power_required(results, *power_curves.two_term_polar(polar, flown_CL))
    return msgspec.structs.replace(results, autopilot_parameters=parameters, autopilot_parameters_withheld=withheld)


def _pooling(flight: Estimated) -> PoolingStatistics | None:
    statistics = pooling_statistics(
        flight.drag.main, flight.drag.flown_CL, flight.aircraft, flight.propeller, flight.contents.calibrations
    )
    return statistics and msgspec.structs.replace(
        statistics, start_unix_s=start_unix_s(flight.log), battery_V=mean_battery_V(flight.rows_flown)
    )
