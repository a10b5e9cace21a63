"""The slow flow: what the past foretells.

An error of a sensor stands beside these and nothing quicker: what answers to a gust would take the gust for the error.
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from analysis.signals.stretches import stretches

Array = NDArray[np.float64]

SLOW_S = 3.0  # over which speed and bank change slowly enough to be foreseen
SLOPE_S = 1.0  # over which their slopes do
MEMORY = range(2, 8)  # blocks in which a movement of the stick shows that is still to come


def parabola(values: Array, over: Array, flying: NDArray[np.bool_]) -> Array:
    """`values` as a parabola over another quantity; 0 on the ground."""
    seen = flying & np.isfinite(values)
    if seen.sum() < 3 or np.ptp(over[seen]) == 0:
        return np.zeros(len(values))
    return np.where(flying, np.polyval(np.polyfit(over[seen], values[seen], 2), over), 0.0)


def foreseen(values: Array, flying: NDArray[np.bool_], step_s: float, over_s: float = SLOW_S) -> tuple[Array, Array]:
    """What a straight line over so long before leads one to expect, and its slope; 0 on the ground.

    Of the past only: a gust changes what comes after it, and what is foreseen must not know of it.
    """
    window = round(over_s / step_s)
    # Blocks before the one foreseen, newest first.
    line = np.linalg.pinv(np.column_stack([np.ones(window), -step_s * np.arange(1.0, window + 1)]))
    ahead = np.zeros((2, len(values)))
    for rows in stretches(flying):
        known = pd.Series(values[rows]).interpolate(limit_direction="both").to_numpy()
        before = np.concatenate([np.full(window, known[0]), known[:-1]])  # at first nothing has changed yet
        for found, weights in zip(ahead, line, strict=True):
            found[rows] = np.convolve(before, weights, mode="valid")
    return ahead[0], ahead[1]


def foretold(now: Array, past: Array, stays: Array, flying: NDArray[np.bool_]) -> Array:
    """`now` (n, m) as far as it is a combination of what is known of the `past` (n, k); 0 on the ground.

    stays : (n-1,) what is left of a gust one step later. The combination is that of least squares of what is *new* in
    both beside a gust: so much of `now` a smoother sees that takes gusts for noise, and no more.
    """
    both = flying[1:] & flying[:-1]
    new_now, new_past = (values[1:][both] - stays[both, None] * values[:-1][both] for values in (now, past))
    return np.where(flying[:, None], past @ np.linalg.lstsq(new_past, new_now, rcond=None)[0], 0.0)


def before(values: Array, flying: NDArray[np.bool_]) -> Array:
    """`values` of MEMORY blocks before, (n, ·), newest first; 0 where the aircraft did not fly then.

    The last block is left out: means of neighbouring blocks share what is new in a gust between their middles.
    """
    flown = np.where(flying, values, 0.0)
    return np.column_stack([np.concatenate([np.zeros(lag), flown[:-lag]]) for lag in MEMORY])


def slope(values: Array, flying: NDArray[np.bool_], step_s: float) -> Array:
    """Derivative by a local quadratic over SLOW_S; 0 on the ground and in stretches shorter than that."""
    window = 2 * round(SLOW_S / step_s / 2) + 1
    slope = np.zeros(len(values))
    for rows in stretches(flying):
        if rows.stop - rows.start >= window:
            slope[rows] = savgol_filter(values[rows], window, 2, deriv=1, delta=step_s)
    return slope
