"""Air data as they would be if a transducer had more hysteresis."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.float64]

SMOOTHING_S = 1.0  # noise of the electronics does not move the membrane
CHANNELS = ("q_c_Pa", "dp_alpha_Pa")


def with_hysteresis(air: pd.DataFrame, channel: str, fraction: float) -> pd.DataFrame:
    """Air data (`air_data`) with hysteresis of one of CHANNELS, to first order.

    fraction : width over the range of the flight. Pressure lags by half the width in the direction it came from
    (play operator). Angle of attack is proportional to its pressure over dynamic pressure.
    """
    flying = air["V_mps"].notna()
    step_s = float(air.index[1] - air.index[0])
    window = max(1, round(SMOOTHING_S / step_s))
    smooth = air[channel].interpolate(limit_direction="both").rolling(window, center=True, min_periods=1).mean()
    change_Pa = play(smooth.to_numpy(), fraction * float(np.ptp(smooth[flying]))) - smooth.to_numpy()
    q_c = air["q_c_Pa"].rolling(window, center=True, min_periods=1).mean().where(flying)
    relative = change_Pa / q_c
    if channel == "q_c_Pa":
        V, alpha = air["V_mps"] * (1 + relative / 2), air["alpha_rad"] * (1 - relative)
        return air.assign(V_mps=V, qbar_Pa=air["qbar_Pa"] * (1 + relative), alpha_rad=alpha)
    known = flying & air["alpha_rad"].notna() & q_c.notna()
    slope, _ = np.polyfit((air["dp_alpha_Pa"] / q_c)[known], air["alpha_rad"][known], 1)
    return air.assign(alpha_rad=air["alpha_rad"] + slope * relative)


def play(x: Array, width: float) -> Array:
    """The play operator over x (n,): its output follows half the width behind."""
    y, held = np.empty_like(x), float(x[0])
    for i, value in enumerate(x.tolist()):
        held = min(max(held, value - width / 2), value + width / 2)
        y[i] = held
    return y
