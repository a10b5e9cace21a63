"""How thresholds scale with the size of the aircraft (`flight.runs.AIRCRAFT_SIZE`), in a table of air data."""

import pandas as pd

from flight import runs
from flight.aircraft import Aircraft
from flight.runs import AIRCRAFT_SIZE

SPEED_SCALE = "speed_scale"  # column of the table of `air_data`, the same in all rows


def speed_scale(aircraft: Aircraft) -> float:
    """Speed at C_L = 1 over the reference speed, at most 1."""
    return runs.speed_scale(aircraft.mass.weight_N, aircraft.geometry.wing_area_m2)


def speed_scale_of(table: pd.DataFrame) -> float:
    """That of the aircraft of a table of `air_data`; 1 without the column."""
    return float(table[SPEED_SCALE].iloc[0]) if SPEED_SCALE in table and len(table) else 1.0


def least_height_m(table: pd.DataFrame) -> float:
    """Height above the ground of the aircraft of a table of `air_data`, below which wind shear matters."""
    return AIRCRAFT_SIZE.least_height_m * speed_scale_of(table)
