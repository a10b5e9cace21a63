"""Gaps in a signal, filled by linear interpolation."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def without_gaps(values: Array) -> Array:
    """Values (n,) with NaN interpolated linearly, and constant before the first and after the last known value.

    All NaN if none is known. The numbers are those of `pandas.Series.interpolate(limit_direction="both")`.
    """
    known = ~np.isnan(values)
    if known.all() or not known.any():
        return values
    at = np.arange(len(values))
    return np.interp(at, at[known], values[known])
