"""Changes of thrust show that motor speed lags the IMU; thrust near zero shows whether blades fold or windmill."""

import numpy as np
import pytest
from constructed import AIRCRAFT, PROPELLER, RHO, STEP_S, accelerations_and_decelerations, flown, measured, polar

from flightpower.analysis.maneuvers.kinds import Maneuver
from flightpower.analysis.methods.dynamic import estimate_polar
from flightpower.analysis.methods.motor_lag import PARAMETER
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.propeller import FOLD

CL = np.array([0.3, 0.6, 0.9])


def flight(late_s: float) -> tuple[Trajectory, list[Maneuver]]:
    """Return two accelerations and two decelerations with a moving throttle and motor speed that is `late_s` late.

    The forward accelerometer has noise.
    """
    t_s = np.arange(0.0, 80.0, STEP_S)
    f = flown(17 - 5.5 * np.cos(2 * np.pi * t_s / 40) + 0.3 * np.sin(2 * np.pi * t_s / 5), polar(), RHO)
    trajectory = measured(f)
    means = trajectory.block_means.means
    means["ax_mps2"] = means["ax_mps2"] + np.random.default_rng(5).normal(0, 0.02, len(f))
    means["n_revps"] = np.interp(t_s - late_s, t_s, means["n_revps"])
    kinds = ("acceleration", "deceleration") * 2
    return trajectory, [
        Maneuver(kind, slice(500 * i, 500 * (i + 1)), 20.0 * i + 1, 20.0 * i + 19, 11.5, 22.5, 0.0)
        for i, kind in enumerate(kinds)
    ]


@pytest.mark.parametrize("late_s", [0.15, -0.1])
def test_a_late_motor_speed_is_found_and_the_polar_is_right(late_s: float) -> None:
    result = estimate_polar(*flight(late_s), AIRCRAFT, PROPELLER)
    assert result.joint is not None
    assert result.joint.parameters.value[result.joint.names.index(PARAMETER)] == pytest.approx(late_s, abs=0.02)
    powers = np.vander(CL, 3, increasing=True)
    error = np.abs(powers @ (result.polar.A - polar())) / (powers @ polar())
    assert error.max() < 0.035, "only terms of second order in the lag may remain"
    assert "doubt of the motor speed" in result.joint.parameters.shared


def test_a_motor_speed_in_time_has_no_lag() -> None:
    polar = estimate_polar(*flight(0.0), AIRCRAFT, PROPELLER)
    assert polar.joint is not None and PARAMETER not in polar.joint.names


def test_runs_with_little_thrust_tell_blades_that_fold_from_those_that_windmill() -> None:
    """In the decelerations the propeller windmills. A gain beyond 18 leaves no doubt."""
    f, runs = accelerations_and_decelerations(gamma=-0.1)
    trajectory = measured(f)
    means = trajectory.block_means.means
    means["ax_mps2"] = means["ax_mps2"] + np.random.default_rng(5).normal(0, 0.02, len(f))
    right = estimate_polar(trajectory, runs, AIRCRAFT, PROPELLER)
    wrong = estimate_polar(trajectory, runs, AIRCRAFT, PROPELLER.with_beyond_zero_thrust(FOLD))
    assert right.other_blades_gain < -18 and wrong.other_blades_gain > 18
    level, runs = accelerations_and_decelerations()
    assert estimate_polar(measured(level), runs, AIRCRAFT, PROPELLER).other_blades_gain == 0.0, (
        "thrust never gets near zero"
    )
