"""W/delta: drag and weight over the pressure ratio form one curve over Mach number, from steady level points (2.11).

The low-subsonic form (2.13) is the same in speed and temperature; both lack a CL_minD.
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag.method import Method
from analysis.drag.regression import TWO_TERM, PointRegression
from analysis.drag.steady_points import SteadyMeans, require_speeds, steady_means, steady_points
from analysis.maneuvers.kinds import STEADY, Maneuver
from flight.aircraft import Aircraft
from flight.atmosphere import GAS_CONSTANT_AIR, SEA_LEVEL_PRESSURE_PA

Array = NDArray[np.float64]

GAMMA = 1.4  # ratio of specific heats of air


def _regression(points: SteadyMeans, qS_over_delta_N: Array, aircraft: Aircraft) -> PointRegression:
    """D/delta = A0 (q S/delta) + A2 (W/delta)^2 / (q S/delta)."""
    require_speeds(points, 2)
    delta = points.static_Pa / SEA_LEVEL_PRESSURE_PA
    drag_over_delta = points.power_W / points.V / delta
    lift_over_delta = points.lift_N / delta
    X = np.stack([qS_over_delta_N, lift_over_delta, lift_over_delta**2 / qS_over_delta_N], axis=1)
    sigma = drag_over_delta * points.power_error_W / points.power_W
    return PointRegression(X, drag_over_delta, sigma, TWO_TERM, points.lift_coefficient(aircraft))


def mach_form(table: pd.DataFrame, runs: list[Maneuver], aircraft: Aircraft) -> PointRegression:
    """(2.11): over Mach number."""
    points = steady_means(table, runs, aircraft)
    M = points.V / np.sqrt(GAMMA * GAS_CONSTANT_AIR * points.temperature_K)
    return _regression(points, GAMMA * SEA_LEVEL_PRESSURE_PA * M**2 * aircraft.geometry.wing_area_m2 / 2, aircraft)


def speed_form(table: pd.DataFrame, runs: list[Maneuver], aircraft: Aircraft) -> PointRegression:
    """(2.13): over true airspeed and temperature."""
    points = steady_means(table, runs, aircraft)
    q_over_delta_Pa = SEA_LEVEL_PRESSURE_PA * points.V**2 / (2 * GAS_CONSTANT_AIR * points.temperature_K)
    return _regression(points, q_over_delta_Pa * aircraft.geometry.wing_area_m2, aircraft)


W_DELTA = Method(
    name="w-delta",
    title="W/δ",
    equations="(2.11)",
    kinds=(STEADY,),
    taken_as_measured=("thrust_scale", "thrust_slope"),
    regression=mach_form,
    points=steady_points,
    two_term=True,
)
W_DELTA_SLOW = Method(
    name="w-delta-low-subsonic",
    title="W/δ, low-subsonic",
    equations="(2.13)",
    kinds=(STEADY,),
    taken_as_measured=("thrust_scale", "thrust_slope"),
    regression=speed_form,
    points=steady_points,
    two_term=True,
)
