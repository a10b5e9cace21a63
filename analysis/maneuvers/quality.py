"""Quality of a maneuver's data: reasons to reject it, and notes for the reader of the results."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.signals.aircraft_size import least_height_m
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
