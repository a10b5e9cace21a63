"""The record of a flight: what the analysis knows about it so far. Each step takes the record and returns a richer one.

    recorded ▶ Recorded    log, aircraft, propeller, calibrations
    synchronized ▶ Measured    air data at the center of gravity
    with_runs ▶ Flown    maneuvers, weight and density, range of lift coefficients
    reconstructed ▶ Reconstructed    trajectory, sensor errors
    `methods.ladder.estimated` ▶ Estimated    drag by all methods
    `pipeline.analyze` ▶ Analysis    results

Two parts of the analysis are repeated with other assumptions: the estimate of drag, on the same record
(`methods.rerun`), and the trajectory, if the flight contradicts the priors of its sensor errors (`flight_path`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from flightpower.analysis.air.contents import LogContents, Replacements, contents
from flightpower.analysis.air.flight_data import FlightData, flight_data
from flightpower.analysis.curve import Condition
from flightpower.analysis.maneuvers.flown import check_lift, flown_condition, flown_lift, largest_lift, thrust_coverage
from flightpower.analysis.maneuvers.kinds import Maneuvers
from flightpower.analysis.maneuvers.runs_file import select
from flightpower.analysis.sources.axes import check_axes
from flightpower.analysis.sources.daemon import first_ns, fix_of_log
from flightpower.analysis.sources.recording import Fix
from flightpower.analysis.sources.structure import check_decodable, check_log, receiver_notes
from flightpower.analysis.trajectory.as_measured import path_as_measured
from flightpower.analysis.trajectory.observability import (
    PriorConflict,
    conflict_notes,
    misfit,
    misfit_in_words,
    prior_conflict,
    sensor_error_estimates,
    trajectory_notes,
    with_misfit,
)
from flightpower.analysis.trajectory.priors import SensorPriors, probe_ahead_sigma_m, stated_sigma, upwash_slope_sigma
from flightpower.analysis.trajectory.reconstruction import Trajectory, reconstruct
from flightpower.analysis.trajectory.updraft import mean_updraft, sun_over, updraft_by_day, updraft_notes
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log
from flightpower.flight.propeller import Propeller

Progress = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """A decodable log, and its contents other than measurements.

    replacements : files and values that the user gave in place of parts of the log
    contents : aircraft, propeller and calibrations, after the replacements
    fix : date and place, on a clock that starts with the log
    notes : sentences that the reader of the results has to know, in the order in which they came up
    """

    log: Log
    replacements: Replacements
    contents: LogContents
    fix: Fix = field(default_factory=Fix)
    notes: tuple[str, ...] = ()
    progress: Progress = lambda _: None

    @property
    def name(self) -> str:
        """Name of the log, for messages."""
        return str(self.log.path)

    @property
    def aircraft(self) -> Aircraft:
        return self.contents.aircraft

    @property
    def propeller(self) -> Propeller:
        return self.contents.propeller

    def fields_so_far(self) -> dict[str, Any]:
        """All fields by name, for the record of the next step."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


@dataclass(frozen=True, kw_only=True)
class Measured(Recorded):
    """The flight with all measurements on one time base, as air data at the center of gravity."""

    data: FlightData

    @property
    def table(self) -> pd.DataFrame:
        """The table of the whole flight, as `air.air.air_data` returns it."""
        return self.data.table


@dataclass(frozen=True, kw_only=True)
class Flown(Measured):
    """The flight with its maneuvers.

    runs_file : the user's list of runs; None if the runs were found in the data
    condition : weight of the aircraft and mean density of the runs
    flown_CL : range of the lift coefficients of level flight at the speeds of the runs
    """

    maneuvers: Maneuvers
    runs_file: Path | None
    condition: Condition
    flown_CL: tuple[float, float]

    @property
    def rows_flown(self) -> pd.DataFrame:
        """The table's rows in accelerations and decelerations, or, if none was flown, in the maneuvers used instead."""
        return _rows_flown(self.table, self.maneuvers)


@dataclass(frozen=True, kw_only=True)
class Reconstructed(Flown):
    """The flight with its trajectory and sensor errors.

    prior_conflict : conflict of the first trajectory's sensor errors with their priors, which were then widened
    """

    trajectory: Trajectory
    prior_conflict: PriorConflict

    @property
    def prior_factor(self) -> ArrayLike:
        """Factor on the prior standard deviations of the sensor errors; above 1 where the flight contradicted them."""
        return self.prior_conflict.factor


class FlightPath(NamedTuple):
    """The trajectory of a whole flight, which does not depend on its runs, and notes on it. prior_conflict : as in
    `Reconstructed`. as_measured : whether no trajectory explains the measurements. updraft_mps : standard deviation of
    the mean updraft over a flight by day (`updraft.updraft_by_day`); 0 for other flights"""

    trajectory: Trajectory
    prior_conflict: PriorConflict
    notes: tuple[str, ...]
    as_measured: bool = False
    updraft_mps: float = 0.0


