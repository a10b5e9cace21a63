"""Motion of the rigid aircraft: specific force at its centre of gravity, and bank angle."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flight.aircraft import Aircraft
from flight.motion import specific_force_at
from flight.units import GRAVITY_MPS2

Array = NDArray[np.float64]
TIME_CONSTANT_S = 3.0  # slower changes come from the lateral balance, faster ones from the roll rate
DERIVATIVE_S = 0.5  # of the mean that is differentiated


def specific_force_at_cg(table: pd.DataFrame, aircraft: Aircraft) -> pd.DataFrame:
    """The table with the specific force at the IMU replaced by that at the centre of gravity."""
    x, y, z = aircraft.imu_position_m
    p, q, r = (table[f"{axis}_radps"].to_numpy() for axis in "pqr")
    step_s = float(table.index[1] - table.index[0])
    pdot, qdot, rdot = (derivative(rate, step_s) for rate in (p, q, r))
    zero = np.zeros_like(p)
    extra = specific_force_at(zero, zero, zero, p, q, r, pdot, qdot, rdot, (x, y, z))
    names = ("ax_mps2", "ay_mps2", "az_mps2")
    return table.assign(**{name: table[name] - more for name, more in zip(names, extra, strict=True)})


def derivative(signal: Array, step_s: float) -> Array:
    """Central difference of the mean over DERIVATIVE_S of a uniformly sampled signal, (n,) [1/s times its unit]."""
    window = max(1, round(DERIVATIVE_S / step_s))
    smooth = pd.Series(signal).rolling(window, center=True, min_periods=1).mean().to_numpy()
    return np.asarray(np.gradient(smooth, step_s), dtype=float)


def bank_angle(table: pd.DataFrame) -> Array:
    """Bank angle in nearly straight flight [rad], (n,), positive with the right wing down.

    table: air data at the centre of gravity with V_mps, alpha_rad, beta_rad, p_radps, r_radps, ay_mps2.
    (3.7) solved for phi with v = V sin(beta) and cos(theta) = 1: g sin(phi) = vdot - p w + r u - ay. The accelerometer
    alone would not show the vertical in a turn. In gaps the angle returns to zero.
    """
    step_s = float(table.index[1] - table.index[0])
    V, alpha, beta = (table[c].to_numpy() for c in ("V_mps", "alpha_rad", "beta_rad"))
    p, r, ay = (table[c].to_numpy() for c in ("p_radps", "r_radps", "ay_mps2"))
    v = V * np.sin(np.nan_to_num(beta))  # unknown sideslip is taken as zero
    balance = (derivative(v, step_s) - p * V * np.sin(alpha) + r * V * np.cos(alpha) - ay) / GRAVITY_MPS2
    slow = np.arcsin(np.clip(np.nan_to_num(balance), -1, 1))
    return _complementary(slow, np.nan_to_num(p), step_s)


def _complementary(slow: Array, rate: Array, step_s: float) -> Array:
    """Low-passed `slow` plus high-passed integral of `rate`. Run forward and backward and averaged: no lag."""
    keep = np.exp(-step_s / TIME_CONSTANT_S)

    def one_way(angle: Array, rate: Array) -> Array:
        out = np.empty_like(angle)
        state = float(np.mean(angle[: max(1, round(TIME_CONSTANT_S / step_s))]))
        for i, (a, w) in enumerate(zip(angle, rate, strict=True)):
            state = keep * (state + w * step_s) + (1 - keep) * a
            out[i] = state
        return out

    return (one_way(slow, rate) + one_way(slow[::-1], -rate[::-1])[::-1]) / 2
