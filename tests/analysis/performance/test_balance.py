"""Checks that all forces in steady flight balance, along the path and across it."""

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.curve import Condition, lift_coefficient
from flightpower.analysis.performance.level_flight import climb_angle, drag, incidence, steady_thrust

AT = Condition(37.7, 1.19, 0.4636)
POINTS = {name: np.array([[x]]) for name, x in
       {"A0": 0.0465, "A1": -0.0195, "A2": 0.065, "alpha_0": -0.075, "alpha_CL": 0.235}.items()}  # fmt: skip
V = np.linspace(11.5, 25.0, 20)


def forces(thrust: np.ndarray, sine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the net force along and across the path [N], at the angle of attack for which that across is zero."""
    qS = AT.rho * V**2 / 2 * AT.wing_area_m2
    low, high = np.full_like(thrust, 0.0), np.full_like(thrust, 3.0)

    def across(CL: np.ndarray) -> np.ndarray:
        return qS * CL + thrust * np.sin(-0.075 + 0.235 * CL) - AT.weight_N * np.sqrt(1 - sine**2)

    for _ in range(60):
        CL = (low + high) / 2
        low, high = np.where(across(CL) < 0, CL, low), np.where(across(CL) < 0, high, CL)
    along = thrust * np.cos(-0.075 + 0.235 * CL) - drag(POINTS, V, CL, AT) - AT.weight_N * sine
    return along, across(CL)


def test_in_level_flight_nothing_is_left_over() -> None:
    thrust = steady_thrust(POINTS, V, AT)
    assert np.abs(forces(thrust, np.zeros_like(thrust))).max() < 1e-6 * AT.weight_N


@pytest.mark.parametrize("share", [0.0, 0.4, 0.8])
def test_in_a_climb_and_in_a_glide_nothing_is_left_over(share: float) -> None:
    """The cases range from a glide to a climb of 45 deg."""
    thrust = np.full((1, len(V)), share * AT.weight_N)
    sine, along_path = climb_angle(POINTS, thrust, V, AT)
    assert np.abs(forces(thrust, sine)).max() < 1e-3 * AT.weight_N
    assert np.all(along_path <= thrust)


@pytest.mark.parametrize("sine", [-0.05, 0.0, 0.2])
def test_thrust_for_a_path_climbs_or_descends_along_it(sine: float) -> None:
    thrust = steady_thrust(POINTS, V, AT, sine)
    assert np.abs(forces(thrust, np.full_like(thrust, sine))).max() < 1e-6 * AT.weight_N


def test_a_turn_takes_the_thrust_of_level_flight_at_the_weight_times_the_load_factor() -> None:
    heavy = AT._replace(weight_N=1.4 * AT.weight_N)
    np.testing.assert_allclose(steady_thrust(POINTS, V, AT, 0.0, 1.4), steady_thrust(POINTS, V, heavy), rtol=1e-12)


def test_thrust_that_carries_weight_saves_drag_at_low_speed() -> None:
    """At 11.5 m/s and 9.6 deg, thrust carries 2 % of the weight and is 0.7 % below drag over cos(alpha)."""
    CL = lift_coefficient(V, AT)
    alone = drag(POINTS, V, CL, AT) / np.cos(-0.075 + 0.235 * CL)
    saved = 1 - steady_thrust(POINTS, V, AT) / alone
    assert 0.005 < saved[0, 0] < 0.03
    assert abs(saved[0, -1]) < 0.001


def test_incidence_is_the_line_that_was_flown() -> None:
    CL = np.linspace(0.2, 1.1, 60)
    data = pd.DataFrame({"CL": CL, "alpha": -0.075 + 0.235 * CL, "covered": True})
    data.loc[5, "alpha"], data.loc[9, "CL"] = np.nan, np.nan
    data.loc[20, ["alpha", "covered"]] = 1.0, False  # outside the propeller table
    result = incidence(data)
    assert result.names == ("alpha_0", "alpha_CL")
    assert result.values == pytest.approx([-0.075, 0.235])
