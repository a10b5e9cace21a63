"""Parameters of an energy balance by name, and the errors that a whole flight shares.

A balance lists the parameters of its vector in `names`; only `pack` and `unpack` use positions.

CD0, K, x at the greatest efficiency, fall and angle over C_L are estimated as natural logarithms, and the efficiency as
a logit, which keeps them physically possible. LIFT are sideslip over C_Y and the parameters of the angle of attack,
which is alpha_0 + C_L (angle over C_L) + C_T (angle over C_T). POWER_LAW has the logarithm of the efficiency and the
exponents of speed and power.
"""

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.estimation.model import NamedValues
from flightpower.flight.arrays import Array

DRAG = ("ln_CD0", "ln_K", "CL_minD", "K4")
PROPELLER = ("logit_efficiency", "ln_x", "ln_fall", "idle_drag")
POWER_LAW = ("ln_efficiency", "of_speed", "of_power", "idle_drag")
THRUST_ERRORS = ("thrust_scale", "thrust_slope")
LIFT = ("ln_beta_per_CY", "alpha_0", "ln_alpha_per_CL", "alpha_per_CT")
MEAN_WIND = ("wind_north", "wind_east")
WIND = (*MEAN_WIND, "wind_north_trend", "wind_east_trend")
AIRSPEED = ("scale", "zero_Pa")
POWER_SCALE = "ln_power_scale"  # ln(true power / measured power), if it is estimated

Prior = Mapping[str, tuple[float, float]]  # mean and standard deviation by parameter


class Source(StrEnum):
    """An error that the whole flight shares, by its name in pools of results.

    Errors of airspeed (or of wind, without an airspeed sensor) are correlated, so each source contains its own part and
    the correlated part of the sources after it.
    """

    AIRSPEED = "airspeed"  # the scale of the airspeed
    AIRSPEED_ZERO = "airspeed's zero"
    WIND_NORTH = "wind to the north"
    WIND_EAST = "wind to the east"
    WIND_NORTH_TREND = "trend of the wind to the north"
    WIND_EAST_TREND = "trend of the wind to the east"
    DENSITY = "density"
    MASS = "mass"
    CURRENT = "current"
    IDLE_POWER = "idle power"
    UPDRAFT = "updraft"
    GUSTS = "work of gusts"


OF_AIRSPEED = (Source.AIRSPEED, Source.AIRSPEED_ZERO)  # in the order of AIRSPEED
OF_WIND = (Source.WIND_NORTH, Source.WIND_EAST, Source.WIND_NORTH_TREND, Source.WIND_EAST_TREND)  # in the order of WIND
# These errors are the same in all flights of an aircraft.
OF_AIRCRAFT = (Source.DENSITY, Source.MASS, Source.CURRENT, Source.IDLE_POWER, Source.GUSTS)

# Names of the priors' errors in pools of results, the same for both forms of the efficiency.
_OF_EFFICIENCY = ("greatest efficiency", "speed of greatest efficiency", "fall of efficiency", "idle propeller's drag")
PRIOR_OF = {
    **dict(zip(DRAG, ("zero-lift drag", "drag by lift", "lift of least drag", "drag of fourth order"), strict=True)),
    **dict(zip(PROPELLER, _OF_EFFICIENCY, strict=True)),
    **dict(zip(POWER_LAW, _OF_EFFICIENCY, strict=True)),
    **dict(zip(LIFT, ("sideslip", "angle of zero lift", "angle over lift", "angle over thrust"), strict=True)),
}


def prior_error(parameter: str) -> str:
    """The name of the difference between a parameter's prior mean and the truth, which all flights share."""
    return f"prior of {PRIOR_OF[parameter]}"


def unpack(names: Sequence[str], vector: Array) -> NamedValues:
    """Parameters by name, from a vector (m,) with these names (m,)."""
    return NamedValues("parameter", dict(zip(names, vector, strict=True)))


def pack(names: Sequence[str], values: NamedValues | Mapping[str, float]) -> Array:
    """The vector (m,) of the parameters with these names (m,)."""
    return np.array([values[name] for name in names], dtype=float)


def block(names: Sequence[str], covariance: NDArray[np.floating[Any]], chosen: Sequence[str]) -> Array:
    """The covariance (k, k) of the parameters `chosen` (k,), from the covariance (m, m) of all parameters `names`."""
    index = [names.index(name) for name in chosen]
    return np.asarray(covariance[np.ix_(index, index)], dtype=float)
