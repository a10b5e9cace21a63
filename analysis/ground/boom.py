"""Bending of the probe's boom: weights hung on its tip, and what a level on the probe shows under each.

The level shows how the boom bends, and how the aircraft on its gear gives under the weight. The latter is that of the
IMU in the log. The rest is fitted by a constant and a term in proportion to the force at the tip. In flight the boom
carries itself and the probe: m g under each g of load factor, where m is the mass of the probe and a third of the
boom's (slope at the end of a cantilever: F l^2 / 2 E I under a force at its tip, w l^3 / 6 E I under its own weight).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from analysis.airdata.settings import STAND_LIMITS
from analysis.ground.thrust_stand import student_fit
from analysis.signals.rest import rest_segments
from analysis.signals.settings import STATISTICS
from flight.errors import InputError
from flight.units import GRAVITY_MPS2


class HangingWeight(NamedTuple):
    """A stretch in which the aircraft stood still: time [s] of its middle, pitch [rad] of the aircraft."""

    time_s: float
    pitch_rad: float


class CarriedMass(NamedTuple):
    """Mass that bends the boom in flight: of the probe, and a third of the boom's. error: 1 sigma, as a fraction."""

    mass_kg: float
    error: float


class BoomBending(NamedTuple):
    """Angle by which the boom bends down under each g [rad], and standard error; per_N_rad: by a force at its tip."""

    per_g_rad: float
    error_rad: float
    per_N_rad: float


def hanging_weights(table: pd.DataFrame, source: str) -> list[HangingWeight]:
    """The stretches at rest, in order of time. table: of `signals.channels.synchronize`.

    Raises InputError where there are too few for a straight line.
    """
    step_s = float(table.index[1] - table.index[0])
    found = []
    for rows in rest_segments(table, 1 / step_s):
        x, y, z = (float(table[name].iloc[rows].mean()) for name in ("ax_mps2", "ay_mps2", "az_mps2"))
        found.append(HangingWeight(float(table.index[rows].to_numpy().mean()), math.atan2(x, math.hypot(y, z))))
    if len(found) < STATISTICS.fewest_readings:
        raise InputError(
            f"{source}: the aircraft stood still {len(found)} times; hang {STAND_LIMITS.fewest_speeds} weights or more,"
            " up and down, and let it stand for ten seconds with each, and before and after"
        )
    return found


def boom_bending(
    found: Sequence[HangingWeight], mass_kg: Sequence[float], level_rad: Sequence[float], carried: CarriedMass
) -> BoomBending:
    """The bending by the weights mass_kg (k,) on the tip and the level's angles level_rad (k,), positive nose up.

    Raises InputError for fewer different weights than a straight line needs, and where the boom bends up.
    """
    if len(set(mass_kg)) < STAND_LIMITS.fewest_speeds:
        raise InputError(
            f"--weights: {len(set(mass_kg))} different ones; {STAND_LIMITS.fewest_speeds} are needed, 0 among"
        )
    force_N = GRAVITY_MPS2 * np.array(mass_kg)
    pitch = np.array([one.pitch_rad for one in found])
    bent_down = pitch - np.array(level_rad)
    X = np.column_stack([np.ones(len(force_N)), force_N])
    per_N, sigma = (float(values[1]) for values in student_fit(X, bent_down))
    at_1_g_N = GRAVITY_MPS2 * carried.mass_kg
    if per_N < -2 * sigma:
        raise InputError(
            "--angles: the boom bends up under a weight; give the level's angles positive with the nose up"
        )
    per_g = max(per_N, 0.0) * at_1_g_N
    return BoomBending(per_g, math.hypot(sigma * at_1_g_N, carried.error * per_g), per_N)


def in_words(found: Sequence[HangingWeight]) -> str:
    """The stretches at rest, to be matched with what was written down."""
    return ", ".join(f"{number} at {one.time_s:.0f} s" for number, one in enumerate(found, start=1))
