"""Stretches of a boolean signal."""

import numpy as np
from numpy.typing import NDArray


def stretches(flag: NDArray[np.bool_]) -> list[slice]:
    """The runs of True in a boolean array, as slices."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(np.int8)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
