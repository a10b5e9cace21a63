"""The earth's magnetic field as the calibrated magnetometer measured it, in level axes, and headings from it."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.magnetometer import Compass
from analysis.trajectory.block_means import BlockMeans, block_mean, moving_average
from flight import motion

Array = NDArray[np.float64]

AVERAGING_S = 10.0  # of the compass, for the initial estimate


class LevelField:
    """Block means (n, 3) of the field in body axes [T], NaN without a compass; error_T: its standard deviation."""

    def __init__(self, compass: Compass | None, blocks: BlockMeans):
        self._width = round(AVERAGING_S / (blocks.t_s[1] - blocks.t_s[0]))
        if compass is None:
            self.body_T, self.error_T = np.full((blocks.n, 3), np.nan), np.inf
        else:
            self.body_T = np.column_stack([block_mean(pd.Series(part), blocks.n) for part in compass.field_T.T])
            self.error_T = compass.error_T

    def leveled(self, phi: Array, theta: Array) -> tuple[Array, Array]:
        """Components forward and right (n,) [T], in the horizontal plane at these attitudes."""
        x, y, z = self.body_T.T
        forward, right, _ = motion.earth_from_body(x, y, z, phi, theta, 0.0)
        return forward, right

    def heading_offset(self, heading: Array, phi: Array, theta: Array) -> Array:
        """Averaged compass heading less `heading` (n,), unwrapped [rad]."""
        forward, right = self.leveled(phi, theta)
        offset = np.arctan2(-right, forward) - heading
        sine, cosine = (moving_average(part, self._width) for part in (np.sin(offset), np.cos(offset)))
        return np.unwrap(np.arctan2(sine, cosine))
