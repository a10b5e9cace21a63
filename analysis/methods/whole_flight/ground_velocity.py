"""Airspeed without a sensor, as GPS velocity less the wind.

Wind is constant apart from a linear trend and the logarithmic profile over height. `circle_center` gives a first guess
of the wind: the ground velocities of an aircraft at one airspeed lie on a circle whose center is the wind. The energy
balance then estimates the wind together with its other parameters. Power, height and specific force show how the
kinetic energy relative to the air changes. In a turn, the kinetic energy that follows from ground velocities depends on
the wind.

A horizontal gust changes airspeed and energy as the wind does, for its correlation time. `gusts` gives its size and
scale relative to vertical gusts near the ground (MIL-F-8785C, sec. 3.7.3.4.1).
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.methods.whole_flight.parameters import WIND, Prior, unpack
from flightpower.analysis.methods.whole_flight.settings import GPS, RESIDUALS
from flightpower.analysis.sources import recording
from flightpower.flight.arrays import Array
from flightpower.flight.units import FOOT_M


class GroundVelocity(NamedTuple):
    """GPS velocity (n,) [m/s]. height_factor : wind over that at the median height     elapsed_s : time from mid-flight

    first_wind_mps : (2,) from `circle_center`
    """

    north_mps: Array
    east_mps: Array
    down_mps: Array
    height_factor: Array
    elapsed_s: Array
    first_wind_mps: Array

    def airspeed(self, wind: Array) -> Array:
        """True airspeed (n,) [m/s] in a wind (4,) with the parameters `WIND` [m/s, m/s²]."""
        w = unpack(WIND, wind)
        north = self.height_factor * (w.wind_north + w.wind_north_trend * self.elapsed_s)
        east = self.height_factor * (w.wind_east + w.wind_east_trend * self.elapsed_s)
        return np.asarray(np.sqrt((self.north_mps - north) ** 2 + (self.east_mps - east) ** 2 + self.down_mps**2))


def ground_velocity(table: pd.DataFrame, flown: NDArray[np.bool_], first_wind_mps: Array) -> GroundVelocity:
    """Ground velocity of all samples of a `FlightTable`. GPS reports the velocity GPS.latency_s late."""
    t_s = table.index.to_numpy()
    finite = table[list(recording.GPS)].notna().all(axis=1).to_numpy()
    north, east, down = (np.interp(t_s + GPS.latency_s, t_s[finite], table[name][finite]) for name in recording.GPS)
    factor, elapsed_s = table["wind_factor"].to_numpy(), t_s - t_s[flown].mean()
    return GroundVelocity(north, east, down, factor, elapsed_s, first_wind_mps)


def circle_center(north_mps: Array, east_mps: Array, step_s: float) -> Array:
    """Wind (2,), north and east, from ground velocities (n,) at one airspeed, for which |v|² = 2 v w + const.

    Changes of airspeed are assumed to last as long as the longest changes of the wind. If headings hardly change, the
    result is near zero.
    """
    speed_mps = np.hypot(north_mps, east_mps)
    sigma = 2 * np.mean(speed_mps) * GPS.airspeed_change_mps * np.sqrt(max(GPS.correlation_s) / step_s)
    columns = np.stack([2 * north_mps, 2 * east_mps, np.ones(len(speed_mps))], axis=1) / sigma
    weak = np.diag([1 / GPS.wind_sigma_mps, 1 / GPS.wind_sigma_mps, 0.0])
    matrix, values = np.vstack([columns, weak]), np.concatenate([speed_mps**2 / sigma, np.zeros(3)])
    (north, east, _), *_ = np.linalg.lstsq(matrix, values, rcond=None)
    return np.array([north, east])


def height_factor(height_m: Array, ground_m: Array | None, flown: NDArray[np.bool_]) -> Array:
    """Wind (n,) over that at the median height flown, by the logarithmic profile; 1 if the ground is not known."""
    if ground_m is None or not flown.any():
        return np.ones(len(height_m))
    above_m = np.log(np.maximum(height_m - ground_m, 2 * GPS.roughness_m) / GPS.roughness_m)
    return np.asarray(above_m / np.nanmedian(above_m[flown]))


def wind_prior(start: Array) -> Prior:
    """A weak prior of `WIND`, centered on the first guess `start` (2,)."""
    sigma = [GPS.wind_sigma_mps, GPS.wind_sigma_mps, GPS.trend_mps2, GPS.trend_mps2]
    return dict(zip(WIND, zip([*start, 0.0, 0.0], sigma, strict=True), strict=True))


def gusts() -> tuple[float, float]:
    """Ratios of standard deviation and of correlation time, horizontal gusts over vertical gusts."""
    shape = 0.177 + 0.000823 * RESIDUALS.gust_length_m.mean / FOOT_M
    return shape**-0.4, shape**-1.2
