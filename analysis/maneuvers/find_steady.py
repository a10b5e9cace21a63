"""Finds steady level stretches: speed, height and motor stand still long enough for a point of the classic methods."""

import numpy as np
import pandas as pd

from analysis.maneuvers import quality
from analysis.maneuvers.kinds import STEADY, Rejected, Run, measured
from analysis.maneuvers.smooth import smooth
from analysis.signals.stretches import stretches

SMOOTHING_S = 5.0  # the slope of speed with 0.3 m/s noise is then good to 0.02 m/s^2
STANDS_STILL_MPS2 = 0.12  # 1 % of the weight: what is left of it is taken out by the point's own energy balance
LEVEL_MPS = 0.5
LARGEST_BANK_RAD = np.radians(12)  # 2 % more lift than weight
SHORTEST_S = 8.0
NEARLY_S = 4.0  # long enough to be told that it was too short
LARGEST_SPEED_CHANGE = 0.06  # of the mean speed
LARGEST_MOTOR_SPREAD = 0.05  # standard deviation over mean


def find_steady(table: pd.DataFrame) -> tuple[list[Run], list[Rejected]]:
    """Steady points in order of time, and the rejected stretches. `table` as `air_data` leaves it."""
    now = smooth(table, SMOOTHING_S)
    # A turn is over in a moment, and a long smoothing of climb sees a dive that is none: bank is as measured.
    still = np.isfinite(now.V) & table["flying"].to_numpy() & (np.abs(now.Vdot) < STANDS_STILL_MPS2)
    still &= (np.abs(np.nan_to_num(now.climb, nan=np.inf)) < LEVEL_MPS) & (np.abs(now.bank) < LARGEST_BANK_RAD)
    runs: list[Run] = []
    rejected: list[Rejected] = []
    for rows in stretches(still):
        data = table.iloc[rows]
        seconds = float(data.index[-1] - data.index[0])
        if seconds < NEARLY_S:
            continue
        reason = _why_not(data, now.V[rows], seconds)
        if reason:
            rejected.append(Rejected(STEADY, float(data.index[0]), float(data.index[-1]), reason))
        else:
            runs.append(measured(STEADY, rows, table, now.V, quality.notes(data, now.bank[rows])))
    return runs, rejected


def _why_not(data: pd.DataFrame, V: np.ndarray, seconds: float) -> str:
    if seconds < SHORTEST_S:
        return f"too short: {seconds:.1f} s, {SHORTEST_S:.0f} s are needed"
    if low := quality.too_low(data):
        return low
    share = float(np.ptp(V) / np.mean(V))
    if share > LARGEST_SPEED_CHANGE:
        return f"speed drifted by {100 * share:.0f} % of its mean, {100 * LARGEST_SPEED_CHANGE:.0f} % are allowed"
    n = data["n_revps"]
    if not n.notna().any() or n.mean() < 1:
        return "the motor stood still"
    if n.std() > LARGEST_MOTOR_SPREAD * n.mean():
        return f"the motor's speed varied by {100 * n.std() / n.mean():.0f} %"
    return quality.without_data(data)
