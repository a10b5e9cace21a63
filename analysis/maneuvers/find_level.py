"""Finds accelerations and decelerations in nearly level flight, and says why a stretch that looked like one is not."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.maneuvers import quality
from analysis.maneuvers.kinds import ACCELERATION, DECELERATION, Rejected, Run, measured
from analysis.maneuvers.legs import on_the_way, turning_points
from analysis.maneuvers.smooth import Smooth, smooth
from analysis.signals.stretches import stretches

Array = NDArray[np.float64]

SMOOTHING_S = 2.2  # the slope of speed with 0.3 m/s noise (Table 4.1) is then good to 0.06 m/s^2
CHANGING_MPS2 = 0.15  # at its ends a run lasts while speed changes faster than this …
CLEARLY_CHANGING_MPS2 = 0.5  # … and somewhere as fast as this
NEARLY_S = 3.0  # long enough to be told that it was too short
SHORTEST_S, LONGEST_S = 5.0, 40.0  # as seen through the smoothing, which widens a run by about its window
SMALLEST_SPEED_CHANGE = 0.2  # of the mean speed
LARGEST_ALTITUDE_CHANGE_M = 20.0
LARGEST_CLIMB_MPS = 1.2  # mean: what a ground pilot holds; take-off and approach are steeper
STEEP_MPS = 2.0  # at any moment: here a run ends
LARGEST_BANK_RAD = np.radians(25)


def find_runs(table: pd.DataFrame) -> tuple[list[Run], list[Rejected]]:
    """Runs in order of time, and the rejected stretches. `table` as `air_data` leaves it."""
    now = smooth(table, SMOOTHING_S)
    flying = table["flying"].to_numpy() & np.isfinite(now.V)
    astray = (np.abs(np.nan_to_num(now.bank)) > LARGEST_BANK_RAD) | (np.abs(np.nan_to_num(now.climb)) > STEEP_MPS)
    runs: list[Run] = []
    rejected: list[Rejected] = []
    for stretch in [*stretches(flying & ~astray), *stretches(flying & astray)]:
        for sign, rows in _legs(now, stretch):
            too_slow = np.max(sign * now.Vdot[rows]) < CLEARLY_CHANGING_MPS2
            if too_slow or rows.stop - rows.start < NEARLY_S / now.step_s:
                continue
            kind = ACCELERATION if sign > 0 else DECELERATION
            data, bank = table.iloc[rows], now.bank[rows]
            reason = _why_not(data, now, rows)
            if reason:
                rejected.append(Rejected(kind, float(data.index[0]), float(data.index[-1]), reason))
            else:
                runs.append(measured(kind, rows, table, now.V, quality.notes(data, bank)))
    return sorted(runs, key=lambda run: run.start_s), sorted(rejected, key=lambda run: run.start_s)


def _legs(now: Smooth, stretch: slice) -> Iterator[tuple[float, slice]]:
    """The legs of a stretch of the table, as far as they are under way: 1 for up or -1 for down, and the rows."""
    V, Vdot = now.V[stretch], now.Vdot[stretch]
    for first, last in pairwise(turning_points(V)):
        sign = float(np.sign(V[last] - V[first]))
        leg = slice(first, last + 1)
        way = on_the_way(V[leg], sign * Vdot[leg] > CHANGING_MPS2)
        begin = stretch.start + first
        yield sign, slice(begin + way.start, begin + way.stop)


def _why_not(data: pd.DataFrame, now: Smooth, rows: slice) -> str:
    """Why a stretch is no run; empty if it is one."""
    seconds, V, climb, bank = data.index[-1] - data.index[0], now.V[rows], now.climb[rows], now.bank[rows]
    if seconds < SHORTEST_S:
        return f"too short: {seconds:.1f} s, {SHORTEST_S:.0f} s are needed"
    if seconds > LONGEST_S:
        return f"too long: {seconds:.0f} s"
    share = float(np.ptp(V) / np.mean(V))
    if share < SMALLEST_SPEED_CHANGE:
        return f"speed changed by only {100 * share:.0f} % of its mean, {100 * SMALLEST_SPEED_CHANGE:.0f} % are needed"
    if low := quality.too_low(data):
        return low
    if abs(np.nanmean(climb)) > LARGEST_CLIMB_MPS:
        return f"not level: it climbed at {np.nanmean(climb):.1f} m/s on average"
    if np.ptp(data["height_m"].dropna()) > LARGEST_ALTITUDE_CHANGE_M:
        return f"not level: height varied by {np.ptp(data['height_m'].dropna()):.0f} m"
    if np.nanmax(np.abs(bank)) > LARGEST_BANK_RAD:
        return f"in a turn: bank reached {np.degrees(np.nanmax(np.abs(bank))):.0f} deg"
    return quality.without_data(data)
