"""Air data as they would be if a differential pressure transducer had more hysteresis, or a zero that changes."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.float64]

SMOOTHING_S = 1.0  # noise of the electronics does not move the membrane
CHANNELS = ("q_c_Pa", "dp_alpha_Pa")


def with_hysteresis(air: pd.DataFrame, channel: str, fraction: float) -> pd.DataFrame:
    """Air data (`air_data`) with hysteresis of one of CHANNELS, to first order.

    fraction : width over the range of the flight. Pressure lags by half the width in the direction it came from
    (play operator).
    """
    smooth = _smooth(air[channel].interpolate(limit_direction="both"), air)
    width = fraction * float(np.ptp(smooth[air["V_mps"].notna()]))
    return _with_change(air, channel, play(smooth.to_numpy(), width) - smooth.to_numpy())


def with_zero_step(air: pd.DataFrame, channel: str, step_Pa: float) -> pd.DataFrame:
    """Air data (`air_data`) with a step of the zero of one of CHANNELS [Pa] in the middle of the flight, to first
    order: half of it too low before, half of it too high after."""
    flying = air.index[air["V_mps"].notna()]
    later = air.index.to_numpy() > (flying[0] + flying[-1]) / 2
    return _with_change(air, channel, np.where(later, step_Pa / 2, -step_Pa / 2))


def _smooth(pressure: pd.Series, air: pd.DataFrame) -> pd.Series:
    window = max(1, round(SMOOTHING_S / float(air.index[1] - air.index[0])))
    return pressure.rolling(window, center=True, min_periods=1).mean()


def _with_change(air: pd.DataFrame, channel: str, change_Pa: Array) -> pd.DataFrame:
    """Air data with a change (n,) of a pressure. Angle of attack is proportional to its pressure over dynamic
    pressure."""
    flying = air["V_mps"].notna()
    q_c = _smooth(air["q_c_Pa"], air).where(flying)
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
