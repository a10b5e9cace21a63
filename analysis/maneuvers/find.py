"""Finds the maneuvers of every kind in a flight: steady points here, other kinds in the modules that it calls."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.maneuvers import quality
from flightpower.analysis.maneuvers.find_level import find_runs
from flightpower.analysis.maneuvers.find_loads import find_3211, find_loads
from flightpower.analysis.maneuvers.kinds import (
    FLYING,
    PORPOISING,
    STANDING,
    STEADY,
    STEPS_3211,
    Maneuver,
    Maneuvers,
    RejectedManeuver,
    Search,
    Unsuitable,
    maneuver_in,
)
from flightpower.analysis.maneuvers.quality import load_factor, smooth
from flightpower.analysis.maneuvers.settings import FLIGHT, LOADS, STEADY_POINT, STEPS
from flightpower.analysis.settings import FLOWN
from flightpower.analysis.sources.daemon import least_height_m
from flightpower.analysis.sources.grid import stretches
from flightpower.flight.arrays import Array
from flightpower.flight.runs import LEVEL_RUN, Rejection, RunRejected


def find_steady(table: pd.DataFrame) -> tuple[list[Maneuver], list[RejectedManeuver]]:
    """Steady points and rejected stretches, each in order of time. table: from `air_data`."""
    motion, n = smooth(table, STEADY_POINT.smoothing_s), load_factor(table, LOADS.load_smoothing_s)
    # Bank is not smoothed: a turn can be shorter than the smoothing window.
    steady = np.isfinite(motion.V) & table["flying"].to_numpy() & (np.abs(motion.Vdot) < STEADY_POINT.largest_mps2)
    steady &= (np.abs(np.nan_to_num(motion.climb, nan=np.inf)) < STEADY_POINT.largest_climb_mps) & (
        np.abs(motion.bank) < FLOWN.level_rad
    )
    search = Search(table, motion.V)
    for rows in stretches(steady):
        data = table.iloc[rows]
        seconds = float(data.index[-1] - data.index[0])
        if seconds < STEADY_POINT.mentioned_s:
            continue
        rejection = _rejection(data, motion.V[rows], n[rows])
        search.judged(STEADY, rows, rejection, () if rejection else quality.notes(data, motion.bank[rows]))
    return search.maneuvers, search.rejected


def _rejection(data: pd.DataFrame, V: Array, load: Array) -> Rejection | None:
    """Why a stretch is not a steady point; None if it is. V, load: (n,), smoothed speed and load factor."""
    seconds = float(data.index[-1] - data.index[0])
    if seconds < STEADY_POINT.shortest_s:
        return Rejection(RunRejected.TOO_SHORT, seconds, STEADY_POINT.shortest_s)
    if low := quality.too_low(data):
        return low
    share = float(np.ptp(V) / np.mean(V))
    if share > STEADY_POINT.largest_speed_change:
        return Rejection(Unsuitable.SPEED_DRIFTED, share, STEADY_POINT.largest_speed_change)
    if (rms := float(np.nanstd(load))) > LOADS.deviation.roller_coaster:
        return Rejection(Unsuitable.LOAD_VARIED, rms, LOADS.deviation.roller_coaster)
    n = data["n_revps"]
    if not n.notna().any() or n.mean() < 1:
        return Rejection(Unsuitable.MOTOR_STOPPED)
    if n.std() > LEVEL_RUN.held_share * n.mean():
        return Rejection(Unsuitable.MOTOR_VARIED, float(n.std() / n.mean()), LEVEL_RUN.held_share)
    return quality.without_data(data)


def find(table: pd.DataFrame, rest: list[slice]) -> Maneuvers:
    """Maneuvers of all kinds in a flight. table: from `air_data`; rest: rows in which the aircraft stood still."""
    steps, no_steps = find_3211(table)
    maneuvers, rejected = [*steps, *_standing_and_flying(table, rest)], [*no_steps]
    loads = find_loads(table)
    level = table.assign(flying=table["flying"] & ~_porpoised(table, loads[0]))
    for of_kind, unsuitable in (find_runs(level), find_steady(level), loads):
        # The load factor during a 3-2-1-1 input looks like a roller coaster.
        maneuvers += [maneuver for maneuver in of_kind if not _within(maneuver, steps)]
        rejected += [stretch for stretch in unsuitable if not _within(stretch, steps)]
    porpoising = [maneuver for maneuver in maneuvers if maneuver.kind == PORPOISING]
    rejected = [stretch for stretch in rejected if not _part_of(stretch, porpoising)]
    return Maneuvers(sorted(maneuvers, key=_start), sorted(rejected, key=_start))


def _standing_and_flying(table: pd.DataFrame, rest: list[slice]) -> list[Maneuver]:
    step_s = float(table.index[1] - table.index[0])
    V = table["V_mps"].to_numpy()
    high = table["flying"] & (table["height_m"] > least_height_m(table))
    # A gap shorter than bridged_s, such as one outside the probe's calibrated range, does not end a flight.
    aloft = high.rolling(round(FLIGHT.bridged_s / step_s), center=True, min_periods=1).max().to_numpy() > 0
    flights = [rows for rows in stretches(aloft) if rows.stop - rows.start > FLIGHT.shortest_s / step_s]
    return [maneuver_in(STANDING, rows, table, np.zeros(len(table))) for rows in rest] + [
        maneuver_in(FLYING, rows, table, V) for rows in flights
    ]


def _porpoised(table: pd.DataFrame, loads: list[Maneuver]) -> NDArray[np.bool_]:
    """Whether each row (n,) of the table lies within a porpoise, or within the smoothing time on either side of one.

    Such rows are no part of a run or of steady flight: lift varies, and drag varies with its square.
    """
    within = np.zeros(len(table), dtype=bool)
    margin = round(LOADS.smoothing_s / float(table.index[1] - table.index[0]))
    for maneuver in loads:
        if maneuver.kind == PORPOISING:
            within[max(0, maneuver.rows.start - margin) : maneuver.rows.stop + margin] = True
    return within


def _within(stretch: Maneuver | RejectedManeuver, steps: list[Maneuver]) -> bool:
    """Whether a short stretch of another kind overlaps a 3-2-1-1 input."""
    return stretch.kind != STEPS_3211 and any(
        stretch.start_s < step.end_s
        and stretch.end_s > step.start_s
        and stretch.end_s - stretch.start_s < FLIGHT.shortest_s
        for step in steps
    )


def _part_of(stretch: RejectedManeuver, porpoising: list[Maneuver]) -> bool:
    return any(
        maneuver.start_s - STEPS.longest_hold_s < stretch.start_s
        and stretch.end_s < maneuver.end_s + STEPS.longest_hold_s
        for maneuver in porpoising
    )


def _start(stretch: Maneuver | RejectedManeuver) -> float:
    return stretch.start_s
