"""Everything that was flown, of every kind."""

import numpy as np
import pandas as pd

from analysis.airdata.air import LEAST_HEIGHT_M
from analysis.maneuvers.find_elevator import find_3211
from analysis.maneuvers.find_level import find_runs
from analysis.maneuvers.find_loads import find_loads
from analysis.maneuvers.find_steady import find_steady
from analysis.maneuvers.kinds import FLYING, PORPOISING, STANDING, STEPS_3211, Maneuvers, Rejected, Run, measured
from analysis.signals.stretches import stretches

SHORTEST_FLIGHT_S = 10.0
SLACK_S = 3.0  # in which the stick comes to rest after porpoising


def find(table: pd.DataFrame, still: list[slice]) -> Maneuvers:
    """Runs of all kinds in a flight. table: as `air_data` leaves it; still: where the aircraft stood."""
    steps, no_steps = find_3211(table)
    runs, rejected = [*steps, *_whole(table, still)], [*no_steps]
    for finder in (find_runs, find_steady, find_loads):
        some, others = finder(table)
        # What an elevator input does to the load factor is no roller coaster.
        runs += [run for run in some if not _within(run, steps)]
        rejected += [stretch for stretch in others if not _within(stretch, steps)]
    porpoising = [run for run in runs if run.kind == PORPOISING]
    rejected = [stretch for stretch in rejected if not _part_of(stretch, porpoising)]
    return Maneuvers(sorted(runs, key=_when), sorted(rejected, key=_when))


def _whole(table: pd.DataFrame, still: list[slice]) -> list[Run]:
    """Standing and flying as such."""
    step_s = float(table.index[1] - table.index[0])
    V = table["V_mps"].to_numpy()
    high = table["flying"] & (table["height_m"] > LEAST_HEIGHT_M)
    # Half a second outside the probe's range ends no flight.
    aloft = high.rolling(round(5 / step_s), center=True, min_periods=1).max().to_numpy() > 0
    flights = [rows for rows in stretches(aloft) if rows.stop - rows.start > SHORTEST_FLIGHT_S / step_s]
    return [measured(STANDING, rows, table, np.zeros(len(table))) for rows in still] + [
        measured(FLYING, rows, table, V) for rows in flights
    ]


def _within(stretch: Run | Rejected, steps: list[Run]) -> bool:
    return stretch.kind != STEPS_3211 and any(
        stretch.start_s < step.end_s and stretch.end_s > step.start_s and stretch.end_s - stretch.start_s < 10
        for step in steps
    )


def _part_of(stretch: Rejected, runs: list[Run]) -> bool:
    return any(run.start_s - SLACK_S < stretch.start_s and stretch.end_s < run.end_s + SLACK_S for run in runs)


def _when(stretch: Run | Rejected) -> float:
    return stretch.start_s
