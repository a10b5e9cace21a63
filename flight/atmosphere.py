"""The standard atmosphere of the troposphere, and the gas law (ICAO Doc 7488/3; U.S. Standard Atmosphere 1976).

The functions work elementwise and accept floats, arrays and CasADi symbols.
"""

import numpy as np

from flightpower.flight.number import Number
from flightpower.flight.units import GAS_CONSTANT_AIR as GAS_CONSTANT_AIR
from flightpower.flight.units import GRAVITY_MPS2 as GRAVITY_MPS2
from flightpower.flight.units import LAPSE_RATE as LAPSE_RATE
from flightpower.flight.units import SEA_LEVEL_DENSITY as SEA_LEVEL_DENSITY
from flightpower.flight.units import SEA_LEVEL_PRESSURE_PA as SEA_LEVEL_PRESSURE_PA
from flightpower.flight.units import SEA_LEVEL_TEMPERATURE_K as SEA_LEVEL_TEMPERATURE_K

_EXPONENT = GRAVITY_MPS2 / (GAS_CONSTANT_AIR * LAPSE_RATE)
FOOT_POUND_PER_SECOND_W = 1.3558179483314


def density(pressure_Pa: Number, temperature_K: Number) -> Number:
    """Density of dry air [kg/m^3] from static pressure and temperature, elementwise (2.12)."""
    return pressure_Pa / (GAS_CONSTANT_AIR * temperature_K)


def pressure_at(
    height_m: Number,
    *,
    ground_pressure_Pa: Number = SEA_LEVEL_PRESSURE_PA,
    ground_temperature_K: Number = SEA_LEVEL_TEMPERATURE_K,
) -> Number:
    """Static pressure [Pa] at `height_m` above the level of `ground_pressure_Pa` and `ground_temperature_K`."""
    return ground_pressure_Pa * np.power(
        temperature_at(height_m, ground_temperature_K) / ground_temperature_K, _EXPONENT
    )


def temperature_at(height_m: Number, ground_temperature_K: Number = SEA_LEVEL_TEMPERATURE_K) -> Number:
    """Temperature [K] at `height_m` above the level of `ground_temperature_K`."""
    return ground_temperature_K - LAPSE_RATE * height_m


def height_at(
    pressure_Pa: Number,
    *,
    ground_pressure_Pa: Number = SEA_LEVEL_PRESSURE_PA,
    ground_temperature_K: Number = SEA_LEVEL_TEMPERATURE_K,
) -> Number:
    """Height [m] above the level of `ground_pressure_Pa`; the inverse of `pressure_at`."""
    return ground_temperature_K / LAPSE_RATE * (1 - np.power(pressure_Pa / ground_pressure_Pa, 1 / _EXPONENT))


def viscosity(temperature_K: Number) -> Number:
    """Dynamic viscosity of air [Pa s] by Sutherland's law (U.S. Standard Atmosphere 1976, eq. 51)."""
    return 1.458e-6 * np.power(temperature_K, 1.5) / (temperature_K + 110.4)
