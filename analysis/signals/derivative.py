"""Time derivative of a noisy signal."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

SMOOTHING_S = 0.5


def derivative(signal: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
    """Central difference of the half-second mean of a uniformly sampled signal, (n,) [1/s times its unit]."""
    window = max(1, round(SMOOTHING_S / step_s))
    smooth = pd.Series(signal).rolling(window, center=True, min_periods=1).mean().to_numpy()
    return np.asarray(np.gradient(smooth, step_s), dtype=float)
