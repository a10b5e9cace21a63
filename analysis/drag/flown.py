"""What was flown: weight and density of a flight, and its lift coefficients, over which a polar holds."""

import numpy as np
import pandas as pd

from analysis.drag.polar import Condition
from analysis.signals.aircraft_size import least_height_m, speed_scale_of
from flight.aircraft import Aircraft
from flight.errors import InputError
from flight.units import GRAVITY_MPS2

LIFT_S, LARGEST_PERCENT = 0.5, 99.9
LEAST_CL, LARGEST_CL = 0.05, 5.0  # of the slowest speed flown; no wing reaches the latter
ROBUST_RANGE = (1.0, 99.0)  # percentiles of the flown lift coefficients that a curve is drawn over


def flown_condition(flown: pd.DataFrame, aircraft: Aircraft) -> Condition:
    """Weight of the aircraft and mean density of the air. flown: rows of `air_data`."""
    return Condition(aircraft.mass.weight_N, float(flown["rho"].mean()), aircraft.geometry.wing_area_m2)


def flown_lift(flown: pd.DataFrame, aircraft: Aircraft) -> tuple[float, float]:
    """Range of the lift coefficients of level flight at the speeds flown. flown: rows of `air_data`.

    Of slow aircraft, whose speed is noisy, means are taken: noise would make the slowest speed lower than was flown.
    """
    V = flown["V_mps"].rolling(round(speed_scale_of(flown) ** -4), center=True, min_periods=1).mean()
    CL = 2 * aircraft.mass.weight_N / (flown["rho"] * V**2 * aircraft.geometry.wing_area_m2)
    low, high = np.percentile(CL.dropna(), ROBUST_RANGE)
    return float(low), float(high)


def check_lift(flown_CL: tuple[float, float], condition: Condition, log: str) -> None:
    """Raises InputError if no wing could carry the weight at the speeds flown. flown_CL: of `flown_lift`."""
    largest = flown_CL[1]
    if not LEAST_CL < largest < LARGEST_CL:
        raise InputError(
            f"{log}: a weight of {condition.weight_N:.3g} N and a wing area of {condition.wing_area_m2:.3g} m^2 need a"
            f" lift coefficient of {largest:.2g} at the slowest speed flown; a wing has 0.5 to 2: check"
            " mass.weight and geometry.wing_area of the aircraft file, and the unit of /probe/airspeed"
        )


def largest_lift(table: pd.DataFrame, condition: Condition) -> float:
    """The largest lift coefficient of a flight, by the vertical accelerometer; -inf where there is none.

    table: of `air_data`. Held for half a second, and exceeded in a thousandth of the flight: neither noise nor a bump.
    """
    aloft = table["flying"] & (table["height_m"] > least_height_m(table))
    step_s = float(table.index[1] - table.index[0])
    force_N = -condition.weight_N / GRAVITY_MPS2 * table["az_mps2"]
    CL = force_N.rolling(round(LIFT_S / step_s), center=True).mean() / (
        table["qbar_Pa"].rolling(round(LIFT_S / step_s), center=True).mean() * condition.wing_area_m2
    )
    known = CL[aloft].dropna()
    return float(np.percentile(known, LARGEST_PERCENT)) if len(known) else -np.inf
