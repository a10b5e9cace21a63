"""How thresholds scale with the size of the aircraft.

They were set on aircraft of 20 m/s and 80 N/m^2. An aircraft with a lower wing loading flies the same lift coefficients
at lower speeds. Speeds, changes of speed in a given time, and durations of runs scale with its speed at a lift
coefficient of 1: durations, because thrust and drag over weight are the same. Dynamic pressures scale with the square
of that speed, which is proportional to the wing loading. Faster aircraft keep the thresholds.
"""

import numpy as np
import pandas as pd

from flight.aircraft import Aircraft
from flight.atmosphere import SEA_LEVEL_DENSITY

REFERENCE_MPS = 11.0  # speed at C_L = 1 at sea level, from which on thresholds are constant
SPEED_SCALE = "speed_scale"  # column of the table of `air_data`, the same in all rows
# Dynamic pressure above which the aircraft flies, and its flow angles are determined: C_L = 2.5 at REFERENCE_MPS.
FLYING_PA = 30.0
LEAST_FLYING_PA = 8.0  # three standard deviations of a mean over 0.2 s of 6 Pa of noise (Table 4.1)
# Height above the ground, below which wind shear matters: climb times the wind's gradient, which is inverse to height,
# acts like an acceleration. Climb scales with speed. Twenty meters are eleven spans, and ten meters of a light aircraft
# still six: ground effect is below 0.1 % of induced drag from two spans on (McCormick).
LEAST_HEIGHT_M = 20.0


def speed_scale(aircraft: Aircraft) -> float:
    """Speed at C_L = 1 over REFERENCE_MPS, at most 1."""
    wing_loading_Pa = aircraft.mass.weight_N / aircraft.geometry.wing_area_m2
    return min(1.0, float(np.sqrt(2 * wing_loading_Pa / SEA_LEVEL_DENSITY)) / REFERENCE_MPS)


def speed_scale_of(table: pd.DataFrame) -> float:
    """That of the aircraft of a table of `air_data`; 1 without the column."""
    return float(table[SPEED_SCALE].iloc[0]) if SPEED_SCALE in table and len(table) else 1.0


def flying_Pa(scale: float) -> float:
    """FLYING_PA at a speed scale, at least LEAST_FLYING_PA."""
    return max(LEAST_FLYING_PA, FLYING_PA * scale**2)


def least_height_m(table: pd.DataFrame) -> float:
    """LEAST_HEIGHT_M for the aircraft of a table of `air_data`."""
    return LEAST_HEIGHT_M * speed_scale_of(table)
