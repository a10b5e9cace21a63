"""Finds 3-2-1-1 elevator inputs: alternating steps about trim, held for 3, 2, 1 and 1 units of time."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.maneuvers import quality
from analysis.maneuvers.kinds import STEPS_3211, Maneuver, RejectedManeuver, maneuver_in
from analysis.maneuvers.smooth import smooth
from analysis.signals.gaps import without_gaps
from analysis.signals.stretches import stretches

Array = NDArray[np.float64]

SMOOTHING_S = 1.0
UNITS = np.array([3.0, 2.0, 1.0, 1.0])
STEP_RAD, STEP_S = np.radians(1.5), 0.12  # a step moves the elevator by more than this within this
LONGEST_HOLD_S = 3.0
TOLERANCE = 0.35  # of a unit, for steps flown by hand
RESPONSE_S = 2.0  # of the aircraft's response after the last step, which belongs to the maneuver


def find_3211(table: pd.DataFrame) -> tuple[list[Maneuver], list[RejectedManeuver]]:
    """The 3-2-1-1 inputs, each with RESPONSE_S of response, and rejected sequences of steps. table: of `air_data`."""
    if "elevator_rad" not in table or not table["elevator_rad"].notna().any():
        return [], []
    motion = smooth(table, SMOOTHING_S)
    times, signs = _edges(without_gaps(table["elevator_rad"].to_numpy()), motion.step_s)
    found: list[Maneuver] = []
    rejected: list[RejectedManeuver] = []
    for first, last in _alternating(times, signs):
        holds = np.diff(times[first : last + 1])
        if len(holds) < 2:
            continue
        first, last = _best_part(holds, first, last)
        holds = np.diff(times[first : last + 1])
        start = max(0, round(times[first] / motion.step_s) - 1)
        rows = slice(start, min(len(table), round((times[last] + RESPONSE_S) / motion.step_s) + 1))
        data = table.iloc[rows]
        reason = "" if data["flying"].all() else "not in flight throughout"
        reason = reason or _reason_against(holds) or quality.too_low(data) or quality.without_data(data)
        if reason:
            rejected.append(RejectedManeuver(STEPS_3211, float(data.index[0]), float(data.index[-1]), reason))
        else:
            notes = (f"unit {np.sum(holds) / np.sum(UNITS):.2f} s",)
            found.append(maneuver_in(STEPS_3211, rows, table, motion.V, notes))
    return found, rejected


def _edges(elevator: Array, step_s: float) -> tuple[Array, Array]:
    """Times of the elevator steps [s since the first row], and their directions (1 or -1)."""
    over = max(1, round(STEP_S / step_s))
    change = np.zeros(len(elevator))
    change[over:] = elevator[over:] - elevator[:-over]
    times, signs = [], []
    for sign in (1.0, -1.0):
        for rows in stretches(sign * change > STEP_RAD):
            # The difference over `over` samples lasts that long after the step: subtract half of it.
            times.append(((rows.start + rows.stop - 1) / 2 - over / 2) * step_s)
            signs.append(sign)
    order = np.argsort(times)
    return np.array(times)[order], np.array(signs)[order]


def _alternating(times: Array, signs: Array) -> list[tuple[int, int]]:
    """Indices of the first and last edge of each alternating sequence without a hold above LONGEST_HOLD_S."""
    found, first = [], 0
    for i in range(1, len(times) + 1):
        if i == len(times) or signs[i] == signs[i - 1] or times[i] - times[i - 1] > LONGEST_HOLD_S:
            found.append((first, i - 1))
            first = i
    return [pair for pair in found if pair[1] > pair[0]]


def _best_part(holds: Array, first: int, last: int) -> tuple[int, int]:
    """First and last edge of a 3-2-1-1 within a longer sequence (recovery adds steps); the whole sequence if none."""
    for i in range(len(holds) - len(UNITS) + 1):
        if not _reason_against(holds[i : i + len(UNITS)]):
            return first + i, first + i + len(UNITS)
    return first, last


def _reason_against(holds: Array) -> str:
    if len(holds) == len(UNITS):
        unit = float(np.sum(holds) / np.sum(UNITS))
        if np.all(np.abs(holds / unit - UNITS) < TOLERANCE):
            return ""
    return "steps held for " + ", ".join(f"{hold:.1f}" for hold in holds) + " s are not a 3-2-1-1"
