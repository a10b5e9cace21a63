"""Quality of a maneuver's data: reasons to reject it, and notes for the reader of the results.

Divides a speed history into legs of alternately rising and falling speed. A run is part of a leg.

In gusts the slope of speed changes sign every few seconds within a run. A leg continues through that; it ends when
speed has come back by a share of its value and by a share of what the leg gained.

Finds level accelerations and decelerations (runs), and gives the reason for each rejected stretch.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.maneuvers.kinds import ACCELERATION, DECELERATION, Maneuver, RejectedManeuver, maneuver_in
from analysis.maneuvers.smooth import SmoothedMotion, smooth
from analysis.signals.aircraft_size import least_height_m, speed_scale_of
from analysis.signals.smoothing import stretches
from flight.units import GRAVITY_MPS2

Array = NDArray[np.float64]

NEEDED = ("V_mps", "alpha_rad", "ax_mps2", "az_mps2", "q_radps", "thrust_N", "rho")
LARGEST_GAP_SHARE = 0.02
TOO_LOW = "too low"

# A note is written beyond these.
NOTED_HEIGHT_M = 5.0
NOTED_BANK_RAD = np.radians(10)
NOTED_GAP_SHARE = 0.002
NOTED_OUTSIDE_TABLE = 0.02
# The motor reaches its speed within 0.2 s: a throttle step faster than this pitches the aircraft (Fig. 7.13-7.15).
THROTTLE_STEP, THROTTLE_STEP_S = 0.3, 0.25
# Rms of the load factor about its two-second mean. Accelerometer noise (Table 4.1) alone gives 0.006, gusts with
# W20 = 3 kt about 0.04, with 15 kt 0.2.
LIGHT_TURBULENCE, ROUGH_TURBULENCE, TURBULENCE_WINDOW_S = 0.025, 0.12, 2.0


def too_low(data: pd.DataFrame) -> str:
    """Reason if a stretch is too near the ground; empty if it is not."""
    if not data["height_m"].notna().any():
        return "no height was measured"
    lowest, least = np.nanmin(data["height_m"]), least_height_m(data)
    return "" if lowest >= least else f"{TOO_LOW}: down to {lowest:.0f} m above the ground, {least:.0f} m are needed"


def without_data(data: pd.DataFrame) -> str:
    """Reason if a needed channel is missing for too long; empty if none is."""
    for name in NEEDED:
        missing = float(data[name].isna().mean())
        if missing > LARGEST_GAP_SHARE:
            return f"no {quantity(name)} for {100 * missing:.0f} % of the time"
    return ""


def notes(data: pd.DataFrame, bank: Array) -> tuple[str, ...]:
    """What a reader should know of a maneuver that is used, a few words each. bank: (n,) [rad]."""
    found = []
    uncovered = 1 - float(data["propeller_covered"].mean())
    if uncovered > NOTED_OUTSIDE_TABLE:
        found.append(
            f"{100 * uncovered:.0f} % of the data lie outside the propeller table, which is extrapolated there"
        )
    height = data["height_m"].dropna()
    if len(height) and np.ptp(height) > NOTED_HEIGHT_M:
        found.append(f"height varied by {np.ptp(height):.0f} m")
    if np.nanmax(np.abs(bank)) > NOTED_BANK_RAD:
        found.append(f"bank reached {np.degrees(np.nanmax(np.abs(bank))):.0f} deg")
    step = throttle_step(data)
    if step > THROTTLE_STEP:
        found.append(f"throttle moved by {100 * step:.0f} % within {THROTTLE_STEP_S:g} s: a step pitches the aircraft")
    rms = load_factor_rms(data)
    if rms > LIGHT_TURBULENCE:
        word = "rough" if rms > ROUGH_TURBULENCE else "light"
        found.append(f"{word} turbulence: the load factor varies by {rms:.2f} rms")
    for name in NEEDED:
        missing = float(data[name].isna().mean())
        if missing > NOTED_GAP_SHARE:
            found.append(
                f"{quantity(name)} was stale or missing for {100 * missing:.1f} % of the time and is interpolated there"
            )
    return tuple(found)


def load_factor_rms(data: pd.DataFrame) -> float:
    """Rms of the load factor about its two-second mean [-]: a measure of turbulence."""
    step_s = float(data.index[1] - data.index[0])
    n = data["az_mps2"] / GRAVITY_MPS2
    slow = n.rolling(max(3, round(TURBULENCE_WINDOW_S / step_s)), center=True, min_periods=1).mean()
    return float((n - slow).std())


def throttle_step(data: pd.DataFrame) -> float:
    """Largest change of throttle within THROTTLE_STEP_S [-]; zero if throttle is not known."""
    if "throttle" not in data or not data["throttle"].notna().any():
        return 0.0
    step_s = float(data.index[1] - data.index[0])
    change = data["throttle"].diff(max(1, round(THROTTLE_STEP_S / step_s))).abs().max()
    return float(change) if np.isfinite(change) else 0.0


def quantity(column: str) -> str:
    """A column's name without its unit: "thrust" for "thrust_N"."""
    return column.rpartition("_")[0] or column


