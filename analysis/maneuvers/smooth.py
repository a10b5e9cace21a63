"""Smoothed speed, acceleration, climb rate and load factor, for finding maneuvers."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.signals.smoothing import local_quadratic, stretches
from flight.units import GRAVITY_MPS2

Array = NDArray[np.float64]


class SmoothedMotion(NamedTuple):
    """Each (n,), one value per row of the table. Where nothing was measured V and climb are NaN, and Vdot is zero."""

    V: Array  # [m/s]
    Vdot: Array  # [m/s^2]
    climb: Array  # [m/s]
    bank: Array  # [rad]
    step_s: float


def smooth(table: pd.DataFrame, over_s: float) -> SmoothedMotion:
    """Speed and height fitted by a local quadratic over `over_s` seconds. table: of `air_data`."""
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
