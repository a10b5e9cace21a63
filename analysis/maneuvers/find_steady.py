"""Finds steady level stretches: speed, height and motor speed stay constant long enough for a steady point."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.maneuvers import quality
from analysis.maneuvers.kinds import STEADY, Maneuver, RejectedManeuver, maneuver_in
from analysis.maneuvers.smooth import smooth
from analysis.signals.stretches import stretches

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
            found.append(maneuver_in(STEADY, rows, table, motion.V, quality.notes(data, motion.bank[rows])))
    return found, rejected


def _reason_against(data: pd.DataFrame, V: Array, seconds: float) -> str:
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
