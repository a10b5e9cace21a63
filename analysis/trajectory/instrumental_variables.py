"""Values predicted from past data, as regressors of the sensor errors (instrumental variables).

A regressor of a sensor error must be uncorrelated with the current gust. The aircraft's motion responds to gusts; a
regressor that contains this response attributes the gust to the sensor.
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.signals.local_polynomial import local_quadratic
from analysis.signals.stretches import stretches

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SLOW_S = 3.0  # window of predictions of speed and bank
RATE_S = 1.0  # window of predictions of their derivatives
LAGS = range(2, 8)  # blocks: earlier angles of attack that predict the current one (stick movements)


def parabola_fit(values: Array, over: Array, flying: BoolArray) -> Array:
    """Values (n,) of the least-squares parabola of `values` over another quantity; 0 on the ground."""
    fitted = flying & np.isfinite(values)
    if fitted.sum() < 3 or np.ptp(over[fitted]) == 0:
        return np.zeros(len(values))
    return np.where(flying, np.polyval(np.polyfit(over[fitted], values[fitted], 2), over), 0.0)


def extrapolated(values: Array, flying: BoolArray, step_s: float, window_s: float = SLOW_S) -> tuple[Array, Array]:
    """Values (n,) predicted by a straight line through the window before each instant, and its slope; 0 on the ground.

    The current value is not in the window, so the prediction is independent of the current gust.
    """
    window = round(window_s / step_s)
    # Weights of the blocks before the predicted one, newest first.
    line = np.linalg.pinv(np.column_stack([np.ones(window), -step_s * np.arange(1.0, window + 1)]))
    predicted = np.zeros((2, len(values)))
    for rows in stretches(flying):
        known = pd.Series(values[rows]).interpolate(limit_direction="both").to_numpy()
        past = np.concatenate([np.full(window, known[0]), known[:-1]])  # constant before the stretch
        for found, weights in zip(predicted, line, strict=True):
            found[rows] = np.convolve(past, weights, mode="valid")
    return predicted[0], predicted[1]


def projected_on_past(current: Array, past: Array, decay: Array, flying: BoolArray) -> Array:
    """Least-squares prediction of `current` (n, m) from functions `past` (n, k) of past data; 0 on the ground.

    decay : (n-1,) decay factors of a gust over each step. Least squares of the *increments* over a decaying gust, since
    a smoother with gusts as process noise weights increments. So instrument z and regressor x have z'x = z'z, and the
    covariance that the smoother computes is the true one (docs/estimators.md).
    """
    both = flying[1:] & flying[:-1]
    d_current, d_past = (values[1:][both] - decay[both, None] * values[:-1][both] for values in (current, past))
    return np.where(flying[:, None], past @ np.linalg.lstsq(d_past, d_current, rcond=None)[0], 0.0)


def lagged(values: Array, flying: BoolArray) -> Array:
    """`values` of LAGS blocks before, (n, len(LAGS)), newest first; 0 where the aircraft did not fly then.

    Lag 1 is left out: the means of neighboring blocks share part of a gust's increment.
    """
    flown = np.where(flying, values, 0.0)
    return np.column_stack([np.concatenate([np.zeros(lag), flown[:-lag]]) for lag in LAGS])


def derivative(values: Array, flying: BoolArray, step_s: float) -> Array:
    """Derivative by a local quadratic over SLOW_S; 0 on the ground and in stretches shorter than that."""
    window = 2 * round(SLOW_S / step_s / 2) + 1
    rate = np.zeros(len(values))
    for rows in stretches(flying):
        if rows.stop - rows.start >= window:
            rate[rows] = local_quadratic(values[rows], window, 1, step_s)
    return rate
