"""Derived quantities of a flight whose forces are in exact balance, and their standard errors from single causes."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flightpower.analysis.pages.exports.derived import derived
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS, STATES
from flightpower.flight.aircraft import Uncertainty

sys.path.append(str(Path(__file__).parents[1] / "drag"))
from constructed import AIRCRAFT, PROPELLER, S, accelerations_and_decelerations, m, measured, polar

CERTAIN = replace(AIRCRAFT, uncertainty=Uncertainty(weight_fraction=0, thrust_scale_fraction=0, thrust_slope=0))
FLOWN, _ = accelerations_and_decelerations(0.03)
QS_N = FLOWN["rho"] * FLOWN["V"] ** 2 / 2 * S
THRUST_N, ALPHA = FLOWN["thrust_x_over_m_mps2"] * m, FLOWN["alpha"]


def standard_error(name: str, trajectory=None, aircraft=CERTAIN) -> np.ndarray:
    table = derived(trajectory or measured(FLOWN), aircraft, PROPELLER)
    return table[f"{name}_standard_error"].to_numpy()


def test_quantities_are_those_of_the_flight() -> None:
    table = derived(measured(FLOWN), CERTAIN, PROPELLER)
    assert table["V_mps"].to_numpy() == pytest.approx(FLOWN["V"].to_numpy())
    assert table["alpha_rad"].to_numpy() == pytest.approx(ALPHA.to_numpy())
    assert table["theta_rad"].to_numpy() == pytest.approx(ALPHA.to_numpy() + 0.03)
    assert table["thrust_N"].to_numpy() == pytest.approx(THRUST_N.to_numpy(), rel=1e-6)
    CL = table["C_L"].to_numpy()
    assert table["C_D"].to_numpy() == pytest.approx(np.polynomial.polynomial.polyval(CL, polar()), rel=1e-5)
    within = THRUST_N > 0.5  # the table's continuation beyond zero thrust has an error of its own
    assert np.nanmax(standard_error("thrust_N")[within]) < 0.05
    assert np.max(standard_error("V_mps")) < 1e-6 and np.max(standard_error("theta_rad")) < 1e-6


def test_a_weight_that_is_not_known_changes_the_forces_and_no_angle() -> None:
    """Forces change in proportion to the specific force; thrust from the table and its contribution do not."""
    unsure = replace(CERTAIN, uncertainty=replace(CERTAIN.uncertainty, weight_fraction=0.01))
    of_lift = 0.01 * m * np.abs(FLOWN["ax"] * np.sin(ALPHA) - FLOWN["az"] * np.cos(ALPHA)) / QS_N
    result = np.sqrt(standard_error("C_L", aircraft=unsure) ** 2 - standard_error("C_L") ** 2)
    assert result == pytest.approx(of_lift.to_numpy(), rel=1e-3)
    assert np.max(standard_error("alpha_rad", aircraft=unsure)) < 1e-6
    assert standard_error("thrust_N", aircraft=unsure) == pytest.approx(standard_error("thrust_N"), abs=1e-6)


def test_an_accelerometer_s_bias_changes_drag_by_mass_times_it() -> None:
    trajectory = measured(FLOWN)
    covariance = trajectory.covariance.copy()
    i = SENSOR_ERRORS.index("ax_bias")
    covariance[i, i] = 0.05**2
    error = standard_error("C_D", replace(trajectory, covariance=covariance))
    by_bias = np.sqrt(error**2 - standard_error("C_D") ** 2)
    assert by_bias == pytest.approx((0.05 * m * np.cos(ALPHA) / QS_N).to_numpy(), rel=1e-3)


def test_states_move_with_the_sensor_errors() -> None:
    """A sensor error of 0.01, to which pitch attitude has a sensitivity of 2, gives it an error of 0.02."""
    trajectory = measured(FLOWN)
    covariance, sensitivity = trajectory.covariance.copy(), trajectory.state_sensitivity.copy()
    covariance[0, 0] = 0.01**2
    sensitivity[:, STATES.index("theta"), 0] = 2.0
    error = standard_error("theta_rad", replace(trajectory, covariance=covariance, state_sensitivity=sensitivity))
    assert error == pytest.approx(np.full(len(FLOWN), 0.02), rel=1e-6)


def test_random_errors_of_the_states_are_those_of_the_draws() -> None:
    """The standard error is the root mean square of the draws."""
    trajectory = measured(FLOWN)
    draws = np.zeros((4, len(FLOWN), len(STATES)))
    draws[:, :, STATES.index("theta")] = np.array([0.01, -0.02, 0.02, -0.01])[:, None]
    error = standard_error("theta_rad", replace(trajectory, draws=draws))
    assert error == pytest.approx(np.full(len(FLOWN), np.sqrt(2.5e-4)), rel=1e-6)


def with_first_rows_at(speed_mps: float):
    """The flight, with its first five instants at another speed."""
    trajectory = measured(FLOWN)
    states = trajectory.states.copy()
    states.iloc[:5, STATES.index("v_north")], states.iloc[:5, STATES.index("v_down")] = speed_mps, 0.0
    return derived(replace(trajectory, states=states), CERTAIN, PROPELLER)


@pytest.mark.parametrize(("speed_mps", "defined"), [(3.5, False), (3.8, True)])
def test_nothing_is_reported_below_8_Pa_of_dynamic_pressure(speed_mps: float, defined: bool) -> None:
    result = with_first_rows_at(speed_mps)
    assert result.iloc[:5][["V_mps", "theta_rad", "theta_rad_standard_error"]].notna().all(axis=None) == defined
    assert result.iloc[5:].notna().all(axis=None)


@pytest.mark.parametrize(("height_m", "defined"), [(19.0, False), (21.0, True)])
def test_coefficients_are_left_out_near_the_ground(height_m: float, defined: bool) -> None:
    """On the ground roll, even a fast one, the wheels carry weight, so C_L and C_D are not those of flight."""
    low = FLOWN.copy()
    low.loc[low.index[:5], "height_measured"] = height_m
    table = derived(measured(low), CERTAIN, PROPELLER)
    assert table.iloc[:5][["C_L", "C_D", "C_L_standard_error"]].notna().all(axis=None) == defined
    assert table.iloc[:5][["V_mps", "alpha_rad"]].notna().all(axis=None)
    assert table.iloc[5:].notna().all(axis=None)
