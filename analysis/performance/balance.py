"""Balance of forces in steady flight, with the part of the weight that thrust carries.

L + T sin(alpha) = W cos(gamma) and T cos(alpha) = D + W sin(gamma): (3.21) and (3.22) without accelerations. Power
required is D V at L = W by its definition (1.3). The thrust of level flight and the climb at full throttle follow from
the balance here.

The angle of attack is a straight line over C_L, fitted by `incidence` and taken as exact: a quarter of a degree changes
a climb by 0.1 %.

Units: thrust and drag in N, V in m/s, angles in rad.
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag.polar import Condition
from analysis.performance.propagation import ParameterVector, SigmaPoints, exact

Array = NDArray[np.float64]

ITERATIONS = 6  # each changes the result by a tenth of the change before
FEWEST_BLOCKS = 20
STEEPEST_SINE = 0.99  # of the angle of climb


def incidence(data: pd.DataFrame) -> ParameterVector:
    """alpha_0 and alpha_CL of alpha [rad] = alpha_0 + alpha_CL C_L, fitted to the flight.

    data : columns CL, alpha, covered (inside the propeller's table, well above the ground); NaN gaps. With fewer than
    FEWEST_BLOCKS rows both are zero: thrust along the flight path.
    """
    flown = data.loc[data["covered"], ["CL", "alpha"]].dropna()
    if len(flown) < FEWEST_BLOCKS:
        return exact(alpha_0=0.0, alpha_CL=0.0)
    slope, offset = np.polyfit(flown["CL"], flown["alpha"], 1)
    return exact(alpha_0=float(offset), alpha_CL=float(slope))


def drag(parameters: SigmaPoints, V: Array, CL: Array, condition: Condition) -> Array:
    """Drag [N] of the polar at V (k,) [m/s] and C_L, (2m + 1, k). parameters : A0, A1, A2"""
    return _qS(V, condition) * (parameters["A0"] + parameters["A1"] * CL + parameters["A2"] * CL**2)


def level_thrust(parameters: SigmaPoints, V: Array, condition: Condition) -> Array:
    """Thrust [N] of level flight at V (k,) [m/s], (2m + 1, k). parameters : A0, A1, A2, alpha_0, alpha_CL

    1/cos(alpha) makes it larger than drag; the weight that it carries reduces lift, and with it drag.
    """
    carried_N = np.zeros(1)
    for _ in range(ITERATIONS):
        CL = (condition.weight_N - carried_N) / _qS(V, condition)
        alpha = parameters["alpha_0"] + parameters["alpha_CL"] * CL
        thrust_N = drag(parameters, V, CL, condition) / np.cos(alpha)
        carried_N = thrust_N * np.sin(alpha)
    return thrust_N


def climb_angle(parameters: SigmaPoints, thrust_N: Array, V: Array, condition: Condition) -> tuple[Array, Array]:
    """sin(gamma), and thrust along the flight path [N], each (2m + 1, k), at V (k,) [m/s].

    parameters : A0, A1, A2, alpha_0, alpha_CL     thrust_N : (2m + 1, k), along the propeller's axis
    """
    carried_N, sine = np.zeros(1), np.zeros(1)
    for _ in range(ITERATIONS):
        CL = (condition.weight_N * np.sqrt(1 - sine**2) - carried_N) / _qS(V, condition)
        alpha = parameters["alpha_0"] + parameters["alpha_CL"] * CL
        along_path_N, carried_N = thrust_N * np.cos(alpha), thrust_N * np.sin(alpha)
        excess_N = along_path_N - drag(parameters, V, CL, condition)
        sine = np.clip(excess_N / condition.weight_N, -STEEPEST_SINE, STEEPEST_SINE)
    return sine, along_path_N


def _qS(V: Array, condition: Condition) -> Array:
    """Dynamic pressure times wing area [N]."""
    return condition.rho * V**2 / 2 * condition.wing_area_m2
