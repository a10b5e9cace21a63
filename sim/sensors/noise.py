"""Noise as a pure function of seed, channel and sample time: equal arguments give equal values."""

from functools import lru_cache
from zlib import crc32

import numpy as np
from scipy.signal import lfilter

from flightpower.flight.arrays import Array

# White noise is constant over each cell of this grid: samples at up to 200 Hz are independent.
GRID_HZ = 200
_BLOCK_S = 16  # length drawn at once, since making a generator takes as long as drawing a thousand numbers


@lru_cache(maxsize=256)
def _block(seed: int, channel: int, block: int) -> Array:
    return np.random.default_rng([seed, channel, block]).standard_normal(GRID_HZ * _BLOCK_S)


def white(seed: int, channel: str, t_s: Array) -> Array:
    """Standard normal numbers (n,) at times t (n,), one for each cell of the grid."""
    # A tolerance of half a microsecond makes a computed multiple of the grid belong to the cell that starts there.
    cell = np.floor(np.maximum(np.asarray(t_s), 0.0) * GRID_HZ + 1e-4).astype(np.int64)
    code = crc32(channel.encode())
    block, place = np.divmod(cell, GRID_HZ * _BLOCK_S)
    needed, which = np.unique(block, return_inverse=True)
    blocks = np.array([_block(seed, code, int(number)) for number in needed]).reshape(-1, GRID_HZ * _BLOCK_S)
    return blocks[which, place]


def rng_of(seed: int, channel: str) -> np.random.Generator:
    """Make a random generator for a seed and a name."""
    return np.random.default_rng([seed, crc32(channel.encode())])


def gauss_markov(seed: int, channel: str, n: int, dt: float, correlation_s: float) -> Array:
    """A first-order Gauss-Markov sequence (n,) of unit variance, stationary from its start."""
    draws = rng_of(seed, channel).standard_normal(n)
    a = np.exp(-dt / correlation_s)
    draws[1:] *= np.sqrt(1 - a**2)
    return np.asarray(lfilter([1.0], [1.0, -a], draws))
