"""Means over blocks of samples: five a second are enough for a path."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCK = 5


def block_mean(series: pd.Series, n: int) -> Array:
    """Means over blocks of BLOCK samples; NaN where more than half of a block is missing."""
    blocks = series.to_numpy(dtype=float)[: n * BLOCK].reshape(n, BLOCK)
    present = np.isfinite(blocks)
    count = present.sum(axis=1)
    total = np.where(present, blocks, 0.0).sum(axis=1)
    return np.where(count > BLOCK // 2, total / np.maximum(count, 1), np.nan)


def smoothed(values: Array, width: int) -> Array:
    """Means over `width` blocks, gaps bridged."""
    series = pd.Series(values).interpolate(limit_direction="both")
    return series.rolling(width, center=True, min_periods=1).mean().to_numpy()
