"""How the wind is taken to change along a flight."""

import numpy as np
import pytest

from analysis.path import gusts
from sim.air import Air, mean_wind


def test_wind_grows_with_height_as_in_the_standard_and_no_further_than_its_layer() -> None:
    air = Air(wind_mps=3.0, wind_from_rad=np.radians(310))
    heights = np.array([10.0, 20.0, 40.0, 100.0])
    north, _, _ = mean_wind(air, 0.0, 0.0, heights)
    assert gusts.profile(heights) / gusts.profile(heights)[0] == pytest.approx(north / north[0])
    below, above = (
        gusts.profile(np.array([-5.0, 0.0, gusts.LOWEST_M])),
        gusts.profile(np.array([gusts.HIGHEST_M, 900.0])),
    )
    assert np.ptp(below) == np.ptp(above) == 0
