"""Means of the synchronized channels over blocks of five samples (0.2 s): the instants of the trajectory."""

import numpy as np
import pandas as pd

from flightpower.analysis.sources.daemon import least_height_m, speed_scale_of
from flightpower.analysis.sources.grid import stretches
from flightpower.analysis.trajectory.settings import PREDICTION
from flightpower.flight.arrays import Array, BoolArray

BLOCK = 5  # samples


class BlockMeans:
    """Block means of every column of a table that `air_data` returned; `means[name]` is an array (n,).

    n : number of whole blocks             t_s : (n,) centers of the blocks
    rows : (n,) table rows at the centers  step_s : time between them    rate_Hz : sample rate of the table
    flying : (n,) whether the aircraft is above `least_height_m` and airspeed is measured
    speed_scale, least_height_m : properties of the aircraft (`flight.runs.AIRCRAFT_SIZE`)
    """

    def __init__(self, table: pd.DataFrame):
        self.n, self._table = len(table) // BLOCK, table
        self.rate_Hz = 1 / float(table.index[1] - table.index[0])
        self.step_s = BLOCK / self.rate_Hz
        self.rows = np.arange(self.n) * BLOCK + BLOCK // 2
        self.t_s: Array = table.index.to_numpy()[self.rows]
        self.means = {str(name): block_mean(table[name], self.n) for name in table.columns}
        self.speed_scale, self.least_height_m = speed_scale_of(table), least_height_m(table)
        self.flying: BoolArray = (self["height_m"] > self.least_height_m) & np.isfinite(self["V_mps"])

    @property
    def in_flight(self) -> BoolArray:
        """`flying`, (n,), also True in gaps of airspeed in the air that are shorter than the window of predictions."""
        bridged, in_air = self.flying.copy(), self["height_m"] > self.least_height_m
        for gap in stretches(~self.flying):
            inside = 0 < gap.start and gap.stop < self.n and bool(in_air[gap].all())
            bridged[gap] = inside and (gap.stop - gap.start) * self.step_s < PREDICTION.slow_s
        return bridged

    @property
    def airborne(self) -> slice:
        """The blocks from the first to the last in flight."""
        flying = np.flatnonzero(self.flying)
        return slice(int(flying[0]), int(flying[-1]) + 1) if len(flying) else slice(0, 0)

    def covariance(self, first: str, second: str) -> Array:
        """Covariance (n,) of two channels within each block; NaN where a sample is missing."""
        a, b = (self._table[name].to_numpy()[: self.n * BLOCK].reshape(self.n, BLOCK) for name in (first, second))
        return np.asarray(((a - a.mean(axis=1, keepdims=True)) * (b - b.mean(axis=1, keepdims=True))).mean(axis=1))

    def __getitem__(self, name: str) -> Array:
        return self.means[name]

    def __contains__(self, name: str) -> bool:
        return name in self.means

    def measured(self, name: str) -> bool:
        """Whether the channel exists and has a value somewhere."""
        return name in self and bool(np.isfinite(self.means[name]).any())


def block_mean(series: pd.Series, n: int) -> Array:
    """Means (n,) over blocks of BLOCK samples; NaN where more than half of a block is missing."""
    blocks = series.to_numpy(dtype=float)[: n * BLOCK].reshape(n, BLOCK)
    present = np.isfinite(blocks)
    count = present.sum(axis=1)
    total = np.where(present, blocks, 0.0).sum(axis=1)
    return np.where(count > BLOCK // 2, total / np.maximum(count, 1), np.nan)


def moving_average(values: Array, width: int) -> Array:
    """Centered moving average over `width` blocks; gaps are interpolated linearly."""
    series = pd.Series(values).interpolate(limit_direction="both")
    return series.rolling(width, center=True, min_periods=1).mean().to_numpy()
