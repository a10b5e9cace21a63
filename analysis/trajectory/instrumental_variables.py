"""Values predicted from past data, as regressors of the sensor errors (instrumental variables).

A regressor of a sensor error must be uncorrelated with the current gust. The aircraft's motion responds to gusts; a
regressor that contains this response attributes the gust to the sensor.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from analysis.signals.gaps import without_gaps
from analysis.signals.local_polynomial import local_quadratic
from analysis.signals.stretches import stretches

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SLOW_S = 3.0  # window of predictions of speed and bank
RATE_S = 1.0  # window of predictions of their derivatives
NEWEST = 2  # blocks before: the means of neighboring blocks share part of a gust's increment
LAGS = range(NEWEST, 8)  # blocks: earlier load factors that predict the angle of attack (stick movements)


def parabola_fit(values: Array, over: Array, flying: BoolArray) -> Array:
    """Values (n,) of the least-squares parabola of `values` over another quantity; 0 on the ground."""
    fitted = flying & np.isfinite(values)
    if fitted.sum() < 3 or np.ptp(over[fitted]) == 0:
        return np.zeros(len(values))
    return np.where(flying, np.polyval(np.polyfit(over[fitted], values[fitted], 2), over), 0.0)


def extrapolated(
    values: Array, flying: BoolArray, step_s: float, window_s: float = SLOW_S, newest: int = 1
) -> tuple[Array, Array]:
    """Values (n,) predicted by a straight line through the window before each instant, and its slope; 0 on the ground.

    The window ends `newest` blocks before the instant. The current value is not in it, so the prediction is independent
    of the current gust.
    """
    window = round(window_s / step_s)
    # Weights of the blocks before the predicted one, newest first.
    line = np.linalg.pinv(np.column_stack([np.ones(window), -step_s * (newest + np.arange(float(window)))]))
    predicted = np.zeros((2, len(values)))
    for rows in stretches(flying):
        known = without_gaps(values[rows])
        past = np.concatenate([np.full(window + newest - 1, known[0]), known])  # constant before the stretch
        past = past[: window + len(known) - 1]
        for found, weights in zip(predicted, line, strict=True):
            found[rows] = np.convolve(past, weights, mode="valid")
    return predicted[0], predicted[1]


def projected_on_past(
    current: Array, past: Array, decay: Array, flying: BoolArray, increment_over_noise: Array | float = np.inf
) -> Array:
    """Least-squares prediction of `current` (n, m) from functions `past` (n, k) of past data; 0 on the ground.

    decay : (n-1,) decay factors of a gust over each step. increment_over_noise : (n-1,) standard deviation of its
    increment over that of white noise, in the measurement that the prediction is for
    Least squares after the filter that makes gust and noise together white, as a smoother weights them: increments over
    the decaying gust where there is no noise, the values themselves where there is no gust. So instrument z and
    regressor x have z'x = z'z, and the covariance that the smoother computes is the true one (docs/estimators.md).
    Without the noise z'x was -0.3 z'z in calm air for the lag of the angle of attack.
    """
    both = flying[1:] & flying[:-1]
    returned = _moving_average(decay, increment_over_noise)
    w_current, w_past = (_whitened(values, decay, returned, both)[1:][both] for values in (current, past))
    return np.where(flying[:, None], past @ np.linalg.lstsq(w_past, w_current, rcond=None)[0], 0.0)


def _moving_average(decay: Array, increment_over_noise: Array | float) -> Array:
    """The moving-average coefficient (n-1,) of white noise on a first-order gust, as ARMA(1, 1) of its own innovations.

    The increments over the decay have variance a^2 + 1 + decay^2 and covariance -decay, in units of the noise; a is
    the size of the gust's increment.
    """
    ratio = (increment_over_noise**2 + 1 + decay**2) / np.maximum(decay, np.finfo(float).tiny)
    return np.asarray(2 / (ratio + np.sqrt(ratio**2 - 4)))


def _whitened(values: Array, decay: Array, returned: Array, both: BoolArray) -> Array:
    """Innovations (n, k): w_i = v_i - decay v_i-1 + returned w_i-1 where both fly, 0 elsewhere."""
    increments = np.zeros_like(values)
    increments[1:][both] = values[1:][both] - decay[both, None] * values[:-1][both]
    band = np.ones((2, len(values)))
    band[1, :-1] = -np.where(both, returned, 0.0)
    return np.asarray(linalg.solve_banded((1, 0), band, increments))


def lagged(values: Array, flying: BoolArray) -> Array:
    """`values` of LAGS blocks before, (n, len(LAGS)), newest first; 0 on the ground, and constant before a flight.

    Lag 1 is left out (NEWEST).
    """
    past = np.zeros((len(values), len(LAGS)))
    for rows in stretches(flying):
        before = np.arange(rows.start, rows.stop)[:, None] - LAGS
        past[rows] = values[np.maximum(before, rows.start)]
    return past


def has_past(flying: BoolArray) -> BoolArray:
    """Which instants (n,) have flight at all LAGS before them."""
    settled = np.zeros(len(flying), dtype=bool)
    for rows in stretches(flying):
        settled[rows.start + LAGS[-1] : rows.stop] = True
    return settled


def derivative(values: Array, flying: BoolArray, step_s: float) -> Array:
    """Derivative by a local quadratic over SLOW_S; 0 on the ground and in stretches shorter than that."""
    window = 2 * round(SLOW_S / step_s / 2) + 1
    rate = np.zeros(len(values))
    for rows in stretches(flying):
        if rows.stop - rows.start >= window:
            rate[rows] = local_quadratic(values[rows], window, 1, step_s)
    return rate
