"""W/delta: drag and weight over the pressure ratio make one curve over Mach number, from steady level points (2.11).

The low-subsonic form (2.13) says the same with speed and temperature; both lack a CL_minD.
"""

import numpy as np
import pandas as pd

from analysis.drag.method import Method
from analysis.drag.piw_viw import Steady, as_points, enough, lift_coefficient, steady_points
from analysis.drag.regression import TWO_TERM, Points
from analysis.maneuvers.kinds import STEADY, Maneuver
from flight.aircraft import Aircraft
from flight.atmosphere import GAS_CONSTANT_AIR, SEA_LEVEL_PRESSURE_PA

GAMMA = 1.4  # ratio of specific heats of air


def _fitted(points: Steady, unit: np.ndarray, aircraft: Aircraft) -> Points:
    """D/delta = A0 unit + A2 (W/delta)^2/unit, `unit` being dynamic pressure over delta times area."""
    enough(points, 2)
    delta = points.static_Pa / SEA_LEVEL_PRESSURE_PA
    drag = points.power / points.V / delta
    X = np.stack([unit, points.lift / delta, (points.lift / delta) ** 2 / unit], axis=1)
    return Points(X, drag, drag * points.error / points.power, TWO_TERM, lift_coefficient(points, aircraft))


def mach_form(given: pd.DataFrame, runs: list[Maneuver], aircraft: Aircraft) -> Points:
    """(2.11): over Mach number."""
    points = steady_points(given, runs, aircraft)
    M = points.V / np.sqrt(GAMMA * GAS_CONSTANT_AIR * points.temperature_K)
    return _fitted(points, GAMMA * SEA_LEVEL_PRESSURE_PA * M**2 * aircraft.geometry.wing_area_m2 / 2, aircraft)


def speed_form(given: pd.DataFrame, runs: list[Maneuver], aircraft: Aircraft) -> Points:
    """(2.13): over true airspeed and temperature."""
    points = steady_points(given, runs, aircraft)
    per_R = SEA_LEVEL_PRESSURE_PA * points.V**2 / (2 * GAS_CONSTANT_AIR * points.temperature_K)
    return _fitted(points, per_R * aircraft.geometry.wing_area_m2, aircraft)


W_DELTA = Method(
    name="w-delta",
    title="W/δ",
    equations="(2.11)",
    kinds=(STEADY,),
    takes=("thrust_scale", "thrust_slope"),
    problem=mach_form,
    points=as_points,
    two_term=True,
)
W_DELTA_SLOW = Method(
    name="w-delta-low-subsonic",
    title="W/δ, low-subsonic",
    equations="(2.13)",
    kinds=(STEADY,),
    takes=("thrust_scale", "thrust_slope"),
    problem=speed_form,
    points=as_points,
    two_term=True,
)
