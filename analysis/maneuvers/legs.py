"""Divides a speed history into legs of alternately rising and falling speed. A run is part of a leg.

In gusts the slope of speed changes sign every few seconds within a run. A leg continues through that; it ends when
speed has come back by a share of its value and by a share of what the leg gained.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A leg ends when speed has come back by both: a share of the speed (a pilot holding speed stays within it, gusts of
# W20 = 15 kt mostly do), and a share of what the leg has gained.
OF_SPEED, OF_GAIN = 0.12, 0.25
HELD = 0.05  # speed is held while it is within this share of the leg's first or last speed


def turning_points(V: Array) -> list[int]:
    """Indices at which legs begin and end: the highest and lowest speeds in turn; the last one ends the last leg.

    V : (n,) finite speeds [m/s]. Empty if speed never changes by OF_SPEED.
    """
    points: list[int] = []
    direction, low, high = 0, 0, 0
    for i, v in enumerate(V):
        high = i if v > V[high] else high
        low = i if v < V[low] else low
        furthest = high if direction > 0 else low
        if direction == 0 and V[high] - V[low] > OF_SPEED * V[high]:
            direction = 1 if high > low else -1
            points.append(low if direction > 0 else high)
        elif direction and abs(V[furthest] - v) > max(
            OF_SPEED * V[furthest], OF_GAIN * abs(V[furthest] - V[points[-1]])
        ):
            points.append(furthest)
            direction, low, high = -direction, i, i
    if direction:
        points.append(high if direction > 0 else low)
    return points


def changing_part(V: Array, changing: NDArray[np.bool_]) -> slice:
    """The rows of a leg in which speed changes, without those at either end in which it is held.

    V : (n,) speeds from one turning point to the next     changing : (n,) whether speed changes in the leg's direction
    From the last row near the first speed to the first row near the last speed, extended while speed goes on changing.
    """
    first, last = (np.abs(V - V[end]) <= HELD * V[end] for end in (0, -1))
    begin = int(np.flatnonzero(first)[-1])
    end = begin + int(np.flatnonzero(last[begin:])[0])
    before = np.flatnonzero(~changing[:begin])
    after = np.flatnonzero(~changing[end + 1 :])
    return slice(before[-1] + 1 if len(before) else 0, end + 1 + (after[0] if len(after) else len(V) - end - 1))
