"""Finds 3-2-1-1 elevator inputs: steps that alternate about trim, held for 3, 2, 1 and 1 units of time."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.maneuvers import quality
from analysis.maneuvers.kinds import STEPS_3211, Rejected, Run, measured
from analysis.maneuvers.smooth import smooth
from analysis.signals.stretches import stretches

Array = NDArray[np.float64]

SMOOTHING_S = 1.0
UNITS = np.array([3.0, 2.0, 1.0, 1.0])
STEP_RAD, STEP_S = np.radians(1.5), 0.12  # a step moves the elevator by more than this within this
LONGEST_HOLD_S = 3.0
TOLERANCE = 0.35  # of a unit: hands are not clocks
REST_S = 2.0  # of the answer, which belongs to the manoeuvre


def find_3211(table: pd.DataFrame) -> tuple[list[Run], list[Rejected]]:
    """Each input with the first seconds of its answer, and steps that are none. `table` as `air_data` leaves it."""
    if "elevator_rad" not in table or not table["elevator_rad"].notna().any():
        return [], []
    now = smooth(table, SMOOTHING_S)
    times, signs = _edges(table["elevator_rad"].interpolate(limit_direction="both").to_numpy(), now.step_s)
    runs: list[Run] = []
    rejected: list[Rejected] = []
    for first, last in _alternating(times, signs):
        holds = np.diff(times[first : last + 1])
        if len(holds) < 2:
            continue
        first, last = _best_part(holds, first, last)
        holds = np.diff(times[first : last + 1])
        start = max(0, round(times[first] / now.step_s) - 1)
        rows = slice(start, min(len(table), round((times[last] + REST_S) / now.step_s) + 1))
        data = table.iloc[rows]
        reason = "" if data["flying"].all() else "not in flight all the time"
        reason = reason or _why_not(holds) or quality.too_low(data) or quality.without_data(data)
        if reason:
            rejected.append(Rejected(STEPS_3211, float(data.index[0]), float(data.index[-1]), reason))
        else:
            words = (f"unit {np.sum(holds) / np.sum(UNITS):.2f} s",)
            runs.append(measured(STEPS_3211, rows, table, now.V, words))
    return runs, rejected


def _edges(elevator: Array, step_s: float) -> tuple[Array, Array]:
    """When the elevator stepped [s since the first row], and in which direction."""
    over = max(1, round(STEP_S / step_s))
    change = np.zeros(len(elevator))
    change[over:] = elevator[over:] - elevator[:-over]
    times, signs = [], []
    for sign in (1.0, -1.0):
        for rows in stretches(sign * change > STEP_RAD):
            # A step through `over` samples is seen for as long, from its beginning on.
            times.append(((rows.start + rows.stop - 1) / 2 - over / 2) * step_s)
            signs.append(sign)
    order = np.argsort(times)
    return np.array(times)[order], np.array(signs)[order]


def _alternating(times: Array, signs: Array) -> list[tuple[int, int]]:
    """Index of first and last edge of each sequence that alternates without a long hold."""
    found, first = [], 0
    for i in range(1, len(times) + 1):
        if i == len(times) or signs[i] == signs[i - 1] or times[i] - times[i - 1] > LONGEST_HOLD_S:
            found.append((first, i - 1))
            first = i
    return [pair for pair in found if pair[1] > pair[0]]


def _best_part(holds: Array, first: int, last: int) -> tuple[int, int]:
    """The edges of a 3-2-1-1 within a longer sequence (recovering takes steps too); all of them where there is none."""
    for i in range(len(holds) - len(UNITS) + 1):
        if not _why_not(holds[i : i + len(UNITS)]):
            return first + i, first + i + len(UNITS)
    return first, last


def _why_not(holds: Array) -> str:
    if len(holds) == len(UNITS):
        unit = float(np.sum(holds) / np.sum(UNITS))
        if np.all(np.abs(holds / unit - UNITS) < TOLERANCE):
            return ""
    return "steps held for " + ", ".join(f"{hold:.1f}" for hold in holds) + " s are no 3-2-1-1"
