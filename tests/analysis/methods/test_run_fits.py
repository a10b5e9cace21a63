"""The report draws for each run the speed and angle of attack from the trajectory and its sensor errors."""

from dataclasses import replace

import numpy as np
import pytest
from constructed import AIRCRAFT, PROPELLER, accelerations_and_decelerations, measured

from flightpower.analysis.methods.dynamic import estimate_polar
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS


def test_speed_drawn_is_that_of_the_trajectory_times_the_scale_error_of_the_probe() -> None:
    """If the probe reads 3 % too high, the modeled airspeed is drawn 3 % above the speed of the trajectory."""
    flight, runs = accelerations_and_decelerations()
    trajectory = measured(flight)
    errors = trajectory.sensor_errors.copy()
    errors[SENSOR_ERRORS.index("V_scale")] = 0.03
    plain, scaled = (
        estimate_polar(item, runs, AIRCRAFT, PROPELLER).fits[0].modeled["V, m/s"]
        for item in (trajectory, replace(trajectory, sensor_errors=errors))
    )
    before = 1 + trajectory.sensor_errors[SENSOR_ERRORS.index("V_scale")]
    assert np.asarray(scaled) / np.asarray(plain) == pytest.approx(1.03 / before, rel=1e-6)
