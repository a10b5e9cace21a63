"""The balance of forces in steady flight: thrust points up by the angle of attack and carries some of the weight.

L + T sin(alpha) = W cos(gamma) and T cos(alpha) = D + W sin(gamma): (3.21) and (3.22) without accelerations. Power
required is D V at L = W, by its definition (1.3); what propeller and battery do to fly level, and how fast full
throttle climbs, follow from these.

The angle of attack is a straight line over lift, `incidence`, taken as known: a quarter of a degree changes a climb by
0.1 %.
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag.polar import Condition
from analysis.performance.propagation import Numbers, known

Array = NDArray[np.float64]

ROUNDS = 6  # each a tenth of the last in what it changes
FEWEST_BLOCKS = 20
STEEPEST = 0.99  # sine of an angle of climb


def incidence(data: pd.DataFrame) -> Numbers:
    """alpha_0 and alpha_CL: angle of attack [rad] = alpha_0 + alpha_CL C_L, by a flight's own blocks.

    data : columns CL, alpha, covered (by the propeller's table, well above the ground); NaN gaps. Too few of them:
    thrust along the path.
    """
    flown = data.loc[data["covered"], ["CL", "alpha"]].dropna()
    if len(flown) < FEWEST_BLOCKS:
        return known(alpha_0=0.0, alpha_CL=0.0)
    slope, offset = np.polyfit(flown["CL"], flown["alpha"], 1)
    return known(alpha_0=float(offset), alpha_CL=float(slope))


def drag(row: dict[str, Array], V: Array, CL: Array, at: Condition) -> Array:
    """Drag [N] of the polar at V (k,) and C_L.

    row : nudged numbers (2m + 1, 1): A0, A1, A2; for what follows alpha_0, alpha_CL too
    """
    return _qS(V, at) * (row["A0"] + row["A1"] * CL + row["A2"] * CL**2)


def level_thrust(row: dict[str, Array], V: Array, at: Condition) -> Array:
    """Thrust [N] that flies level at V (k,): a little more than drag along it, a little less for what it carries."""
    carried = np.zeros(1)
    for _ in range(ROUNDS):
        CL = (at.weight_N - carried) / _qS(V, at)
        alpha = row["alpha_0"] + row["alpha_CL"] * CL
        thrust = drag(row, V, CL, at) / np.cos(alpha)
        carried = thrust * np.sin(alpha)
    return thrust


def climb_of(row: dict[str, Array], thrust: Array, V: Array, at: Condition) -> tuple[Array, Array]:
    """Sine of the angle of climb, and thrust along the path [N], of a thrust [N] at V (k,)."""
    carried, sine = np.zeros(1), np.zeros(1)
    for _ in range(ROUNDS):
        CL = (at.weight_N * np.sqrt(1 - sine**2) - carried) / _qS(V, at)
        alpha = row["alpha_0"] + row["alpha_CL"] * CL
        along, carried = thrust * np.cos(alpha), thrust * np.sin(alpha)
        sine = np.clip((along - drag(row, V, CL, at)) / at.weight_N, -STEEPEST, STEEPEST)
    return sine, along


def _qS(V: Array, at: Condition) -> Array:
    return at.rho * V**2 / 2 * at.wing_area_m2
