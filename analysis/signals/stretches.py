"""Stretches of a boolean signal in which it is true."""

import numpy as np
from numpy.typing import NDArray


def stretches(flag: NDArray[np.bool_]) -> list[slice]:
    """The slices of a boolean array (n,) in which it is True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(np.int8)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
