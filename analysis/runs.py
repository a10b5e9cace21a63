"""Finds accelerations and decelerations in the data, and says why a stretch that looked like one is not."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from analysis.airdata.air import LOW_M, bank_rad
from analysis.stillness import stretches

Array = NDArray[np.float64]

SMOOTHING_S = 2.2  # the slope of speed with 0.3 m/s noise (Table 4.1) is then good to 0.06 m/s^2
CHANGING_MPS2 = 0.15  # a run lasts while speed changes faster than this …
CLEARLY_CHANGING_MPS2 = 0.5  # … and somewhere as fast as this
SHORTEST_S, LONGEST_S = 5.0, 40.0  # as seen through the smoothing, which widens a run by about its window
SMALLEST_SPEED_CHANGE = 0.2  # of the mean speed
LARGEST_ALTITUDE_CHANGE_M = 20.0
LARGEST_CLIMB_MPS = 1.2  # mean: what a ground pilot holds; take-off and approach are steeper
LARGEST_BANK_RAD = np.radians(25)
NEEDED = ("V_mps", "alpha_rad", "ax_mps2", "az_mps2", "q_radps", "thrust_N", "rho")
LARGEST_GAP_SHARE = 0.02


@dataclass(frozen=True)
class Run:
    """One stretch of nearly level flight in which speed rises or falls."""

    kind: str  # "acceleration" or "deceleration"
    rows: slice
    start_s: float
    end_s: float
    lowest_speed_mps: float
    highest_speed_mps: float
    altitude_change_m: float
    notes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return f"{self.kind} at {self.start_s:.0f} s"


@dataclass(frozen=True)
class Rejected:
    """A stretch that looked like a run, and why it was not taken."""

    kind: str
    start_s: float
    end_s: float
    reason: str


def find_runs(table: pd.DataFrame) -> tuple[list[Run], list[Rejected]]:
    """Runs in order of time, and the rejected stretches. `table` as `air_data` leaves it."""
    step_s = float(table.index[1] - table.index[0])
    V, Vdot, climb = _smooth(table, step_s)
    flying = table["flying"].to_numpy() & np.isfinite(V)
    bank = bank_rad(table)
    runs: list[Run] = []
    rejected: list[Rejected] = []
    for sign, kind in ((1.0, "acceleration"), (-1.0, "deceleration")):
        changing = flying & (sign * Vdot > CHANGING_MPS2)
        for rows in stretches(changing):
            if np.max(sign * Vdot[rows]) < CLEARLY_CHANGING_MPS2 or rows.stop - rows.start < 1.0 / step_s:
                continue
            start_s, end_s = float(table.index[rows.start]), float(table.index[rows.stop - 1])
            reason = _why_not(table.iloc[rows], V[rows], climb[rows], bank[rows], end_s - start_s)
            if reason:
                rejected.append(Rejected(kind, start_s, end_s, reason))
                continue
            height = table["height_m"].to_numpy()[rows]
            few = max(1, round(0.4 / step_s))
            change = float(np.nanmean(height[-few:]) - np.nanmean(height[:few]))
            low, high = float(np.nanmin(V[rows])), float(np.nanmax(V[rows]))
            runs.append(Run(kind, rows, start_s, end_s, low, high, change, _notes(table.iloc[rows], bank[rows])))
    return sorted(runs, key=lambda run: run.start_s), sorted(rejected, key=lambda run: run.start_s)


def _smooth(table: pd.DataFrame, step_s: float) -> tuple[Array, Array, Array]:
    """Speed [m/s], its derivative [m/s^2] and the climb rate [m/s], each by a local quadratic."""
    window = 2 * round(SMOOTHING_S / step_s / 2) + 1
    V = np.full(len(table), np.nan)
    Vdot, climb = V.copy(), V.copy()
    raw_V, raw_h = table["V_mps"].to_numpy(), table["height_m"].to_numpy()
    for rows in stretches(np.isfinite(raw_V) & np.isfinite(raw_h)):
        if rows.stop - rows.start >= window:
            V[rows] = savgol_filter(raw_V[rows], window, 2)
            Vdot[rows] = savgol_filter(raw_V[rows], window, 2, deriv=1, delta=step_s)
            climb[rows] = savgol_filter(raw_h[rows], window, 2, deriv=1, delta=step_s)
    return V, np.nan_to_num(Vdot), climb


def _why_not(data: pd.DataFrame, V: Array, climb: Array, bank: Array, seconds: float) -> str:
    """Why a stretch is no run; empty if it is one."""
    if seconds < SHORTEST_S:
        return f"too short: {seconds:.1f} s, {SHORTEST_S:.0f} s are needed"
    if seconds > LONGEST_S:
        return f"too long: {seconds:.0f} s"
    share = float(np.ptp(V) / np.mean(V))
    if share < SMALLEST_SPEED_CHANGE:
        return f"speed changed by only {100 * share:.0f} % of its mean, {100 * SMALLEST_SPEED_CHANGE:.0f} % are needed"
    if np.nanmin(data["height_m"]) < LOW_M:
        return f"too low: down to {np.nanmin(data['height_m']):.0f} m above the ground, {LOW_M:.0f} m are needed"
    if abs(np.nanmean(climb)) > LARGEST_CLIMB_MPS:
        return f"not level: it climbed at {np.nanmean(climb):.1f} m/s on average"
    if np.ptp(data["height_m"].dropna()) > LARGEST_ALTITUDE_CHANGE_M:
        return f"not level: height varied by {np.ptp(data['height_m'].dropna()):.0f} m"
    if np.nanmax(np.abs(bank)) > LARGEST_BANK_RAD:
        return f"in a turn: bank reached {np.degrees(np.nanmax(np.abs(bank))):.0f} deg"
    for name in NEEDED:
        missing = float(data[name].isna().mean())
        if missing > LARGEST_GAP_SHARE:
            return f"no {name.rpartition('_')[0] or name} for {100 * missing:.0f} % of the time"
    return ""


def _notes(data: pd.DataFrame, bank: Array) -> tuple[str, ...]:
    notes = []
    uncovered = 1 - float(data["propeller_covered"].mean())
    if uncovered > 0.02:
        notes.append(f"the propeller table does not reach {100 * uncovered:.0f} % of the run; it is continued there")
    if np.nanmax(np.abs(bank)) > np.radians(10):
        notes.append(f"bank reached {np.degrees(np.nanmax(np.abs(bank))):.0f} deg")
    return tuple(notes)
