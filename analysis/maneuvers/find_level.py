"""Finds level accelerations and decelerations (runs), and gives the reason for each rejected stretch."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.maneuvers import quality
from analysis.maneuvers.kinds import ACCELERATION, DECELERATION, Maneuver, RejectedManeuver, maneuver_in
from analysis.maneuvers.legs import changing_part, turning_points
from analysis.maneuvers.smooth import SmoothedMotion, smooth
from analysis.signals.aircraft_size import speed_scale_of
from analysis.signals.stretches import stretches

Array = NDArray[np.float64]

SMOOTHING_S = 2.2  # the slope of speed with 0.3 m/s noise (Table 4.1) is then good to 0.06 m/s^2
# Times the speed scale of the aircraft (`aircraft_size`): a slower aircraft changes its speed by the same share with a
# smaller acceleration, or in a shorter time.
CHANGING_MPS2 = 0.15  # a run extends at its ends as long as speed changes faster than this
CLEARLY_CHANGING_MPS2 = 0.5  # the least peak acceleration of a run
MENTIONED_S = 3.0  # a stretch this long is listed as rejected; a shorter one is ignored
SHORTEST_S = 5.0  # after smoothing, which widens a run by about its window

LONGEST_S = 40.0
SMALLEST_SPEED_CHANGE = 0.2  # of the mean speed
LARGEST_ALTITUDE_CHANGE_M = 20.0
LARGEST_CLIMB_MPS = 1.2  # mean, times the speed scale; a pilot holds this, take-off and approach are steeper
STEEP_MPS = 2.0  # a run ends where the momentary climb rate exceeds this
LARGEST_BANK_RAD = np.radians(25)


def find_runs(table: pd.DataFrame) -> tuple[list[Maneuver], list[RejectedManeuver]]:
    """Runs and rejected stretches, each in order of time. table: of `air_data`."""
    motion, scale = smooth(table, SMOOTHING_S), speed_scale_of(table)
    flying = table["flying"].to_numpy() & np.isfinite(motion.V)
    turning_or_steep = (np.abs(np.nan_to_num(motion.bank)) > LARGEST_BANK_RAD) | (
        np.abs(np.nan_to_num(motion.climb)) > STEEP_MPS
    )
    runs: list[Maneuver] = []
    rejected: list[RejectedManeuver] = []
    for stretch in [*stretches(flying & ~turning_or_steep), *stretches(flying & turning_or_steep)]:
        for sign, rows in _legs(motion, stretch, CHANGING_MPS2 * scale):
            gentle = _too_gentle(sign * motion.Vdot[rows], scale)
            held = gentle and _speed_change(motion.V[rows]) < SMALLEST_SPEED_CHANGE
            if held or rows.stop - rows.start < MENTIONED_S * scale / motion.step_s:
                continue
            kind = ACCELERATION if sign > 0 else DECELERATION
            data, bank = table.iloc[rows], motion.bank[rows]
            reason = gentle or _reason_against(data, motion, rows, scale)
            if reason:
                rejected.append(RejectedManeuver(kind, float(data.index[0]), float(data.index[-1]), reason))
            else:
                runs.append(maneuver_in(kind, rows, table, motion.V, quality.notes(data, bank)))
    return sorted(runs, key=lambda run: run.start_s), sorted(rejected, key=lambda run: run.start_s)


def _legs(motion: SmoothedMotion, stretch: slice, changing_mps2: float) -> Iterator[tuple[float, slice]]:
    """The changing part of each leg in some rows of the table: 1 for an acceleration or -1, and its rows."""
    V, Vdot = motion.V[stretch], motion.Vdot[stretch]
    for first, last in pairwise(turning_points(V)):
        sign = float(np.sign(V[last] - V[first]))
        leg = slice(first, last + 1)
        part = changing_part(V[leg], sign * Vdot[leg] > changing_mps2)
        begin = stretch.start + first
        yield sign, slice(begin + part.start, begin + part.stop)


def _too_gentle(acceleration_mps2: Array, scale: float) -> str:
    """Reason if speed changes too slowly for a run; empty if it does not. acceleration_mps2: in the leg's direction."""
    largest, needed = float(np.max(acceleration_mps2)), CLEARLY_CHANGING_MPS2 * scale
    if largest >= needed:
        return ""
    return f"too gentle: speed changed by {largest:.2f} m/s² at most, {needed:.2f} m/s² are needed"


def _speed_change(V: Array) -> float:
    """As a share of the mean."""
    return float(np.ptp(V) / np.mean(V))


def _reason_against(data: pd.DataFrame, motion: SmoothedMotion, rows: slice, scale: float) -> str:
    """Why a stretch is not a run; empty if it is one."""
    seconds, V, climb, bank = data.index[-1] - data.index[0], motion.V[rows], motion.climb[rows], motion.bank[rows]
    if seconds < SHORTEST_S * scale:
        return f"too short: {seconds:.1f} s, {SHORTEST_S * scale:.2g} s are needed"
    if seconds > LONGEST_S:
        return f"too long: {seconds:.0f} s"
    share = _speed_change(V)
    if share < SMALLEST_SPEED_CHANGE:
        return f"speed changed by only {100 * share:.0f} % of its mean, {100 * SMALLEST_SPEED_CHANGE:.0f} % are needed"
    if low := quality.too_low(data):
        return low
    if abs(np.nanmean(climb)) > LARGEST_CLIMB_MPS * scale:
        return f"not level: it climbed at {np.nanmean(climb):.1f} m/s on average"
    if np.ptp(data["height_m"].dropna()) > LARGEST_ALTITUDE_CHANGE_M:
        return f"not level: height varied by {np.ptp(data['height_m'].dropna()):.0f} m"
    if np.nanmax(np.abs(bank)) > LARGEST_BANK_RAD:
        return f"in a turn: bank reached {np.degrees(np.nanmax(np.abs(bank))):.0f} deg"
    return quality.without_data(data)
