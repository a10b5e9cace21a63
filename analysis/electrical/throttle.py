"""What the autopilot's throttle says of the power that was measured: whether the meter follows it, and when it is off.

Power off is a glide: its power is that of the avionics, whatever the meter shows, so that drag alone balances the
change of energy there, without the efficiency of motor and propeller.
"""

from collections.abc import Mapping
from enum import StrEnum

import numpy as np
import pandas as pd

from analysis.autopilot_logs import recording
from analysis.signals.settings import FLIGHT
from flight.arrays import Array, BoolArray


class Meter(StrEnum):
    """How the measured power goes with the throttle."""

    FOLLOWS = "power follows the throttle"
    CONTRADICTS = "power varies, but not with the throttle"
    STANDS = "power hardly varies while the throttle does"
    UNCHECKED = "no throttle that varies is in the log"


def meter(columns: Mapping[str, Array], moving: BoolArray) -> Meter:
    """Of power and throttle (n,) in flight. A propulsion takes at least as its throttle rises, relative to its mean,
    whatever the airspeed; a channel of throttle that power contradicts is another's, or was not in control.
    """
    throttle, power = columns[recording.THROTTLE], columns["power_W"]
    known = moving & np.isfinite(throttle + power)
    if not known.any():
        return Meter.UNCHECKED
    throttle, power = throttle[known], power[known]
    if np.std(throttle) <= 0.1 * np.mean(throttle):  # what varies power then is the airspeed
        return Meter.UNCHECKED
    # More than half of the variance: 0.7 to 0.97 in simulated flights and in SITL.
    if np.std(power) > 0 and np.corrcoef(throttle, power)[0, 1] > np.sqrt(0.5):
        return Meter.FOLLOWS
    least = np.std(throttle) / np.mean(throttle) / 2  # half: of a motor that never idles
    return Meter.STANDS if np.std(power) < least * np.mean(power) else Meter.CONTRADICTS


def power_off(throttle: Array) -> BoolArray:
    """Rows (n,) in which the throttle is closed, within half the percent that telemetry counts in, and has been for so
    long that the motor no longer drives.
    """
    closed = pd.Series(np.where(np.isfinite(throttle), np.abs(throttle) < 0.005, False).astype(float))
    return np.asarray(closed.rolling(round(FLIGHT.smoothing_s / FLIGHT.step_s), min_periods=1).min() == 1)
