"""Smoothed motion, and the quality of a maneuver's data: reasons to reject it, and notes for the reader."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.maneuvers.settings import NOTED, STEPS
from flightpower.analysis.settings import FLOWN
from flightpower.analysis.sources.daemon import speed_scale_of
from flightpower.analysis.sources.grid import local_quadratic, stretches
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.flight import runs
from flightpower.flight.arrays import Array
from flightpower.flight.runs import Rejection, missing_data
from flightpower.flight.units import GRAVITY_MPS2

NEEDED_COLUMNS = ("V_mps", "alpha_rad", "ax_mps2", "az_mps2", "q_radps", "thrust_N", "rho")


def too_low(data: pd.DataFrame) -> Rejection | None:
    """The rejection of a stretch that is too near the ground, or whose height is not known; None if neither."""
    height = data["height_m"].dropna()
    return runs.too_low(float(height.min()) if len(height) else np.nan, speed_scale_of(data))


def without_data(data: pd.DataFrame) -> Rejection | None:
    """The rejection of a stretch in which a needed channel is missing too long; None if none is."""
    return missing_data(*missing_share(data))


def missing_share(data: pd.DataFrame) -> tuple[str, float]:
    """The first needed quantity missing for longer than allowed, or else the first of all, and its missing fraction."""
    missing = data[list(NEEDED_COLUMNS)].isna().to_numpy().mean(axis=0).tolist()
    shares = [(quantity(name), share) for name, share in zip(NEEDED_COLUMNS, missing, strict=True)]
    return next((share for share in shares if missing_data(*share)), shares[0])


def notes(data: pd.DataFrame, bank: Array) -> tuple[str, ...]:
    """Remarks of a few words for the reader on a maneuver that is used. bank: (n,) [rad]."""
    remarks = []
    uncovered = 1 - float(data["propeller_covered"].mean())
    if uncovered > STATISTICS.unmentioned_share:
        remarks.append(
            f"{100 * uncovered:.0f} % of the data lie outside the propeller table, which is extrapolated there"
        )
    height = data["height_m"].dropna()
    if len(height) and np.ptp(height) > NOTED.height_m:
        remarks.append(f"height varied by {np.ptp(height):.0f} m")
    if np.nanmax(np.abs(bank)) > FLOWN.level_rad:
        remarks.append(f"bank reached {np.degrees(np.nanmax(np.abs(bank))):.0f} deg")
    step, (noted_step, period_s) = throttle_step(data), NOTED.throttle_step
    if step > noted_step:
        remarks.append(f"throttle moved by {100 * step:.0f} % within {period_s:g} s: a step pitches the aircraft")
    rms = load_factor_rms(data)
    light, rough = NOTED.turbulence
    if rms > light:
        word = "rough" if rms > rough else "light"
        remarks.append(f"{word} turbulence: the load factor varies by {rms:.2f} rms")
    for name in NEEDED_COLUMNS:
        missing = float(data[name].isna().mean())
        if missing > STATISTICS.unmentioned_gaps:
            remarks.append(
                f"{quantity(name)} was stale or missing for {100 * missing:.1f} % of the time and is interpolated there"
            )
    return tuple(remarks)


def load_factor_rms(data: pd.DataFrame) -> float:
    """Rms of the load factor about its two-second mean [-]: a measure of turbulence."""
    step_s = float(data.index[1] - data.index[0])
    n = data["az_mps2"] / GRAVITY_MPS2
    slow = n.rolling(max(3, round(STEPS.response_s / step_s)), center=True, min_periods=1).mean()
    return float((n - slow).std())


def throttle_step(data: pd.DataFrame) -> float:
    """Largest change of throttle within the time of NOTED.throttle_step [-]; zero if throttle is not known."""
    if "throttle" not in data or not data["throttle"].notna().any():
        return 0.0
    step_s = float(data.index[1] - data.index[0])
    change = data["throttle"].diff(max(1, round(NOTED.throttle_step[1] / step_s))).abs().max()
    return float(change) if np.isfinite(change) else 0.0


def quantity(column: str) -> str:
    """A column's name without its unit: "thrust" for "thrust_N"."""
    return column.rpartition("_")[0] or column


class SmoothedMotion(NamedTuple):
    """Arrays (n,), one value per row of the table. Where nothing was measured, V and climb are NaN and Vdot is zero."""

    V: Array  # [m/s]
    Vdot: Array  # [m/s^2]
    climb: Array  # [m/s]
    bank: Array  # [rad]
    step_s: float


def smooth(table: pd.DataFrame, over_s: float) -> SmoothedMotion:
    """Speed and height fitted by a local quadratic over `over_s` seconds. table: from `air_data`."""
    step_s = float(table.index[1] - table.index[0])
    window = 2 * round(over_s / step_s / 2) + 1
    V = np.full(len(table), np.nan)
    Vdot, climb = V.copy(), V.copy()
    raw_V, raw_h = table["V_mps"].to_numpy(), table["height_m"].to_numpy()
    for rows in stretches(np.isfinite(raw_V) & np.isfinite(raw_h)):
        if rows.stop - rows.start >= window:
            V[rows] = local_quadratic(raw_V[rows], window)
            Vdot[rows] = local_quadratic(raw_V[rows], window, 1, step_s)
            climb[rows] = local_quadratic(raw_h[rows], window, 1, step_s)
    return SmoothedMotion(V, np.nan_to_num(Vdot), climb, table["bank_rad"].to_numpy(), step_s)


def load_factor(table: pd.DataFrame, over_s: float) -> Array:
    """Upward specific force over gravity [-], (n,), mean over `over_s` seconds; 1 in level flight."""
    step_s = float(table.index[1] - table.index[0])
    window = max(1, round(over_s / step_s))
    return (-table["az_mps2"] / GRAVITY_MPS2).rolling(window, center=True, min_periods=1).mean().to_numpy()
