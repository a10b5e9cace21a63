"""Which of several instances of a sensor measures."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from analysis.autopilot_logs.recording import Channel

TURNING_REVPS = 5.0
SECOND_SHARE = 0.1  # of the used battery's power; a second one with more is mentioned


class Battery(NamedTuple):
    name: str
    voltage: Channel
    current: Channel


def measuring_battery(batteries: Sequence[Battery]) -> tuple[Battery | None, list[str]]:
    """The battery that gives most power, and notes; None where none measures voltage and current."""
    power = [_mean_power_W(battery) for battery in batteries]
    if not any(P > 0 for P in power):
        return None, []
    best = int(np.argmax(power))
    notes = []
    if best > 0:
        notes.append(f"{batteries[best].name} measures the propulsion: {batteries[0].name} carries less power.")
    for i, P in enumerate(power):
        if i != best and P > SECOND_SHARE * power[best]:
            notes.append(
                f"{batteries[i].name} carries {100 * P / power[best]:.0f} % of the power of {batteries[best].name} and"
                " is not counted: where both feed the motor, the electrical power is too small."
            )
    return batteries[best], notes


def turning_motor(motors: Sequence[Channel]) -> tuple[Channel | None, list[str]]:
    """The speed of the one motor that turns, and a note where several do."""
    turning = [one for one in motors if len(one.value) and float(np.percentile(one.value, 90)) > TURNING_REVPS]
    if len(turning) > 1:
        return None, [f"{len(turning)} motors turn in this log; motor speed is used of a single one only."]
    return (turning[0], []) if turning else (None, [])


def most_varying(channels: Sequence[Channel]) -> Channel | None:
    """The channel that varies most: of several airspeed sensors, the one that is connected."""
    varying = [one for one in channels if len(one.value) and np.ptp(one.value) > 0]
    return max(varying, key=lambda one: float(np.std(one.value)), default=None)


def _mean_power_W(battery: Battery) -> float:
    if not len(battery.voltage.t_s) or not len(battery.current.t_s):
        return 0.0
    voltage = np.interp(battery.current.t_s, *battery.voltage)
    return float(np.mean(voltage * np.maximum(battery.current.value, 0.0)))
