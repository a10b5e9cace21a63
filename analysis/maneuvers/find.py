"""Finds steady level stretches: speed, height and motor speed stay constant long enough for a steady point.

Finds the maneuvers of every kind in a flight.
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.maneuvers import find_level
from analysis.maneuvers.find_level import find_runs
from analysis.maneuvers.find_loads import find_3211, find_loads
from analysis.maneuvers.kinds import (
    FLYING,
    PORPOISING,
    STANDING,
    STEADY,
    STEPS_3211,
    Maneuver,
    Maneuvers,
    RejectedManeuver,
    maneuver_in,
)
from analysis.maneuvers.smooth import smooth
from analysis.signals.aircraft_size import least_height_m
from analysis.signals.smoothing import stretches

Array = NDArray[np.float64]

SMOOTHING_S = 5.0  # the slope of speed with 0.3 m/s noise is then good to 0.02 m/s^2
STEADY_MPS2 = 0.12  # 1 % of the weight; the energy balance of the point corrects for what remains
LEVEL_MPS = 0.5
LARGEST_BANK_RAD = np.radians(12)  # 2 % more lift than weight
SHORTEST_S = 8.0
MENTIONED_S = 4.0  # a stretch this long is listed as rejected; a shorter one is ignored
LARGEST_SPEED_CHANGE = 0.06  # of the mean speed
LARGEST_MOTOR_SPREAD = 0.05  # standard deviation over mean


def find_steady(table: pd.DataFrame) -> tuple[list[Maneuver], list[RejectedManeuver]]:
    """Steady points and rejected stretches, each in order of time. table: of `air_data`."""
    motion = smooth(table, SMOOTHING_S)
    # Bank is not smoothed: a turn can be shorter than the smoothing window.
    steady = np.isfinite(motion.V) & table["flying"].to_numpy() & (np.abs(motion.Vdot) < STEADY_MPS2)
    steady &= (np.abs(np.nan_to_num(motion.climb, nan=np.inf)) < LEVEL_MPS) & (np.abs(motion.bank) < LARGEST_BANK_RAD)
    found: list[Maneuver] = []
    rejected: list[RejectedManeuver] = []
    for rows in stretches(steady):
        data = table.iloc[rows]
        seconds = float(data.index[-1] - data.index[0])
        if seconds < MENTIONED_S:
            continue
        reason = _reason_against(data, motion.V[rows], seconds)
        if reason:
            rejected.append(RejectedManeuver(STEADY, float(data.index[0]), float(data.index[-1]), reason))
        else:
            found.append(maneuver_in(STEADY, rows, table, motion.V, find_level.notes(data, motion.bank[rows])))
    return found, rejected


def _reason_against(data: pd.DataFrame, V: Array, seconds: float) -> str:
    if seconds < SHORTEST_S:
        return f"too short: {seconds:.1f} s, {SHORTEST_S:.0f} s are needed"
    if low := find_level.too_low(data):
        return low
    share = float(np.ptp(V) / np.mean(V))
    if share > LARGEST_SPEED_CHANGE:
        return f"speed drifted by {100 * share:.0f} % of its mean, {100 * LARGEST_SPEED_CHANGE:.0f} % are allowed"
    n = data["n_revps"]
    if not n.notna().any() or n.mean() < 1:
        return "the motor stood still"
    if n.std() > LARGEST_MOTOR_SPREAD * n.mean():
        return f"the motor's speed varied by {100 * n.std() / n.mean():.0f} %"
    return find_level.without_data(data)


SHORTEST_FLIGHT_S = 10.0
SHORT_S = 10.0  # a shorter stretch that overlaps a 3-2-1-1 input is part of it
SETTLING_S = 3.0  # in which the stick comes to rest after porpoising


def find(table: pd.DataFrame, rest: list[slice]) -> Maneuvers:
    """Maneuvers of all kinds in a flight. table: of `air_data`; rest: rows in which the aircraft stood still."""
    steps, no_steps = find_3211(table)
    maneuvers, rejected = [*steps, *_standing_and_flying(table, rest)], [*no_steps]
    for finder in (find_runs, find_steady, find_loads):
        found, unsuitable = finder(table)
        # The load factor during a 3-2-1-1 input looks like a roller coaster.
        maneuvers += [maneuver for maneuver in found if not _within(maneuver, steps)]
        rejected += [stretch for stretch in unsuitable if not _within(stretch, steps)]
    porpoising = [maneuver for maneuver in maneuvers if maneuver.kind == PORPOISING]
    rejected = [stretch for stretch in rejected if not _part_of(stretch, porpoising)]
    return Maneuvers(sorted(maneuvers, key=_start), sorted(rejected, key=_start))


def _standing_and_flying(table: pd.DataFrame, rest: list[slice]) -> list[Maneuver]:
    step_s = float(table.index[1] - table.index[0])
    V = table["V_mps"].to_numpy()
    high = table["flying"] & (table["height_m"] > least_height_m(table))
    # Half a second outside the probe's calibrated range does not end a flight.
    aloft = high.rolling(round(5 / step_s), center=True, min_periods=1).max().to_numpy() > 0
    flights = [rows for rows in stretches(aloft) if rows.stop - rows.start > SHORTEST_FLIGHT_S / step_s]
    return [maneuver_in(STANDING, rows, table, np.zeros(len(table))) for rows in rest] + [
        maneuver_in(FLYING, rows, table, V) for rows in flights
    ]


def _within(stretch: Maneuver | RejectedManeuver, steps: list[Maneuver]) -> bool:
    """Whether a short stretch of another kind overlaps a 3-2-1-1 input."""
    return stretch.kind != STEPS_3211 and any(
        stretch.start_s < step.end_s and stretch.end_s > step.start_s and stretch.end_s - stretch.start_s < SHORT_S
        for step in steps
    )


def _part_of(stretch: RejectedManeuver, porpoising: list[Maneuver]) -> bool:
    return any(
        one.start_s - SETTLING_S < stretch.start_s and stretch.end_s < one.end_s + SETTLING_S for one in porpoising
    )


def _start(stretch: Maneuver | RejectedManeuver) -> float:
    return stretch.start_s
