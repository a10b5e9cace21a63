"""Whether a probe's calibration depends on speed: the slope of an angle's residual at each tunnel speed."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.airdata.tunnel import TunnelData

Array = NDArray[np.float64]
SLOPE_RANGE_RAD = np.radians(10.0)  # the angles of normal flight, over which the slope of alpha is fitted
SPEED_STEP = 0.04  # two points whose speeds differ by more than this share belong to different tunnel speeds
SIGNIFICANCE = 0.99
FEWEST_POINTS = 5  # at one speed


class SlopeAtSpeed(NamedTuple):
    """A straight line through an angle's residual at one tunnel speed: offset at zero angle, slope and its error."""

    speed_mps: float
    points: int
    offset_rad: float
    slope: float
    slope_error: float


class SpeedDependence(NamedTuple):
    """Whether the slope of an angle depends on speed."""

    speeds: list[SlopeAtSpeed]
    chi_squared: float  # of the slopes about their mean
    spread: float  # standard deviation of the slope from speed to speed, without noise; 0 if noise explains it

    @property
    def significant(self) -> bool:
        return self.spread > 0


def speed_dependence(tunnel: TunnelData, residual_rad: Array, angle_rad: Array) -> SpeedDependence:
    """The slope of an angle's residual at each speed, within SLOPE_RANGE_RAD. residual_rad, angle_rad : (n,)."""
    small = np.abs(angle_rad) <= SLOPE_RANGE_RAD
    groups = _speed_groups(tunnel.speed_mps)
    found = []
    for group in range(groups.max() + 1):
        mine = small & (groups == group)
        x, y = angle_rad[mine], residual_rad[mine]
        if len(x) < FEWEST_POINTS or np.ptp(x) == 0:
            continue
        x_mean = x - x.mean()
        slope = float(x_mean @ y / (x_mean @ x_mean))
        left = y - y.mean() - slope * x_mean
        error = float(np.sqrt(left @ left / (len(x) - 2) / (x_mean @ x_mean)))
        offset = float(y.mean() - slope * x.mean())
        found.append(SlopeAtSpeed(float(tunnel.speed_mps[mine].mean()), len(x), offset, slope, error))
    if len(found) < 2:
        return SpeedDependence(found, 0.0, 0.0)
    slopes, errors = np.array([f.slope for f in found]), np.array([f.slope_error for f in found])
    mean = np.average(slopes, weights=1 / errors**2)
    chi_squared = float(np.sum(((slopes - mean) / errors) ** 2))
    if chi_squared < special.chdtri(len(found) - 1, 1 - SIGNIFICANCE):
        return SpeedDependence(found, chi_squared, 0.0)
    beyond = max(float(np.var(slopes, ddof=1) - np.mean(errors**2)), 0.0)
    return SpeedDependence(found, chi_squared, float(np.sqrt(beyond)))


def _speed_groups(speed_mps: Array) -> NDArray[np.int64]:
    """The number of the tunnel speed to which each point belongs, from 0; a new one begins after a SPEED_STEP."""
    order = np.argsort(speed_mps)
    steps = np.diff(speed_mps[order]) > SPEED_STEP * speed_mps[order][:-1]
    group = np.empty(len(order), dtype=np.int64)
    group[order] = np.concatenate([[0], np.cumsum(steps)])
    return group
