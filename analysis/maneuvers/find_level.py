"""Finds level accelerations and decelerations (runs) by the criteria of `flight.runs`, and why others are none."""

import numpy as np
import pandas as pd

from analysis.maneuvers.kinds import Maneuver, RejectedManeuver, maneuver_in
from analysis.maneuvers.quality import SmoothedMotion, missing_share, notes, smooth
from analysis.signals.channels import speed_scale_of
from analysis.signals.smoothing import stretches
from flight import runs
from flight.runs import LEVEL_RUN, RunMeasures, changing_part, legs_of


def find_runs(table: pd.DataFrame) -> tuple[list[Maneuver], list[RejectedManeuver]]:
    """Runs and rejected stretches, each in order of time. table: of `air_data`."""
    motion, scale = smooth(table, LEVEL_RUN.smoothing_s), speed_scale_of(table)
    flying = table["flying"].to_numpy() & np.isfinite(motion.V)
    turning_or_steep = (np.abs(np.nan_to_num(motion.bank)) > LEVEL_RUN.largest_bank_rad) | (
        np.abs(np.nan_to_num(motion.climb)) > LEVEL_RUN.steep_mps
    )
    level_runs: list[Maneuver] = []
    rejected: list[RejectedManeuver] = []
    for stretch in [*stretches(flying & ~turning_or_steep), *stretches(flying & turning_or_steep)]:
        for leg in legs_of(motion.V[stretch].tolist()):
            rows = _changing_rows(motion, stretch.start, leg, scale)
            data = table.iloc[rows]
            measures = _measures(data, motion, rows, leg.sign)
            if measures.negligible(scale):
                continue
            if rejection := measures.rejection(scale):
                rejected.append(RejectedManeuver(leg.kind, float(data.index[0]), float(data.index[-1]), rejection))
            else:
                level_runs.append(maneuver_in(leg.kind, rows, table, motion.V, notes(data, motion.bank[rows])))
    return sorted(level_runs, key=lambda run: run.start_s), sorted(rejected, key=lambda run: run.start_s)


def _changing_rows(motion: SmoothedMotion, start: int, leg: runs.Leg, scale: float) -> slice:
    """The rows of the table of the changing part of a leg. start: row at which the leg's indices begin."""
    begin = start + leg.first
    rows = slice(begin, start + leg.last + 1)
    changing = leg.sign * motion.Vdot[rows] > LEVEL_RUN.changing_mps2 * scale
    part = changing_part(motion.V[rows].tolist(), changing.tolist())
    return slice(begin + part.start, begin + part.stop)


def _measures(data: pd.DataFrame, motion: SmoothedMotion, rows: slice, sign: int) -> RunMeasures:
    V, height = motion.V[rows], data["height_m"].dropna()
    return RunMeasures(
        rows=len(data),
        step_s=motion.step_s,
        seconds=float(data.index[-1] - data.index[0]),
        peak_mps2=float(np.max(sign * motion.Vdot[rows])),
        speed_change=float(np.ptp(V) / np.mean(V)),
        lowest_m=float(height.min()),
        mean_climb_mps=float(np.nanmean(motion.climb[rows])),
        height_range_m=float(np.ptp(height)),
        largest_bank_rad=float(np.nanmax(np.abs(motion.bank[rows]))),
        missing=missing_share(data),
    )
