"""From a log to results: the order of the steps."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd
from numpy.typing import ArrayLike

from analysis import log_contents
from analysis.airdata.flight_data import FlightData, flight_data
from analysis.drag import assumed_values
from analysis.drag.assumed_values import with_transducer_uncertainty
from analysis.drag.estimate import DragEstimates, estimate
from analysis.drag.rerun import Repetition
from analysis.electrical.daemon_log import whole_flight
from analysis.flown import check_lift, flown_condition, flown_lift, thrust_coverage
from analysis.log_checks.axes import check_axes
from analysis.log_checks.structure import check_decodable, check_log
from analysis.log_contents import Replacements
from analysis.maneuvers.kinds import FOR_DRAG, Maneuvers
from analysis.maneuvers.runs_file import select
from analysis.performance.analysis import compute as compute_performance
from analysis.performance.request import FlownCondition, Request
from analysis.planning.next_flight import next_flight
from analysis.results.assemble import assemble
from analysis.results.flight_found import air_found, track
from analysis.results.pooling_statistics import mean_battery_V, pooling_statistics, start_unix_s
from analysis.results.provenance import provenance
from analysis.results.trajectory import trajectory_result
from analysis.schema import Results
from analysis.trajectory.consistency import Consistency, consistency
from analysis.trajectory.observability import (
    conflict_notes,
    prior_conflict,
    sensor_error_estimates,
    trajectory_notes,
    with_misfit,
)
from analysis.trajectory.priors import stated_sigma
from analysis.trajectory.reconstruction import Trajectory, reconstruct
from flight.aircraft import Aircraft
from flight.log_reader import Log


@dataclass(frozen=True)
class Analysis:
    """The results, and what the report draws beside them."""

    results: Results
    table: pd.DataFrame
    maneuvers: Maneuvers
    trajectory: Trajectory
    consistency: Consistency
    drag: DragEstimates


def analyze(
    log: Log,
    replacements: Replacements = Replacements(),
    progress: Callable[[str], None] = lambda _: None,
    *,
    request: Request = Request(),
    runs_file: Path | None = None,
    command_line: str = "",
    by_likelihood: bool = False,
) -> Analysis:
    """Power required and performance from a log.

    replacements: files used instead of parts of the log, such as another aircraft file. request: battery, weights and
    density altitudes to compute performance for. runs_file: an edited list of runs (`maneuvers.toml_file`).
    command_line: that started the analysis, for the report. by_likelihood: with the two maximum-likelihood methods.
    Raises InputError when the log lacks something that nothing can replace, or holds no run.
    """
    name = str(log.path)
    check_decodable(log)
    contents = log_contents.contents(log, replacements)
    aircraft, propeller = contents.aircraft, contents.propeller

    progress("checking the log")
    check_log(log, propeller.diameter_m)

    progress("synchronizing")

    def data_of(aircraft: Aircraft) -> FlightData:
        return flight_data(
            log, aircraft, propeller, contents.probe, contents.magnetometer, contents.zero, contents.transducers
        )

    data = data_of(aircraft)
    table = data.table
    check_axes(table, name)

    progress("finding runs")
    maneuvers = select(table, data.rest, name, runs_file)
    flown = pd.concat([table.iloc[run.rows] for run in maneuvers.level_runs or maneuvers.of(*FOR_DRAG)])
    condition, flown_CL = flown_condition(flown, aircraft), flown_lift(flown, aircraft)
    check_lift(flown_CL, condition, name)
    kinds = {run.kind for run in maneuvers.level_runs}
    coverage_warnings = thrust_coverage(flown, propeller, kinds, str(runs_file or ""))

    progress("reconstructing the trajectory")
    alpha_scale_sigma = math.hypot(contents.probe.alpha_scale_sigma, assumed_values.alpha_scale_sigma(aircraft))

    def trajectory_with(prior_factor: ArrayLike) -> Trajectory:
        return reconstruct(
            table, data.rest, alpha_scale_sigma=alpha_scale_sigma, compass=data.compass, calibrated=data.calibrated,
            gust_length=aircraft.uncertainty.gust_length, prior_factor=prior_factor, log=name,
            stated=stated_sigma(aircraft.uncertainty),
        )  # fmt: skip

    trajectory = trajectory_with(1.0)
    conflict = prior_conflict(trajectory)
    conflict_warnings = conflict_notes(conflict, trajectory)
    if conflict.conflicting:
        progress("reconstructing the trajectory with larger sensor errors")
        trajectory = trajectory_with(conflict.factor)
    trajectory, misfit_warnings = with_misfit(trajectory)
    sensor_errors = sensor_error_estimates(trajectory)
    runs, calibrated = len(maneuvers.level_runs), contents.magnetometer is not None
    trajectory_warnings = trajectory_notes(
        trajectory, sensor_errors, runs, magnetometer_calibrated=calibrated, log=name
    )
    agreement = consistency(trajectory)

    progress(f"estimating drag from {runs or len(maneuvers.of(*FOR_DRAG))} runs")

    repetition = Repetition(
        data, data_of, trajectory, alpha_scale_sigma, contents.probe.alpha_scale_sigma, maneuvers, aircraft, condition,
        flown_CL, name, progress, conflict.factor,
    )  # fmt: skip
    assumption_uncertainty = assumed_values.assumption_uncertainty(
        repetition.estimate, repetition.values, aircraft, propeller, condition, flown_CL
    )
    assumption_uncertainty = with_transducer_uncertainty(
        assumption_uncertainty, lambda air: repetition.values_with_air(air, propeller), table, aircraft
    )
    drag = estimate(
        table, trajectory, maneuvers, aircraft, propeller, condition, flown_CL,
        zeroed=data.zeroed, log=name, progress=progress, assumption_uncertainty=assumption_uncertainty,
        by_likelihood=by_likelihood,
    )  # fmt: skip

    progress("balancing the energy of the whole flight")
    of_whole_flight = whole_flight(log, aircraft, propeller)
    drag = replace(drag, methods=[*drag.methods, of_whole_flight.method])

    progress("computing performance")
    performance = compute_performance(
        request, trajectory, drag, aircraft, propeller,
        flight=FlownCondition(condition, float(flown["static_Pa"].mean()), float(flown["temperature_K"].mean())),
    )  # fmt: skip
    results = assemble(
        log=name,
        aircraft=aircraft,
        propeller=propeller,
        flown=flown,
        table=table,
        condition=condition,
        maneuvers=maneuvers,
        drag=drag,
        trajectory=trajectory_result(trajectory, agreement, sensor_errors),
        performance=performance,
        pooling=pooling_statistics(
            drag.main, drag.flown_CL, aircraft, propeller, contents.probe,
            transducers=contents.transducers, start_unix_s=start_unix_s(log), battery_V=mean_battery_V(flown),
        ),
        provenance=provenance(log, contents, replacements, runs_file, command_line),
        air=air_found(trajectory, flown, condition),
        ground_track=track(trajectory),
        warnings=contents.notes
        + data.notes
        + coverage_warnings
        + conflict_warnings
        + misfit_warnings
        + trajectory_warnings
        + drag.warnings
        + request.notes(aircraft),
        electrical=of_whole_flight.electrical,
        next_flight=next_flight(trajectory, drag.main, condition, drag.flown_CL),
    )  # fmt: skip
    return Analysis(results, table, maneuvers, trajectory, agreement, drag)
