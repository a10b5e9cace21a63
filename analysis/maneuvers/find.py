"""Finds the maneuvers of every kind in a flight."""

import numpy as np
import pandas as pd

from analysis.maneuvers.find_elevator import find_3211
from analysis.maneuvers.find_level import find_runs
from analysis.maneuvers.find_loads import find_loads
from analysis.maneuvers.find_steady import find_steady
from analysis.maneuvers.kinds import (
    FLYING,
    PORPOISING,
    STANDING,
    STEPS_3211,
    Maneuver,
    Maneuvers,
    RejectedManeuver,
    maneuver_in,
)
from analysis.signals.aircraft_size import least_height_m
from analysis.signals.stretches import stretches

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
