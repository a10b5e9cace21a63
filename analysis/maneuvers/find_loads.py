"""Finds the manoeuvres in which lift varies at about one speed: roller coasters, porpoising and wind-up turns."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.maneuvers import quality
from analysis.maneuvers.kinds import PORPOISING, ROLLER_COASTER, WIND_UP_TURN, Rejected, Run, measured
from analysis.maneuvers.smooth import Smooth, load_factor, smooth
from analysis.signals.stretches import stretches

Array = NDArray[np.float64]

SMOOTHING_S = 1.0
LOAD_SMOOTHING_S = 0.4
AWAY = 0.15  # from a load factor of 1: a manoeuvre lasts while it is further away …
PAUSE_S = 1.0  # … or comes back to it for no longer than this
PULLED, PUSHED = 1.25, 0.75  # a roller coaster goes beyond both
SHORTEST_S, LONGEST_S = 2.5, 40.0
PORPOISED = 8  # times up or down in one go are no roller coaster any more
WINGS_LEVEL_RAD = np.radians(25)
BANKED_RAD = np.radians(15)
WOUND_UP = 1.4  # load factor that a wind-up turn reaches
LOADING_PER_S = 0.03
LINEAR = 0.8  # share of the load factor's variance that a straight line explains
LARGEST_SPEED_CHANGE = 0.2


def find_loads(table: pd.DataFrame) -> tuple[list[Run], list[Rejected]]:
    """All three kinds, and the rejected stretches. `table` as `air_data` leaves it."""
    now, n = smooth(table, SMOOTHING_S), load_factor(table, LOAD_SMOOTHING_S)
    flying = table["flying"].to_numpy() & np.isfinite(now.V)
    runs: list[Run] = []
    rejected: list[Rejected] = []
    for kind, where, is_one, why_not in (
        (ROLLER_COASTER, flying & (np.abs(n - 1) > AWAY) & (np.abs(now.bank) < WINGS_LEVEL_RAD), _coasts, _no_coaster),
        (WIND_UP_TURN, flying & (np.abs(now.bank) > BANKED_RAD), _is_wound_up, _no_wind_up),
    ):
        for rows in stretches(_bridged(where, round(PAUSE_S / now.step_s))):
            rows = _loading(rows, n) if kind == WIND_UP_TURN else rows
            if not is_one(n[rows]):
                continue
            data = table.iloc[rows]
            if kind == ROLLER_COASTER and _swings(n[rows]) >= PORPOISED:
                runs.append(measured(PORPOISING, rows, table, now.V, _between(n[rows])))
                continue
            reason = quality.without_data(data) or why_not(data, now, rows, n[rows]) or quality.too_low(data)
            if reason:
                rejected.append(Rejected(kind, float(data.index[0]), float(data.index[-1]), reason))
            else:
                runs.append(measured(kind, rows, table, now.V, _between(n[rows])))
    return runs, rejected


def _coasts(n: Array) -> bool:
    return bool(np.any(n > PULLED) and np.any(n < PUSHED))


def _swings(n: Array) -> int:
    """How often the load factor went from pushed to pulled or back."""
    side = np.where(n > PULLED, 1, np.where(n < PUSHED, -1, 0))
    return int(np.count_nonzero(np.diff(side[side != 0])))


def _between(n: Array) -> tuple[str]:
    return (f"load factor {np.nanmin(n):.1f} to {np.nanmax(n):.1f}",)


def _no_coaster(data: pd.DataFrame, now: Smooth, rows: slice, n: Array) -> str:
    seconds = float(data.index[-1] - data.index[0])
    if seconds < SHORTEST_S:
        return f"too short: {seconds:.1f} s, {SHORTEST_S:g} s are needed"
    return f"too long: {seconds:.0f} s" if seconds > LONGEST_S else ""


def _is_wound_up(n: Array) -> bool:
    return bool(np.any(n > WOUND_UP))


def _no_wind_up(data: pd.DataFrame, now: Smooth, rows: slice, n: Array) -> str:
    t = data.index.to_numpy()
    if t[-1] - t[0] < SHORTEST_S:
        return f"too short: {t[-1] - t[0]:.1f} s, {SHORTEST_S:g} s are needed"
    known = np.isfinite(n)
    t, n = t[known], n[known]
    slope, level = np.polyfit(t - t[0], n, 1)
    explained = 1 - np.var(n - level - slope * (t - t[0])) / np.var(n)
    if slope < LOADING_PER_S or explained < LINEAR:
        return f"the load factor did not rise steadily: {slope:+.2f} a second, {100 * explained:.0f} % of it a line"
    share = float((np.nanmax(now.V[rows]) - np.nanmin(now.V[rows])) / np.nanmean(now.V[rows]))
    if share > LARGEST_SPEED_CHANGE:
        return f"speed changed by {100 * share:.0f} % of its mean, {100 * LARGEST_SPEED_CHANGE:.0f} % are allowed"
    return ""


def _loading(rows: slice, n: Array) -> slice:
    """The part of a turn up to its highest load factor; NaN is none."""
    return slice(rows.start, rows.start + int(np.argmax(np.nan_to_num(n[rows], nan=-np.inf))) + 1)


def _bridged(flag: NDArray[np.bool_], longest: int) -> NDArray[np.bool_]:
    """With the gaps of up to `longest` samples between stretches closed."""
    out = flag.copy()
    for gap in stretches(~flag):
        if gap.start > 0 and gap.stop < len(flag) and gap.stop - gap.start <= longest:
            out[gap] = True
    return out
