"""The drag polar is fitted only to moments of a run that belong to level flight."""

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.maneuvers.kinds import Maneuver
from flightpower.analysis.methods.dynamic import _within_level_flight
from flightpower.flight.units import GRAVITY_MPS2

STEP_S, SLOW_MPS, FAST_MPS = 0.2, 11.0, 24.0
LIFT_AT = 81.0  # weight over rho S / 2 [m^2/s^2]: C_L = 0.67 times load factor at 11 m/s
ALPHA_0, ALPHA_CL = np.radians(-4.3), np.radians(13.4)


def flight(V: np.ndarray, load: np.ndarray) -> pd.DataFrame:
    CL = LIFT_AT / V**2 * load
    t = STEP_S * np.arange(len(V))
    return pd.DataFrame(
        {"CL": CL, "alpha": ALPHA_0 + ALPHA_CL * CL, "qS_over_m_mps2": GRAVITY_MPS2 * V**2 / LIFT_AT}, index=t
    )


def run(start_s: float, end_s: float) -> Maneuver:
    return Maneuver("deceleration", slice(0, 1), start_s, end_s, SLOW_MPS, FAST_MPS, 0.0)


def test_all_of_a_deceleration_in_still_air_counts_even_if_the_flight_was_fast() -> None:
    """Twenty minutes include a deceleration of twenty seconds to near the stall; the load factor varies by 3 %."""
    V = np.r_[np.full(5900, FAST_MPS), np.linspace(FAST_MPS, SLOW_MPS, 100)]
    forces = flight(V, 1 + 0.03 * np.sin(np.arange(len(V))))
    assert _within_level_flight(forces, np.ones(len(V), dtype=bool), [run(1180.0, 1200.0)]).all()


@pytest.mark.parametrize("load", [1.3, 1.6])
def test_a_gust_s_peak_near_the_stall_does_not_count_and_one_in_fast_flight_does(load: float) -> None:
    V = np.linspace(FAST_MPS, SLOW_MPS, 500)
    loads = np.ones(500)
    slow, fast = 480, 20
    loads[[slow, fast]] = load
    level = _within_level_flight(flight(V, loads), np.ones(500, dtype=bool), [run(0.0, 100.0)])
    assert np.flatnonzero(~level).tolist() == [slow]
