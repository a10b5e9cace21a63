"""Finds the resolution of a channel from its values, and replaces its steps by straight lines."""

import numpy as np

from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.sources.recording import Channel
from flightpower.flight.arrays import Array


def error_of_a_step(step: float) -> float:
    """Return the standard deviation of an error that is evenly distributed over a step."""
    return float(step / np.sqrt(12))


def step_of(values: Array) -> float:
    """Return the step that divides nearly all differences of values (n,); 0 if there is none, or values hardly repeat.

    A value that is rounded to a multiple of a step is wrong by up to half a step. A value that is truncated, such as a
    count of completed pulses, is half a step too small on average.
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
    """Replace steps by straight lines through their midpoints, at the same times.

    A pressure with steps of 26 Pa, four meters at 5 km, has no slope between steps and an impossible slope at each. At
    a step the new value is midway between the two levels. Where the channel turns around on a level, it reaches that
    level halfway in time. A channel that changes at every second sample or more often, as noise does, stays unchanged.
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
