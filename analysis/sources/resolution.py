"""Values that stand still between steps of their resolution, as straight lines."""

import numpy as np

from analysis.sources.recording import Channel


def without_steps(one: Channel) -> Channel:
    """The same quantity by straight lines through the middles of its steps, at the same times.

    A pressure that moves by steps of 26 Pa, four meters, has no slope between them and an impossible one at each. Where
    it changes, its value is the middle of the two; where it turns around on a level, that level is reached halfway in
    time. A channel that changes at every second sample or more, as by its noise, is returned as it is.
    """
    changed = np.flatnonzero(np.diff(one.value))
    if not 0 < len(changed) < len(one.value) / 2:
        return one
    t_s, value = ((x[changed] + x[changed + 1]) / 2 for x in (one.t_s, one.value))
    turns = np.flatnonzero(value[1:] == value[:-1])
    corners_s = np.r_[one.t_s[0], t_s, one.t_s[-1], (t_s[turns] + t_s[turns + 1]) / 2]
    corners = np.r_[one.value[0], value, one.value[-1], one.value[changed[turns] + 1]]
    order = np.argsort(corners_s)
    return Channel(one.t_s, np.interp(one.t_s, corners_s[order], corners[order]))
