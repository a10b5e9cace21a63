"""Resampling and smoothing of one channel."""

import numpy as np
from numpy.typing import NDArray

from analysis.autopilot_logs.recording import Channel

Array = NDArray[np.float64]


def resampled(one: Channel, t_s: Array, window_s: float, longest_gap_s: float) -> Array:
    """Values at t_s (n,): moving average over a Hann window, then linear interpolation; NaN in gaps, beyond the ends.

    A channel slower than half the window is only interpolated, and a gap is at least four of its intervals.
    """
    if len(one.t_s) < 2:
        return np.full(len(t_s), np.nan)
    interval = float(np.median(np.diff(one.t_s)))
    width = round(window_s / interval)
    value = one.value if width < 2 else smoothed(one.value, width)
    after = np.clip(np.searchsorted(one.t_s, t_s), 1, len(one.t_s) - 1)
    bridged = one.t_s[after] - one.t_s[after - 1] <= max(longest_gap_s, 4 * interval)
    within = (t_s >= one.t_s[0]) & (t_s <= one.t_s[-1])
    return np.where(bridged & within, np.interp(t_s, one.t_s, value), np.nan)


def smoothed(value: Array, width: int) -> Array:
    """Centered average (n,) with Hann weights over `width` samples; the ends are repeated beyond them."""
    weights = np.hanning(width + 2)[1:-1]
    padded = np.pad(value, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, weights / weights.sum(), mode="valid")
