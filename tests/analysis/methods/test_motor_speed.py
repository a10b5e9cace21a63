"""Wrong counts of motor speed, by lost pulses or by a wrong number of poles, are found, and the polar is right."""

import numpy as np
import pytest
from constructed import AIRCRAFT, PROPELLER, accelerations_and_decelerations, measured, polar

from flightpower.analysis.methods.dynamic import estimate_polar
from flightpower.analysis.methods.forces import FlightForces, MotorSpeedError
from flightpower.analysis.methods.motor_speed import PARAMETER
from flightpower.analysis.trajectory.reconstruction import Trajectory

CL = np.array([0.3, 0.6, 0.9])
LOST, ABOVE_REVPS = 0.03, 90.0


def flight(*, lost: float = 0.0, above_revps: float = 0.0, noise_mps2: float = 0.02) -> tuple[Trajectory, list]:
    """Return an exact flight with noise in the forward accelerometer and a share of pulses lost, and its runs."""
    f, runs = accelerations_and_decelerations()
    trajectory = measured(f)
    means = trajectory.block_means.means
    means["ax_mps2"] = means["ax_mps2"] + np.random.default_rng(3).normal(0, noise_mps2, len(f))
    n = means["n_revps"]
    means["n_revps"] = np.where(n > above_revps, (1 - lost) * n, n)
    return trajectory, runs


def drag(A: np.ndarray) -> np.ndarray:
    return np.vander(CL, 3, increasing=True) @ A


@pytest.mark.parametrize(("lost", "above_revps"), [(LOST, ABOVE_REVPS), (1 / 7, 0.0), (-1 / 6, 0.0)])
def test_a_wrong_count_is_found_and_the_polar_is_right(lost: float, above_revps: float) -> None:
    trajectory, runs = flight(lost=lost, above_revps=above_revps)
    result = estimate_polar(trajectory, runs, AIRCRAFT, PROPELLER)
    sound = estimate_polar(*flight(), AIRCRAFT, PROPELLER)
    assert result.joint is not None
    share = result.joint.parameters.value[result.joint.names.index(PARAMETER)]
    # Part of the loss looks like a thrust scale, as far as its prior allows: 1.8 % of thrust are 0.9 % of motor speed.
    assert 1 + share == pytest.approx(1 / (1 - lost), abs=0.02 if above_revps == 0 else 0.015)
    powers = np.vander(CL, 3, increasing=True)
    error = np.sqrt(np.einsum("ij,jk,ik->i", powers, result.polar.covariance, powers))
    assert np.all(np.abs(drag(result.polar.A) - drag(polar())) < 2.5 * error)
    uncertain = np.sqrt(np.einsum("ij,jk,ik->i", powers, sound.polar.covariance, powers))
    assert np.all(error > 0.99 * uncertain), "estimating one more error must not narrow the interval"
    assert any("than counted" in warning for warning in result.warnings)


def test_a_sound_count_and_a_propeller_off_its_table_are_left_alone() -> None:
    f, runs = accelerations_and_decelerations()
    for trajectory in (flight()[0], measured(f, 0.06), measured(f, 0.0, 0.2)):
        polar = estimate_polar(trajectory, runs, AIRCRAFT, PROPELLER)
        assert polar.joint is not None and PARAMETER not in polar.joint.names


def test_the_derivative_by_motor_speed_predicts_the_thrust_of_a_corrected_one() -> None:
    trajectory, _ = flight()
    error = MotorSpeedError(ABOVE_REVPS, 0.001)
    counted, corrected = (
        FlightForces(trajectory, AIRCRAFT, PROPELLER, motor_speed=item).nominal
        for item in (error._replace(share=0.0), error)
    )
    change = corrected["thrust_along_V_over_m_mps2"] - counted["thrust_along_V_over_m_mps2"]
    fast = (counted["n"] > ABOVE_REVPS).to_numpy()
    assert fast.any() and not fast.all()
    assert change[~fast].to_numpy() == pytest.approx(0.0)
    expected = error.share * counted["thrust_by_motor_speed"][fast].to_numpy()
    assert change[fast].to_numpy() == pytest.approx(expected, rel=0.07)  # largest at kinks of the table
