"""Single fields of a log, as they were recorded: times and values of the good messages."""

import numpy as np
from numpy.typing import NDArray

from flight.log_reader import Log
from flight.messages import Status

Array = NDArray[np.float64]


def field_of(log: Log, topic: str, field: str) -> tuple[Array, Array]:
    """Times since the first good message [s] and values of a topic's field, both (n,); empty if there are none."""
    good = [
        (entry.time_ns, value)
        for entry in log.entries.get(topic, [])
        if entry.message.status is Status.OK and (value := getattr(entry.message, field)) is not None
    ]
    start_ns = good[0][0] if good else 0
    t_s = np.array([(time_ns - start_ns) / 1e9 for time_ns, _ in good], dtype=float)
    return t_s, np.array([value for _, value in good], dtype=float)


def servo_pulses(log: Log, output: int) -> tuple[Array, Array]:
    """Times since the first pulse [s] and pulses [us] of a servo output, counted from 1; both (n,), or empty."""
    t_s, pulses = [], []
    for entry in log.entries.get("/controls", []):
        pulse_us = getattr(entry.message, "pulse_us", None)
        if pulse_us is not None and len(pulse_us) >= output:
            t_s.append(entry.time_ns / 1e9)
            pulses.append(pulse_us[output - 1])
    return np.array(t_s) - (t_s[0] if t_s else 0.0), np.array(pulses, dtype=float)