# A leg ends when speed has come back by both: a share of the speed (a pilot holding speed stays within it, gusts of
# W20 = 15 kt mostly do), and a share of what the leg has gained.
OF_SPEED, OF_GAIN = 0.12, 0.25
HELD = 0.05  # speed is held while it is within this share of the leg's first or last speed


def turning_points(V: Array) -> list[int]:
    """Indices at which legs begin and end: the highest and lowest speeds in turn; the last one ends the last leg.

    V : (n,) finite speeds [m/s]. Empty if speed never changes by OF_SPEED.
    """
    points: list[int] = []
    direction, low, high = 0, 0, 0
    for i, v in enumerate(V):
        high = i if v > V[high] else high
        low = i if v < V[low] else low
        furthest = high if direction > 0 else low
        if direction == 0 and V[high] - V[low] > OF_SPEED * V[high]:
            direction = 1 if high > low else -1
            points.append(low if direction > 0 else high)
        elif direction and abs(V[furthest] - v) > max(
            OF_SPEED * V[furthest], OF_GAIN * abs(V[furthest] - V[points[-1]])
        ):
            points.append(furthest)
            direction, low, high = -direction, i, i
    if direction:
        points.append(high if direction > 0 else low)
    return points


def changing_part(V: Array, changing: NDArray[np.bool_]) -> slice:
    """The rows of a leg in which speed changes, without those at either end in which it is held.

    V : (n,) speeds from one turning point to the next     changing : (n,) whether speed changes in the leg's direction
    From the last row near the first speed to the first row near the last speed, extended while speed goes on changing.
    """
    first, last = (np.abs(V - V[end]) <= HELD * V[end] for end in (0, -1))
    begin = int(np.flatnonzero(first)[-1])
    end = begin + int(np.flatnonzero(last[begin:])[0])
    before = np.flatnonzero(~changing[:begin])
    after = np.flatnonzero(~changing[end + 1 :])
    return slice(before[-1] + 1 if len(before) else 0, end + 1 + (after[0] if len(after) else len(V) - end - 1))


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
                runs.append(maneuver_in(kind, rows, table, motion.V, notes(data, bank)))
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
    if low := too_low(data):
        return low
    if abs(np.nanmean(climb)) > LARGEST_CLIMB_MPS * scale:
        return f"not level: it climbed at {np.nanmean(climb):.1f} m/s on average"
    if np.ptp(data["height_m"].dropna()) > LARGEST_ALTITUDE_CHANGE_M:
        return f"not level: height varied by {np.ptp(data['height_m'].dropna()):.0f} m"
    if np.nanmax(np.abs(bank)) > LARGEST_BANK_RAD:
        return f"in a turn: bank reached {np.degrees(np.nanmax(np.abs(bank))):.0f} deg"
    return without_data(data)
