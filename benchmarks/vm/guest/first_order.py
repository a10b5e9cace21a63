"""Replaces scipy.signal in the virtual machine, where importing SciPy takes most of a minute on an emulated
processor."""

import numpy as np


def lfilter(b: list[float], a: list[float], x: np.ndarray, axis: int, zi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Do what `scipy.signal.lfilter` does, for one delay along the first axis: y[n] = b[0] x[n] - a[1] y[n-1]."""
    assert axis == 0 and len(b) == 1 and len(a) == 2 and a[0] == 1.0
    y, rest = np.empty_like(x), zi[0]
    for n, value in enumerate(x):
        y[n] = b[0] * value + rest
        rest = -a[1] * y[n]
    return y, rest[np.newaxis]
