"""Values predicted only from past ones, so they do not contain the current gust."""

import numpy as np

from flightpower.analysis.sources.grid import stretches
from flightpower.analysis.trajectory.settings import PREDICTION
from flightpower.flight.arrays import Array, BoolArray


def extrapolated(
    values: Array, flying: BoolArray, step_s: float, window_s: float = PREDICTION.slow_s, newest: int = 1
) -> tuple[Array, Array]:
    """Values (n,) predicted by a straight line through the window before each instant, and its slope; 0 on the ground.

    The window ends `newest` blocks before the instant. The current value is not in it, so the prediction is independent
    of the current gust. In a gap the last value before it is held: a line across it would contain the value after it.
    """
    window = round(window_s / step_s)
    # Weights of the blocks before the predicted one, newest first.
    line = np.linalg.pinv(np.column_stack([np.ones(window), -step_s * (newest + np.arange(float(window)))]))
    predicted = np.zeros((2, len(values)))
    for rows in stretches(flying):
        filled = _hold_ends(values[rows])
        past = np.concatenate([np.full(window + newest - 1, filled[0]), filled])  # constant before the stretch
        past = past[: window + len(filled) - 1]
        for each, weights in zip(predicted, line, strict=True):
            each[rows] = np.convolve(past, weights, mode="valid")
    return predicted[0], predicted[1]


def _hold_ends(values: Array) -> Array:
    """Replace each NaN in values (n,) by the last value before it; at the beginning, by the first value."""
    finite = ~np.isnan(values)
    if finite.all() or not finite.any():
        return values
    last = np.maximum.accumulate(np.where(finite, np.arange(len(values)), np.argmax(finite)))
    return values[last]
