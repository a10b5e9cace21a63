"""Finds the maneuvers in which lift varies at nearly constant speed, and 3-2-1-1 elevator inputs."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.maneuvers import quality
from flightpower.analysis.maneuvers.kinds import (
    PORPOISING,
    ROLLER_COASTER,
    STEPS_3211,
    WIND_UP_TURN,
    Maneuver,
    RejectedManeuver,
    Search,
    Unsuitable,
)
from flightpower.analysis.maneuvers.quality import SmoothedMotion, load_factor, smooth
from flightpower.analysis.maneuvers.settings import LOADS, STEPS
from flightpower.analysis.sources.grid import stretches, without_gaps
from flightpower.flight.arrays import Array
from flightpower.flight.runs import LEVEL_RUN, Rejection, RunRejected


def find_loads(table: pd.DataFrame) -> tuple[list[Maneuver], list[RejectedManeuver]]:
    """The maneuvers of all three kinds, and the rejected stretches. table: from `air_data`."""
    motion, n = smooth(table, LOADS.smoothing_s), load_factor(table, LOADS.load_smoothing_s)
    flying = table["flying"].to_numpy() & np.isfinite(motion.V)
    search = Search(table, motion.V)
    for kind, where, loads_enough, rejection_of in (
        (
            ROLLER_COASTER,
            flying & (np.abs(n - 1) > LOADS.deviation.lasting) & (np.abs(motion.bank) < LEVEL_RUN.largest_bank_rad),
            _pulled_and_pushed,
            _roller_coaster_rejection,
        ),
        (WIND_UP_TURN, flying & (np.abs(motion.bank) > LOADS.banked_rad), _wound_up, _wind_up_turn_rejection),
    ):
        for rows in stretches(_with_short_gaps_closed(where, round(LOADS.smoothing_s / motion.step_s))):
            rows = _loading(rows, n) if kind == WIND_UP_TURN else rows
            if not loads_enough(n[rows]):
                continue
            data = table.iloc[rows]
            if kind == ROLLER_COASTER and _swings(n[rows]) >= LOADS.swings[0]:
                search.judged(PORPOISING, rows, None, _range_of(n[rows]))
                continue
            rejection = quality.without_data(data) or rejection_of(data, motion, rows, n[rows]) or quality.too_low(data)
            search.judged(kind, rows, rejection, () if rejection else _range_of(n[rows]))
    return search.maneuvers, search.rejected + _gentle_porpoises(
        table, n, flying & (np.abs(motion.bank) < LEVEL_RUN.largest_bank_rad), search.maneuvers
    )


def _gentle_porpoises(
    table: pd.DataFrame, n: Array, level: NDArray[np.bool_], maneuvers: list[Maneuver]
) -> list[RejectedManeuver]:
    """Regular porpoises too gentle to count as maneuvers. level: (n,) whether in flight with wings level."""
    t = table.index.to_numpy()
    rejected = []
    gentle, (_, fewest_swings) = LOADS.deviation.gentle, LOADS.swings
    for rows in stretches(level):
        side = np.where(n[rows] > 1 + gentle, 1, np.where(n[rows] < 1 - gentle, -1, 0))
        loaded = np.flatnonzero(side)
        swings = t[rows][loaded[1:][np.diff(side[loaded]) != 0]]
        between = np.diff(swings)
        usual = pd.Series(between).rolling(fewest_swings, center=True, min_periods=1).median().to_numpy()
        shortest_s, longest_s = LOADS.swing_s
        regular = (between > shortest_s) & (between < longest_s) & (np.abs(between / usual - 1) < LOADS.irregular)
        for part in stretches(regular):
            start, end = float(swings[part.start]), float(swings[part.stop])
            if part.stop - part.start < fewest_swings or any(m.start_s < end and start < m.end_s for m in maneuvers):
                continue
            within = n[(t >= start) & (t <= end)]
            swung = f"{np.nanmin(within):.2f} to {np.nanmax(within):.2f}, beyond {LOADS.pushed:g} and {LOADS.pulled:g}"
            rejection = Rejection(Unsuitable.PORPOISE_TOO_GENTLE, quantity=swung)
            rejected.append(RejectedManeuver(PORPOISING, start, end, rejection))
    return rejected


def _pulled_and_pushed(n: Array) -> bool:
    return bool(np.any(n > LOADS.pulled) and np.any(n < LOADS.pushed))


def _swings(n: Array) -> int:
    """How often the load factor went from below LOADS.pushed to above LOADS.pulled or back."""
    side = np.where(n > LOADS.pulled, 1, np.where(n < LOADS.pushed, -1, 0))
    return int(np.count_nonzero(np.diff(side[side != 0])))


def _range_of(n: Array) -> tuple[str]:
    return (f"load factor {np.nanmin(n):.1f} to {np.nanmax(n):.1f}",)


def _roller_coaster_rejection(data: pd.DataFrame, motion: SmoothedMotion, rows: slice, n: Array) -> Rejection | None:
    seconds = float(data.index[-1] - data.index[0])
    if seconds < LOADS.shortest_s:
        return Rejection(RunRejected.TOO_SHORT, seconds, LOADS.shortest_s)
    return Rejection(RunRejected.TOO_LONG, seconds, LEVEL_RUN.longest_s) if seconds > LEVEL_RUN.longest_s else None


def _wound_up(n: Array) -> bool:
    return bool(np.any(n > 1 + LOADS.deviation.wind_up_turn))


def _wind_up_turn_rejection(data: pd.DataFrame, motion: SmoothedMotion, rows: slice, n: Array) -> Rejection | None:
    t = data.index.to_numpy()
    if t[-1] - t[0] < LOADS.shortest_s:
        return Rejection(RunRejected.TOO_SHORT, float(t[-1] - t[0]), LOADS.shortest_s)
    finite = np.isfinite(n)
    t, n = t[finite], n[finite]
    slope, level = np.polyfit(t - t[0], n, 1)
    explained = 1 - np.var(n - level - slope * (t - t[0])) / np.var(n)
    if slope < LOADS.loading_per_s or explained < LOADS.linear:
        fit = f"{slope:+.2f} per second, a straight line explains {100 * explained:.0f} %"
        return Rejection(Unsuitable.LOAD_NOT_STEADY, slope, LOADS.loading_per_s, fit)
    share = float((np.nanmax(motion.V[rows]) - np.nanmin(motion.V[rows])) / np.nanmean(motion.V[rows]))
    if share > LEVEL_RUN.smallest_speed_change:
        return Rejection(Unsuitable.SPEED_CHANGED, share, LEVEL_RUN.smallest_speed_change)
    return None


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


def find_3211(table: pd.DataFrame) -> tuple[list[Maneuver], list[RejectedManeuver]]:
    """The 3-2-1-1 inputs, each with the response to it, and rejected sequences of steps. table: from `air_data`."""
    if "elevator_rad" not in table or not table["elevator_rad"].notna().any():
        return [], []
    motion = smooth(table, LOADS.smoothing_s)
    times, signs = _edges(without_gaps(table["elevator_rad"].to_numpy()), motion.step_s)
    search = Search(table, motion.V)
    for first, last in _alternating(times, signs):
        holds = np.diff(times[first : last + 1])
        if len(holds) < 2:
            continue
        first, last = _best_part(holds, first, last)
        holds = np.diff(times[first : last + 1])
        start = max(0, round(times[first] / motion.step_s) - 1)
        rows = slice(start, min(len(table), round((times[last] + STEPS.response_s) / motion.step_s) + 1))
        data = table.iloc[rows]
        rejection = None if data["flying"].all() else Rejection(Unsuitable.NOT_FLYING)
        rejection = rejection or _3211_rejection(holds) or quality.too_low(data) or quality.without_data(data)
        search.judged(STEPS_3211, rows, rejection, (f"unit {np.sum(holds) / np.sum(STEPS.units):.2f} s",))
    return search.maneuvers, search.rejected


def _edges(elevator: Array, step_s: float) -> tuple[Array, Array]:
    """Times of the elevator steps [s since the first row], and their directions (1 or -1)."""
    angle_rad, within_s = STEPS.step
    over = max(1, round(within_s / step_s))
    change = np.zeros(len(elevator))
    change[over:] = elevator[over:] - elevator[:-over]
    times, signs = [], []
    for sign in (1.0, -1.0):
        for rows in stretches(sign * change > angle_rad):
            # A difference over `over` samples outlasts the step by that many: subtract half of them.
            times.append(((rows.start + rows.stop - 1) / 2 - over / 2) * step_s)
            signs.append(sign)
    order = np.argsort(times)
    return np.array(times)[order], np.array(signs)[order]


def _alternating(times: Array, signs: Array) -> list[tuple[int, int]]:
    """Indices of the first and last edge of each alternating sequence without a hold above STEPS.longest_hold_s."""
    sequences, first = [], 0
    for i in range(1, len(times) + 1):
        if i == len(times) or signs[i] == signs[i - 1] or times[i] - times[i - 1] > STEPS.longest_hold_s:
            sequences.append((first, i - 1))
            first = i
    return [pair for pair in sequences if pair[1] > pair[0]]


def _best_part(holds: Array, first: int, last: int) -> tuple[int, int]:
    """First and last edge of a 3-2-1-1 within a longer sequence (recovery adds steps); the whole sequence if none."""
    for i in range(len(holds) - len(STEPS.units) + 1):
        if not _3211_rejection(holds[i : i + len(STEPS.units)]):
            return first + i, first + i + len(STEPS.units)
    return first, last


def _3211_rejection(holds: Array) -> Rejection | None:
    """Why the holds [s] are not a 3-2-1-1; None if they are."""
    if len(holds) == len(STEPS.units):
        unit = float(np.sum(holds) / np.sum(STEPS.units))
        if np.all(np.abs(holds / unit - STEPS.units) < LOADS.irregular):
            return None
    return Rejection(Unsuitable.NO_3211, quantity=", ".join(f"{hold:.1f}" for hold in holds))
