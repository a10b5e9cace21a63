"""A flight's speed as legs, up and down in turn: what a run is part of, gusts or none.

In gusts the slope of speed changes its sign every few seconds within a run. A leg goes on through that, until speed has
come back by a good part of what the leg gained.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A leg is over when speed has come back by both of these: a share of itself, within which who holds it stays and
# gusts of W20 = 15 kt mostly do; and a share of what the leg has gained.
OF_SPEED, OF_GAIN = 0.12, 0.25
HELD = 0.05  # nearer than this to its first or last speed, by a share of that, a leg is still or already holding it


def turning_points(V: Array) -> list[int]:
    """Where legs begin and end: highest and lowest speeds in turn, the last one where the record ends its last leg.

    V : (n,) finite speeds [m/s]. Empty where speed never changes by OF_SPEED.
    """
    points: list[int] = []
    way, low, high = 0, 0, 0
    for i, v in enumerate(V):
        high = i if v > V[high] else high
        low = i if v < V[low] else low
        furthest = high if way > 0 else low
        if way == 0 and V[high] - V[low] > OF_SPEED * V[high]:
            way = 1 if high > low else -1
            points.append(low if way > 0 else high)
        elif way and abs(V[furthest] - v) > max(OF_SPEED * V[furthest], OF_GAIN * abs(V[furthest] - V[points[-1]])):
            points.append(furthest)
            way, low, high = -way, i, i
    if way:
        points.append(high if way > 0 else low)
    return points


def on_the_way(V: Array, changing: NDArray[np.bool_]) -> slice:
    """The rows of a leg in which it is under way: neither still nor already holding.

    V : (n,) speeds from one turning point to the next     changing : (n,) whether speed changes, the leg's way
    From the last row near its first speed to the first near its last one, and as far beyond as speed goes on changing.
    """
    first, last = (np.abs(V - V[end]) <= HELD * V[end] for end in (0, -1))
    begin = int(np.flatnonzero(first)[-1])
    end = begin + int(np.flatnonzero(last[begin:])[0])
    still = np.flatnonzero(~changing[:begin])
    after = np.flatnonzero(~changing[end + 1 :])
    return slice(still[-1] + 1 if len(still) else 0, end + 1 + (after[0] if len(after) else len(V) - end - 1))
