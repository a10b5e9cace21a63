"""W/delta: drag and weight over the pressure ratio form one curve over Mach number, from steady level points (2.11).

The low-subsonic form (2.13) is the same in speed and temperature; both lack a CL_minD.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.drag.regression import TWO_TERM
from analysis.drag.steady_points import SteadyMeans, steady_method
from flight.aircraft import Aircraft
from flight.atmosphere import GAS_CONSTANT_AIR, SEA_LEVEL_PRESSURE_PA

Array = NDArray[np.float64]

GAMMA = 1.4  # ratio of specific heats of air


def _regression(points: SteadyMeans, qS_over_delta_N: Array) -> tuple[Array, Array]:
    """D/delta = A0 (q S/delta) + A2 (W/delta)^2 / (q S/delta)."""
    delta = points.static_Pa / SEA_LEVEL_PRESSURE_PA
    lift_over_delta = points.lift_N / delta
    X = np.stack([qS_over_delta_N, lift_over_delta, lift_over_delta**2 / qS_over_delta_N], axis=1)
    return X, points.power_W / points.V / delta


def mach_form(points: SteadyMeans, aircraft: Aircraft) -> tuple[Array, Array]:
    """(2.11): over Mach number."""
    M = points.V / np.sqrt(GAMMA * GAS_CONSTANT_AIR * points.temperature_K)
    return _regression(points, GAMMA * SEA_LEVEL_PRESSURE_PA * M**2 * aircraft.geometry.wing_area_m2 / 2)


def speed_form(points: SteadyMeans, aircraft: Aircraft) -> tuple[Array, Array]:
    """(2.13): over true airspeed and temperature."""
    q_over_delta_Pa = SEA_LEVEL_PRESSURE_PA * points.V**2 / (2 * GAS_CONSTANT_AIR * points.temperature_K)
    return _regression(points, q_over_delta_Pa * aircraft.geometry.wing_area_m2)


W_DELTA = steady_method("w-delta", "W/δ", "(2.11)", TWO_TERM, mach_form)
W_DELTA_SLOW = steady_method("w-delta-low-subsonic", "W/δ, low-subsonic", "(2.13)", TWO_TERM, speed_form)
