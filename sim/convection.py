"""Updrafts and sinks that vary from place to place, as convection makes them in calm weather.

A sum of plane waves of random direction and phase: its horizontal mean is zero, but the mean along one track is not.
At 40 m in a boundary layer of 1 km the vertical air motion has a standard deviation of 0.44 times the convective
velocity (Lenschow et al. 1980, J. Atmos. Sci. 37, eq. for w variance), 0.5 to 2 m/s on a day with sun.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from flight.number import Number

WAVES = 6
LENGTH_RATIO = 2.0  # the longest and the shortest wavelength over the middle one


def updraft(north_m: Number, east_m: Number, *, length_m: float, seed: int) -> Number:
    """Vertical air motion of unit rms over all places, elementwise. length_m: the middle wavelength."""
    total = 0.0
    for k_north, k_east, phase in _waves(length_m, seed).tolist():
        total = total + np.sqrt(2 / WAVES) * np.cos(k_north * north_m + k_east * east_m + phase)
    return total


@lru_cache(maxsize=16)
def _waves(length_m: float, seed: int) -> NDArray[np.float64]:
    """Wave numbers north and east [rad/m] and phase [rad] of each wave, (WAVES, 3)."""
    rng = np.random.default_rng([seed, 0xC0])
    lengths = length_m * np.geomspace(1 / LENGTH_RATIO, LENGTH_RATIO, WAVES)
    direction, phase = rng.uniform(0, 2 * np.pi, (2, WAVES))
    k = 2 * np.pi / lengths
    return np.column_stack([k * np.cos(direction), k * np.sin(direction), phase])
