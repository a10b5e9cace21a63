"""Finds where the aircraft stood still, and what its sensors read there: zeros that need no ground crew."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

WINDOW_S = 1.0
SHORTEST_S = 4.0
# Standing with the motor off. Bench noise is 0.005 rad/s and 0.06 m/s^2 (Table 4.1); gusts on the ground shake more.
RATE_SPREAD_RADPS = 0.03
FORCE_SPREAD_MPS2 = 0.5
MOTOR_REVPS = 1.0
AIRSPEED_SPREAD_PA = 8.0
CHANNELS = ("p_radps", "q_radps", "r_radps", "dp_alpha_Pa", "dp_beta_Pa", "q_c_Pa")


class Zeros(NamedTuple):
    """Mean reading of each of CHANNELS at rest, its standard error, and how far it drifted from first to last."""

    value: dict[str, float]
    standard_error: dict[str, float]
    drift: dict[str, float]
    seconds: float  # of standing still in all


def still_segments(table: pd.DataFrame, rate_Hz: float) -> list[slice]:
    """Stretches (as row slices) in which the aircraft stood with its motor off, each SHORTEST_S at least."""
    window = max(3, round(WINDOW_S * rate_Hz))
    spread = table.rolling(window, center=True, min_periods=window // 2).std()
    still = (table["n_revps"].fillna(0) < MOTOR_REVPS) & (spread["q_c_Pa"] < AIRSPEED_SPREAD_PA)
    for name in ("p_radps", "q_radps", "r_radps"):
        still &= spread[name] < RATE_SPREAD_RADPS
    for name in ("ax_mps2", "ay_mps2", "az_mps2"):
        still &= spread[name] < FORCE_SPREAD_MPS2
    margin = window // 2  # the window has already seen what comes next
    found = [slice(s.start + margin, s.stop - margin) for s in stretches(still.to_numpy())]
    return [s for s in found if s.stop - s.start >= SHORTEST_S * rate_Hz]


def zeros(table: pd.DataFrame, still: list[slice]) -> Zeros | None:
    """What the sensors read at rest; None if the log has no rest in it."""
    if not still:
        return None
    rest = pd.concat([table.iloc[s] for s in still])
    first, last = table.iloc[still[0]], table.iloc[still[-1]]
    value, error, drift = {}, {}, {}
    for name in CHANNELS:
        samples = rest[name].dropna()
        value[name] = float(samples.mean()) if len(samples) else 0.0
        error[name] = float(samples.std() / np.sqrt(len(samples))) if len(samples) > 1 else float("nan")
        drift[name] = float(last[name].mean() - first[name].mean())
    return Zeros(value, error, drift, len(rest) * float(table.index[1] - table.index[0]))


def stretches(flag: NDArray[np.bool_]) -> list[slice]:
    """The runs of True in a boolean array, as slices."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(np.int8)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
