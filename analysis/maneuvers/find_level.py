"""Finds level accelerations and decelerations (runs) by the criteria of `flight.runs`, and says why other
stretches are rejected."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import special

from flightpower.analysis.maneuvers.kinds import Maneuver, RejectedManeuver, Search
from flightpower.analysis.maneuvers.quality import NEEDED_COLUMNS, SmoothedMotion, missing_share, notes, smooth
from flightpower.analysis.sources.daemon import speed_ratio_of
from flightpower.analysis.sources.grid import stretches
from flightpower.flight import runs
from flightpower.flight.arrays import Array
from flightpower.flight.runs import LEVEL_RUN, Rejection, RunMeasures, changing_part, larger, legs_of, noise_share


def find_runs(table: pd.DataFrame, noise_mps: float | None = None) -> tuple[list[Maneuver], list[RejectedManeuver]]:
    """Runs and rejected stretches, each in order of time.

    table: from `air_data`. noise_mps: standard deviation of a speed sample, if not that of the table, as in a plan.
    """
    motion, scale = smooth(table, LEVEL_RUN.smoothing_s), speed_ratio_of(table)
    flying = table["flying"].to_numpy() & np.isfinite(motion.V)
    if noise_mps is None:
        noise_mps = _noise_mps(table["V_mps"].to_numpy()[flying], motion.V[flying])
    noise = noise_share(noise_mps, motion.step_s)
    changing_mps2 = LEVEL_RUN.changing_mps2 * min(1.0, scale) * noise
    turning_or_steep = (np.abs(np.nan_to_num(motion.bank)) > LEVEL_RUN.largest_bank_rad) | (
        np.abs(np.nan_to_num(motion.climb)) > LEVEL_RUN.steep_mps * larger(scale)
    )
    search = Search(table, motion.V)
    for stretch in [*stretches(flying & ~turning_or_steep), *stretches(flying & turning_or_steep)]:
        for leg in legs_of(motion.V[stretch].tolist()):
            changing = _changing_rows(motion, stretch.start, leg, changing_mps2)
            judged = _judged([changing], table, motion, leg.sign, noise)
            for divided in (_pieces(changing, motion.step_s, scale), _between_gaps(table, changing)):
                if not any(part.rejection is None for part in judged):
                    parts = _judged(divided, table, motion, leg.sign, noise)
                    judged = parts if any(part.rejection is None for part in parts) else judged
            for rows, rejection in judged:
                remarks = () if rejection else notes(table.iloc[rows], motion.bank[rows])
                search.judged(leg.kind, rows, rejection, remarks)
    return sorted(search.maneuvers, key=lambda run: run.start_s), sorted(search.rejected, key=lambda run: run.start_s)


class _Judged(NamedTuple):
    """Rows of the table, and why they are not a run; None if they are."""

    rows: slice
    rejection: Rejection | None


def _judged(
    stretch: list[slice], table: pd.DataFrame, motion: SmoothedMotion, sign: int, noise: float
) -> list[_Judged]:
    """Judge each stretch that is not negligible. sign: sign of the acceleration. noise: `noise_share`."""
    scale, runs = speed_ratio_of(table), []
    for rows in stretch:
        measures = _measures(table.iloc[rows], motion, rows, sign)._replace(noise_share=noise)
        if not measures.negligible(scale):
            runs.append(_Judged(rows, measures.rejection(scale)))
    return runs


def _noise_mps(V: Array, smooth_V: Array) -> float:
    """Standard deviation of speeds (n,) about the smoothed ones; includes noise and quick gusts, not outliers."""
    if not len(V):
        return np.inf
    lower, upper = np.percentile(V - smooth_V, 100 * special.ndtr([-1.0, 1.0]))
    return float(upper - lower) / 2


def _pieces(rows: slice, step_s: float, scale: float) -> list[slice]:
    """Cut a leg into the fewest equal parts no longer than a run may be: they may be level although the leg is not."""
    count = -(-(rows.stop - rows.start) // max(1, int(LEVEL_RUN.longest_s * larger(scale) / step_s)))
    edges = np.linspace(rows.start, rows.stop, count + 1).round().astype(int).tolist()
    return [slice(a, b) for a, b in pairwise(edges)]


def _between_gaps(table: pd.DataFrame, rows: slice) -> list[slice]:
    """The parts of a leg in which all needed quantities are measured."""
    finite = table.iloc[rows][list(NEEDED_COLUMNS)].notna().all(axis=1).to_numpy()
    return [slice(rows.start + part.start, rows.start + part.stop) for part in stretches(finite)]


def _changing_rows(motion: SmoothedMotion, start: int, leg: runs.Leg, changing_mps2: float) -> slice:
    """The rows of the table in which the speed of a leg changes. start: row at which the leg's indices begin."""
    begin = start + leg.first
    rows = slice(begin, start + leg.last + 1)
    changing = leg.sign * motion.Vdot[rows] > changing_mps2
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
