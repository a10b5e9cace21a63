"""PIW-VIW: power and speed made independent of weight and density, from steady level points (2.1)-(2.6).

PIW VIW = m0 VIW^4 + b0 is a straight line only for a polar with least drag at zero lift; a CL_minD adds a term
m1 VIW^2. Both forms are linear in the polar: m0 = rho_sl S A0/2, m1 = W_s A1, b0 = 2 W_s^2 A2/(rho_sl S).
"""

import numpy as np
from numpy.typing import NDArray

from analysis.drag.regression import THREE_TERM, TWO_TERM
from analysis.drag.steady_points import SteadyMeans, steady_method
from flight.aircraft import Aircraft
from flight.atmosphere import SEA_LEVEL_DENSITY

Array = NDArray[np.float64]


def piw_viw(points: SteadyMeans, aircraft: Aircraft) -> tuple[Array, Array]:
    """PIW (2.5) [W] and VIW (2.3) [m/s], each (n,), for the aircraft's standard weight at sea level."""
    sigma, w = points.rho / SEA_LEVEL_DENSITY, points.lift_N / aircraft.mass.standard_weight_N
    return points.power_W * np.sqrt(sigma) / w**1.5, points.V * np.sqrt(sigma / w)


def _regression(points: SteadyMeans, aircraft: Aircraft) -> tuple[Array, Array]:
    PIW, VIW = piw_viw(points, aircraft)
    S, Ws = aircraft.geometry.wing_area_m2, aircraft.mass.standard_weight_N
    q = SEA_LEVEL_DENSITY * S / 2
    return np.stack([q * VIW**4, Ws * VIW**2, np.full_like(VIW, Ws**2 / q)], axis=1), PIW * VIW


PIW_VIW_THREE = steady_method(
    "piw-viw", "PIW-VIW, three terms", "(2.1)-(2.6) with the term in VIW^2", THREE_TERM, _regression
)
PIW_VIW_TWO = steady_method("piw-viw-two-term", "PIW-VIW, two terms", "(2.1)-(2.6)", TWO_TERM, _regression)
