"""Converts a receiver's positions to distances over the ground, and to velocity for a table that has none."""

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.sources.grid_settings import RECEIVER
from flightpower.analysis.sources.recording import PLACE, Channel, Fix, channel
from flightpower.flight.arrays import Array
from flightpower.flight.messages import FIRST_UTC_NS, LAST_UTC_NS
from flightpower.flight.units import DAY_S, EARTH_RADIUS_M

# From each of these Unix times on, GPS time is ahead of UTC by this many seconds (IERS, Bulletin C).
LEAP_SECONDS = {0.0: 14, 1_230_768_000.0: 15, 1_341_100_800.0: 16, 1_435_708_800.0: 17, 1_483_228_800.0: 18}


def unix_of_week(week: Array, week_s: Array) -> Array:
    """Return Unix time [s], (n,), from the number of a GPS week and the seconds within it."""
    gps_s = 1e-9 * FIRST_UTC_NS + 7 * DAY_S * week + week_s
    since = np.searchsorted(list(LEAP_SECONDS), gps_s, side="right") - 1
    return np.asarray(gps_s - np.array([*LEAP_SECONDS.values()])[np.clip(since, 0, None)])


def fix_of(
    t_s: Array, latitude: Array, longitude: Array, height_m: Array | None = None, unix_s: Array | None = None
) -> Fix:
    """Return date and first place from fixes, (n,) each; the date is a median, since single dates may be damaged.

    latitude, longitude : as in `places`
    """
    has_position = _valid_positions(t_s, latitude, longitude)
    degrees = (
        [np.degrees(x[:1]) for x in _radians(latitude[has_position], longitude[has_position])]
        if has_position.any()
        else []
    )
    height = channel(
        t_s, np.full(len(t_s), np.nan) if height_m is None else np.where(has_position, height_m, np.nan)
    ).value
    dated = np.zeros(0)
    if unix_s is not None:
        dated = (unix_s - t_s)[np.isfinite(t_s) & (unix_s >= 1e-9 * FIRST_UTC_NS) & (unix_s < 1e-9 * LAST_UTC_NS)]
    return Fix(
        unix_at_zero_s=float(np.median(dated)) if len(dated) else None,
        latitude_deg=float(degrees[0][0]) if degrees else None,
        longitude_deg=float(degrees[1][0]) if degrees else None,
        height_msl_m=float(height[0]) if len(height) else None,
    )


def places(t_s: Array, latitude: Array, longitude: Array) -> dict[str, Channel]:
    """Return distances north and east of the first position [m], by PLACE; empty if no position is known.

    latitude, longitude : (n,) in degrees, or in units of 1e-7 degrees, as autopilots pack them
    """
    has_position = _valid_positions(t_s, latitude, longitude)
    if not has_position.any():
        return {}
    lat, lon = _radians(latitude[has_position], longitude[has_position])
    north = EARTH_RADIUS_M * (lat - lat[0])
    east = EARTH_RADIUS_M * np.cos(lat[0]) * (np.unwrap(lon) - lon[0])
    return {name: channel(t_s[has_position], x) for name, x in zip(PLACE, (north, east), strict=True)}


def _valid_positions(t_s: Array, latitude: Array, longitude: Array) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(t_s + latitude + longitude) & ((latitude != 0) | (longitude != 0)))


def _radians(latitude: Array, longitude: Array) -> tuple[Array, Array]:
    packed = max(float(np.max(np.abs(x))) for x in (latitude, longitude)) > 360
    lat, lon = (np.asarray(np.radians((1e-7 if packed else 1.0) * x)) for x in (latitude, longitude))
    return lat, lon


def velocity_by_position(latitude: Channel, longitude: Channel) -> tuple[Channel, Channel]:
    """Return the velocity north and east [m/s] from positions [rad].

    Straight lines are fitted to the positions around each instant. They use enough positions that position noise, often
    from the last digit, adds no more than the noise of a receiver's velocity. A position that the table repeats until
    the next one counts once.
    """
    t_s = latitude.t_s
    lat, lon = latitude.value, np.interp(t_s, longitude.t_s, np.unwrap(longitude.value))
    new = np.flatnonzero(np.append(True, (np.diff(lat) != 0) | (np.diff(lon) != 0)))
    step_s = float(np.median(np.diff(t_s[new]))) if len(new) > 1 else float(np.median(np.diff(t_s)))
    even_s = np.arange(t_s[0], t_s[-1], step_s)
    coordinates_m = EARTH_RADIUS_M * (lat - lat[0]), EARTH_RADIUS_M * np.cos(float(np.median(lat))) * (lon - lon[0])
    ratio = max(_noise(coordinate[new]) for coordinate in coordinates_m) / (step_s * RECEIVER.velocity_mps[0])
    north, east = (np.interp(even_s, t_s[new], coordinate[new]) for coordinate in coordinates_m)
    each_side = max(1, int(np.ceil(np.cbrt(1.5 * ratio**2))))  # 1 / sum k² = 3 / (2 n³) for n on each side
    return Channel(even_s, _slope(north, each_side) / step_s), Channel(even_s, _slope(east, each_side) / step_s)


def _noise(position_m: Array) -> float:
    """Return the standard deviation of one position [m].

    It is the larger of the rounding error and that from the median second difference, which is zero in steady motion.
    """
    digit = np.diff(np.unique(np.round(position_m, 2)))
    rounding_error = float(digit.min() / np.sqrt(12)) if len(digit) else 0.0
    steady = float(np.median(np.abs(np.diff(position_m, 2))))
    return max(rounding_error, steady / 0.6745 / float(np.sqrt(6)))


def _slope(value: Array, each_side: int) -> Array:
    """Return the slope per sample of a line through this many values on each side; the ends repeat the nearest one."""
    k = np.arange(-each_side, each_side + 1)
    if len(value) < len(k):
        return np.gradient(value)
    inner = np.convolve(value, k[::-1] / np.sum(k**2), mode="valid")
    return np.pad(inner, each_side, mode="edge")
