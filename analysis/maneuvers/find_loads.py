"""Finds the maneuvers in which lift varies at nearly constant speed: roller coasters, porpoising, wind-up turns.

Finds 3-2-1-1 elevator inputs: alternating steps about trim, held for 3, 2, 1 and 1 units of time.
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.maneuvers import find_level
from analysis.maneuvers.kinds import (
    PORPOISING,
    ROLLER_COASTER,
    STEPS_3211,
    WIND_UP_TURN,
    Maneuver,
    RejectedManeuver,
    maneuver_in,
)
from analysis.maneuvers.smooth import SmoothedMotion, load_factor, smooth
from analysis.signals.smoothing import stretches, without_gaps

Array = NDArray[np.float64]

SMOOTHING_S = 1.0
LOAD_SMOOTHING_S = 0.4
LOADED = 0.15  # a maneuver lasts while the load factor differs from 1 by more than this …
PAUSE_S = 1.0  # … with pauses no longer than this
PULLED, PUSHED = 1.25, 0.75  # a roller coaster goes beyond both
SHORTEST_S, LONGEST_S = 2.5, 40.0
PORPOISING_SWINGS = 8  # this many swings in one stretch are porpoising, not a roller coaster
# A porpoise that is too gentle is told from gusts by its regular swings: this many in a row, beyond this load factor
# to either side of 1, the times between them (0.4 to 1.6 s) within a third of their median.
GENTLE, REGULAR_SWINGS, REGULAR = 0.05, 12, 0.35
SWING_S = (0.4, 1.6)
WINGS_LEVEL_RAD = np.radians(25)
BANKED_RAD = np.radians(15)
WOUND_UP = 1.4  # load factor that a wind-up turn reaches
LOADING_PER_S = 0.03
LINEAR = 0.8  # share of the load factor's variance that a straight line explains
LARGEST_SPEED_CHANGE = 0.2


def find_loads(table: pd.DataFrame) -> tuple[list[Maneuver], list[RejectedManeuver]]:
    """The maneuvers of all three kinds, and the rejected stretches. table: of `air_data`."""
    motion, n = smooth(table, SMOOTHING_S), load_factor(table, LOAD_SMOOTHING_S)
    flying = table["flying"].to_numpy() & np.isfinite(motion.V)
    found: list[Maneuver] = []
    rejected: list[RejectedManeuver] = []
    for kind, where, loads_enough, reason_against in (
        (
            ROLLER_COASTER,
            flying & (np.abs(n - 1) > LOADED) & (np.abs(motion.bank) < WINGS_LEVEL_RAD),
            _pulled_and_pushed,
            _against_roller_coaster,
        ),
        (WIND_UP_TURN, flying & (np.abs(motion.bank) > BANKED_RAD), _wound_up, _against_wind_up_turn),
    ):
        for rows in stretches(_with_short_gaps_closed(where, round(PAUSE_S / motion.step_s))):
            rows = _loading(rows, n) if kind == WIND_UP_TURN else rows
            if not loads_enough(n[rows]):
                continue
            data = table.iloc[rows]
            if kind == ROLLER_COASTER and _swings(n[rows]) >= PORPOISING_SWINGS:
                found.append(maneuver_in(PORPOISING, rows, table, motion.V, _range_of(n[rows])))
                continue
            reason = (
                find_level.without_data(data) or reason_against(data, motion, rows, n[rows]) or find_level.too_low(data)
            )
            if reason:
                rejected.append(RejectedManeuver(kind, float(data.index[0]), float(data.index[-1]), reason))
            else:
                found.append(maneuver_in(kind, rows, table, motion.V, _range_of(n[rows])))
    return found, rejected + _gentle_porpoises(table, n, flying & (np.abs(motion.bank) < WINGS_LEVEL_RAD), found)


def _gentle_porpoises(
    table: pd.DataFrame, n: Array, level: NDArray[np.bool_], found: list[Maneuver]
) -> list[RejectedManeuver]:
    """Porpoises in which the load factor stays within PUSHED and PULLED. level: in flight with wings level."""
    t = table.index.to_numpy()
    rejected = []
    for rows in stretches(level):
        side = np.where(n[rows] > 1 + GENTLE, 1, np.where(n[rows] < 1 - GENTLE, -1, 0))
        beyond = np.flatnonzero(side)
        swings = t[rows][beyond[1:][np.diff(side[beyond]) != 0]]
        between = np.diff(swings)
        usual = pd.Series(between).rolling(REGULAR_SWINGS, center=True, min_periods=1).median().to_numpy()
        regular = (between > SWING_S[0]) & (between < SWING_S[1]) & (np.abs(between / usual - 1) < REGULAR)
        for part in stretches(regular):
            start, end = float(swings[part.start]), float(swings[part.stop])
            if part.stop - part.start < REGULAR_SWINGS or any(m.start_s < end and start < m.end_s for m in found):
                continue
            within = n[(t >= start) & (t <= end)]
            reason = (
                f"too gentle to count: load factor {np.nanmin(within):.2f} to {np.nanmax(within):.2f}, beyond"
                f" {PUSHED:g} and {PULLED:g} is needed"
            )
            rejected.append(RejectedManeuver(PORPOISING, start, end, reason))
    return rejected


def _pulled_and_pushed(n: Array) -> bool:
    return bool(np.any(n > PULLED) and np.any(n < PUSHED))


def _swings(n: Array) -> int:
    """How often the load factor went from pushed to pulled or back."""
    side = np.where(n > PULLED, 1, np.where(n < PUSHED, -1, 0))
    return int(np.count_nonzero(np.diff(side[side != 0])))


def _range_of(n: Array) -> tuple[str]:
    return (f"load factor {np.nanmin(n):.1f} to {np.nanmax(n):.1f}",)


def _against_roller_coaster(data: pd.DataFrame, motion: SmoothedMotion, rows: slice, n: Array) -> str:
    seconds = float(data.index[-1] - data.index[0])
    if seconds < SHORTEST_S:
        return f"too short: {seconds:.1f} s, {SHORTEST_S:g} s are needed"
    return f"too long: {seconds:.0f} s" if seconds > LONGEST_S else ""


def _wound_up(n: Array) -> bool:
    return bool(np.any(n > WOUND_UP))


def _against_wind_up_turn(data: pd.DataFrame, motion: SmoothedMotion, rows: slice, n: Array) -> str:
    t = data.index.to_numpy()
    if t[-1] - t[0] < SHORTEST_S:
        return f"too short: {t[-1] - t[0]:.1f} s, {SHORTEST_S:g} s are needed"
    known = np.isfinite(n)
    t, n = t[known], n[known]
    slope, level = np.polyfit(t - t[0], n, 1)
    explained = 1 - np.var(n - level - slope * (t - t[0])) / np.var(n)
    if slope < LOADING_PER_S or explained < LINEAR:
        fit = f"{slope:+.2f} per second, a straight line explains {100 * explained:.0f} %"
        return f"the load factor did not rise steadily: {fit}"
    share = float((np.nanmax(motion.V[rows]) - np.nanmin(motion.V[rows])) / np.nanmean(motion.V[rows]))
    if share > LARGEST_SPEED_CHANGE:
        return f"speed changed by {100 * share:.0f} % of its mean, {100 * LARGEST_SPEED_CHANGE:.0f} % are allowed"
    return ""


def _loading(rows: slice, n: Array) -> slice:
    """The part of a turn up to its highest load factor; NaN is ignored."""
    return slice(rows.start, rows.start + int(np.argmax(np.nan_to_num(n[rows], nan=-np.inf))) + 1)


def _with_short_gaps_closed(flag: NDArray[np.bool_], longest: int) -> NDArray[np.bool_]:
    """`flag` with gaps of up to `longest` samples between two stretches set to True."""
    out = flag.copy()
    for gap in stretches(~flag):
        if gap.start > 0 and gap.stop < len(flag) and gap.stop - gap.start <= longest:
            out[gap] = True
    return out


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
        reason = reason or _reason_against(holds) or find_level.too_low(data) or find_level.without_data(data)
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