def recorded(log: Log, replacements: Replacements, progress: Progress = lambda _: None) -> Recorded:
    """Return the record of a log. Raises InputError when it cannot be decoded or lacks a part that is not replaced."""
    check_decodable(log)
    log_contents = contents(log, replacements)
    notes = (*log_contents.notes, *receiver_notes(log))
    fix = fix_of_log(log, first_ns(log))
    return Recorded(log=log, replacements=replacements, contents=log_contents, fix=fix, notes=notes, progress=progress)


def synchronized(flight: Recorded) -> Measured:
    """Return the record with its air data. Raises InputError when names, clock, units or axes of the log are wrong."""
    flight.progress("checking the log")
    check_log(flight.log, flight.propeller.diameter_m)
    flight.progress("synchronizing")
    data = flight_data(flight.log, flight.aircraft, flight.propeller, flight.contents.calibrations)
    check_axes(data.table, flight.name)
    return Measured(**flight.fields_so_far() | {"data": data, "notes": (*flight.notes, *data.notes)})


def with_runs(flight: Measured, runs_file: Path | None) -> Flown:
    """Return the record with its maneuvers. runs_file: an edited list of runs (`maneuvers.runs_file`).

    Raises InputError when there is no run to analyze.
    """
    flight.progress("finding runs")
    maneuvers = select(flight.table, flight.data.rest, flight.name, runs_file)
    flown = _rows_flown(flight.table, maneuvers)
    condition = flown_condition(flown, flight.aircraft)
    flown_CL = flown_lift(flown, flight.aircraft, largest_lift(flight.table, condition))
    check_lift(flown_CL, condition, flight.name)
    kinds = {run.kind for run in maneuvers.level_runs}
    notes = (*flight.notes, *thrust_coverage(flown, flight.propeller, kinds, str(runs_file or "")))
    return Flown(
        **flight.fields_so_far()
        | {"maneuvers": maneuvers, "runs_file": runs_file, "condition": condition, "flown_CL": flown_CL, "notes": notes}
    )


def _rows_flown(table: pd.DataFrame, maneuvers: Maneuvers) -> pd.DataFrame:
    return pd.concat([table.iloc[run.rows] for run in maneuvers.for_drag])


def reconstructed(flight: Flown, path: FlightPath | None = None) -> Reconstructed:
    """Return the record with its trajectory. path : the flight path if it is already known; runs do not change it"""
    path = path or flight_path(flight)
    flight, trajectory, notes_on_air = _with_updraft(flight, path.trajectory, path.updraft_mps)
    notes = [*flight.notes, *path.notes]
    if not path.as_measured:
        notes += trajectory_notes(
            trajectory,
            sensor_error_estimates(trajectory),
            len(flight.maneuvers.level_runs),
            magnetometer_calibrated=flight.contents.magnetometer is not None,
            log=flight.name,
        )
    return Reconstructed(
        **flight.fields_so_far()
        | {"trajectory": trajectory, "prior_conflict": path.prior_conflict, "notes": (*notes, *notes_on_air)}
    )


def flight_path(flight: Measured) -> FlightPath:
    """Reconstruct the trajectory, and again with wider priors if the flight contradicts the priors of sensor errors.

    If no trajectory explains the measurements, the path is as measured, and only simpler methods are used.
    """
    flight.progress("reconstructing the trajectory")
    try:
        trajectory = trajectory_with(flight, flight.data)
    except InputError as error:
        return _as_measured(flight, str(error).removeprefix(f"{flight.name}: "))
    trajectory, of_noise = _with_noise_in_flight(flight, trajectory)
    if not trajectory.converged:
        cause = f"the trajectory did not converge{misfit_in_words(trajectory)}"
        if not any(trajectory.block_means.measured(name) for name in ("gps_north_mps", "beta_rad")):
            cause += "; without velocity over the ground or sideslip it cannot separate bank from the yaw gyro's bias"
        del trajectory  # frees its memory: the path as measured is as large
        return _as_measured(flight, cause)
    conflict = prior_conflict(trajectory)
    notes = [*of_noise, *conflict_notes(conflict, trajectory)]
    updraft_in_file = flight.aircraft.has("uncertainty.updraft")
    by_day = None if updraft_in_file else updraft_by_day(trajectory, sun_over(flight.fix))
    if by_day is not None and by_day.contradicted:
        conflict = conflict._replace(z={**conflict.z, "updraft": by_day.z})
        notes.append(by_day.note)
    if conflict.conflicting:
        flight.progress("reconstructing the trajectory with larger sensor errors")
        try:
            wider = trajectory_with(
                flight, flight.data, prior_factor=conflict.factor, height_noise=trajectory.height_noise
            )
        except InputError:
            wider = None
        if wider is None or not wider.converged:
            del trajectory, wider
            path = _as_measured(
                flight, "sensor errors are larger than assumed, and with larger ones it did not converge"
            )
            return path._replace(notes=(*notes, *path.notes))
        trajectory = wider
    trajectory, misfit_notes = with_misfit(trajectory)
    return FlightPath(trajectory, conflict, (*notes, *misfit_notes), updraft_mps=by_day.sigma_mps if by_day else 0.0)


