"""Fetches physical values on a part's own sampling grid, many at a time.

`sim.sensor_truth.SensorTruth` is a pure function of time, so values may be fetched early. Fetching them one by one
would take a hundred times as long.
"""

from collections.abc import Callable

import numpy as np

from flightpower.flight.arrays import Array


class SampleBlocks:
    """Rows of `fetch(t_s)` for t_s = origin_s + k period_s, k = 0, 1, …, fetched `length` rows at a time.

    fetch: gives rows (n, …) for instants (n,), one row per instant. The two newest blocks are kept.
    """

    def __init__(self, fetch: Callable[[Array], np.ndarray], period_s: float, origin_s: float = 0.0, length: int = 256):
        self._fetch = fetch
        self._period_s = period_s
        self._origin_s = origin_s
        self._length = length
        self._blocks: dict[int, np.ndarray] = {}

    def row(self, index: int) -> np.ndarray:
        """Row number `index`."""
        block, offset = divmod(index, self._length)
        row: np.ndarray = self._block(block)[offset]
        return row

    def rows(self, first: int, stop: int) -> np.ndarray:
        """Rows `first` up to, not including, `stop`."""
        block, offset = divmod(first, self._length)
        if stop <= (block + 1) * self._length:
            return self._block(block)[offset : offset + stop - first]
        boundary = (block + 1) * self._length
        head = self._block(block)[offset:]
        return np.concatenate([head, self.rows(boundary, stop)], dtype=head.dtype)  # dtype preserves the byte order

    def _block(self, number: int) -> np.ndarray:
        if number not in self._blocks:
            index = np.arange(number * self._length, (number + 1) * self._length)
            if len(self._blocks) > 1:
                del self._blocks[min(self._blocks)]
            self._blocks[number] = self._fetch((self._origin_s + index * self._period_s).astype(np.float64))
        return self._blocks[number]
