"""The resolution of a channel, by its values; and values that stand still between its steps, as straight lines."""

import numpy as np

from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.sources.recording import Channel
from flightpower.flight.arrays import Array


def error_of_a_step(step: float) -> float:
    """Standard deviation of an error that is evenly spread over a step."""
    return float(step / np.sqrt(12))


def step_of(values: Array) -> float:
    """The step that divides all differences of values (n,); 0 if there is none, or if no value occurs twice.

    A value that is a multiple of a step is wrong by up to half of it where it is rounded, and always by as much on
    average where it is cut off, as pulses are that were not completed.
    """
    finite = values[np.isfinite(values)]
    levels = np.unique(finite)
    if not STATISTICS.fewest_values * len(levels) < len(finite) or len(levels) < STATISTICS.fewest_readings:
        return 0.0
    apart = np.diff(levels)
    apart = apart[apart > np.sqrt(np.finfo(float).eps) * (levels[-1] - levels[0])]  # beyond rounding
    steps = np.round(apart / apart.min())
    step = float(apart.sum() / steps.sum())
    off = np.abs(apart / step - steps) > error_of_a_step(0.5)
    return step if np.mean(off) < STATISTICS.unmentioned_share else 0.0


def without_steps(channel: Channel) -> Channel:
    """Replaces steps by straight lines through their middles, at the same times.

    A pressure that moves by steps of 26 Pa, four meters, has no slope between them and an impossible one at each. Where
    it changes, its value is the middle of the two; where it turns around on a level, that level is reached halfway in
    time. A channel that changes at every second sample or more, as by its noise, is returned as it is.
    """
    changed = np.flatnonzero(np.diff(channel.value))
    if not 0 < len(changed) < len(channel.value) / 2:
        return channel
    t_s, value = ((x[changed] + x[changed + 1]) / 2 for x in (channel.t_s, channel.value))
    turns = np.flatnonzero(value[1:] == value[:-1])
    corners_s = np.r_[channel.t_s[0], t_s, channel.t_s[-1], (t_s[turns] + t_s[turns + 1]) / 2]
    corners = np.r_[channel.value[0], value, channel.value[-1], channel.value[changed[turns] + 1]]
    order = np.argsort(corners_s)
    return Channel(channel.t_s, np.interp(channel.t_s, corners_s[order], corners[order]))