def _with_noise_in_flight(flight: Measured, trajectory: Trajectory) -> tuple[Trajectory, list[str]]:
    """Return the trajectory with the noise that height has in flight, if it is larger than at rest, and a note on it.

    Height is noisier in flight than at rest on the ground: 0.7 m against 0.07 m for a Citation. Such noise alone does
    not mean that sensors contradict each other. It is estimated from the residuals of height, by fixed-point iteration.
    """
    for _ in range(3):
        if not trajectory.converged or [*misfit(trajectory)] != ["height"]:
            break
        noise = trajectory.height_noise * trajectory.residuals["height"]
        flight.progress("reconstructing the trajectory with the height's noise in flight")
        trajectory = trajectory_with(flight, flight.data, height_noise=noise)
    if trajectory.height_noise == 1.0:
        return trajectory, []
    return trajectory, [
        f"The noise of the height is {trajectory.height_noise:.1f} times that at rest; the flight path takes this into"
        " account."
    ]


def as_measured(flight: Flown, trajectory: Trajectory) -> Reconstructed:
    """Return the record with the path as measured, in place of a trajectory that does not fit the measurements."""
    return reconstructed(flight, _as_measured(flight, f"the trajectory does not fit{misfit_in_words(trajectory)}"))


def _with_updraft(flight: Flown, trajectory: Trajectory, by_day_mps: float) -> tuple[Flown, Trajectory, list[str]]:
    """Return flight and trajectory with a prior of the mean updraft by duration, hour, sun and wind, and notes on it.

    They are returned unchanged if the aircraft file states the updraft. The prior depends on the runs; the rest of the
    path does not. by_day_mps: `FlightPath.updraft_mps`
    """
    aircraft = flight.aircraft
    if aircraft.has("uncertainty.updraft"):
        return flight, trajectory, []
    t_s = flight.table.index.to_numpy()
    runs_s = [(t_s[run.rows][0], t_s[run.rows][-1]) for run in flight.maneuvers.for_drag]
    updraft = mean_updraft(trajectory, runs_s, sun_over(flight.fix))
    lasting_mps = max(updraft.lasting_mps, by_day_mps)
    uncertainty = replace(aircraft.uncertainty, updraft_mps=lasting_mps)
    contents = flight.contents._replace(aircraft=replace(aircraft, uncertainty=uncertainty))
    trajectory = replace(trajectory.with_prior("updraft", lasting_mps), eddies_mps=updraft.eddies_mps)
    return replace(flight, contents=contents), trajectory, updraft_notes(updraft)


def _as_measured(flight: Measured, cause: str) -> FlightPath:
    trajectory = trajectory_with(flight, flight.data, as_measured=True)
    note = (
        f"No flight path explains the measurements: {cause}. Speed, height and angle of attack are used as measured,"
        " wind and sensor errors are not estimated. Check the axes and times of the IMU, or leave out the part of the"
        " log without runs."
    )
    unchanged = PriorConflict(np.ones(len(trajectory.prior_sigma)), {}, 1.0)
    return FlightPath(trajectory, unchanged, (note,), as_measured=True)


def trajectory_with(
    flight: Measured,
    data: FlightData,
    *,
    prior_factor: ArrayLike = 1.0,
    slope_sigma: float | None = None,
    as_measured: bool = False,
    height_noise: float = 1.0,
) -> Trajectory:
    """The most probable trajectory for `data`, which may differ from the flight's own data.

    slope_sigma : prior standard deviation of the error in the slope of angle of attack that upwash makes; None for the
        aircraft file's. as_measured : return the path as measured instead
    """
    uncertainty = flight.aircraft.uncertainty
    by_upwash = upwash_slope_sigma(flight.aircraft) if slope_sigma is None else slope_sigma
    priors = SensorPriors(
        alpha_scale_sigma=math.hypot(flight.contents.probe.alpha_scale_sigma, by_upwash),
        file_sigma=stated_sigma(
            uncertainty, flight.aircraft.wing_loading_Pa, motor_speed=not flight.propeller.is_thrust_column
        ),
        calibrated=data.calibrated,
        factor=prior_factor,
        height_noise=height_noise,
        resolution=data.resolution,
        probe_ahead_m=probe_ahead_sigma_m(flight.aircraft),
    )
    if as_measured:
        return path_as_measured(
            data.table, data.rest, priors, compass=data.compass, gust_length=uncertainty.gust_length
        )
    return reconstruct(
        data.table, data.rest, priors, compass=data.compass, gust_length=uncertainty.gust_length, log=flight.name
    )
