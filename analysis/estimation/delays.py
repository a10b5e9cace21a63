"""Inputs that act late: their values at t - delay, and the slopes by which a delay can be estimated."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def delayed(signal: Array, step_s: float, delay_s: float) -> tuple[Array, Array]:
    """(n,) the signal `delay_s` earlier, and its time derivative there.

    Between samples it is a monotone cubic, whose slope has no jumps; before the first sample the signal is constant.
    """
    from scipy.interpolate import PchipInterpolator  # takes 0.15 s to import

    t = np.arange(len(signal)) * step_s
    at = np.clip(t - delay_s, t[0], t[-1])
    cubic = PchipInterpolator(t, signal)
    inside = at == t - delay_s
    return np.asarray(cubic(at)), np.where(inside, cubic(at, 1), 0.0)
