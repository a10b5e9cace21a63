"""How the wind is taken to change along a flight."""

import numpy as np
import pytest
from scipy.linalg import expm

from analysis.path import gusts
from sim.air import Air, dryden_scales, mean_wind


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


def test_horizontal_gusts_are_as_strong_and_as_long_as_in_the_standard() -> None:
    heights = np.array([5.0, 40.0, 100.0])
    scales = dryden_scales(4.0, heights)
    found = gusts.horizontal(0.4, heights, 15.0)
    assert found.sigma_mps == pytest.approx(scales.sigma_u)
    assert found.time_s == pytest.approx(scales.L_u / 15.0)


@pytest.mark.parametrize(("height", "V", "step"), [(40.0, 12.0, 0.2), (100.0, 20.0, 0.2), (20.0, 25.0, 0.2)])
def test_a_step_of_vertical_gusts_is_that_of_drydens_filter(height: float, V: float, step: float) -> None:
    """Against the exact solution of T w1' = n - w1, T w2' = w1 - w2 over a step: what stays, and the noise that is new.

    The step takes w1 as straight: what stays is off by (step/T)^2, new noise by the order of step/T of itself.
    """
    T, sigma = height / V, 0.7
    A = np.array([[-1.0, 0.0], [1.0, -1.0]]) / T
    Q = np.diag([sigma**2 / T, 0.0])
    # Van Loan (1978): the noise of a step from one matrix exponential.
    both = expm(np.block([[-A, Q], [np.zeros((2, 2)), A.T]]) * step)
    moves = both[2:, 2:].T
    noise = moves @ both[:2, 2:]
    here = gusts.vertical_step(sigma, height, V, step)
    # As the path's equations have it: w2 follows the mean of w1 before and after.
    follows = (1 - here.stays) / 2
    found = np.array([[here.stays, 0.0], [follows * (1 + here.stays), here.stays]])
    new = np.array([[1.0], [follows]]) * here.sigma_once
    spread = new @ new.T + np.diag([0.0, float(here.sigma_twice) ** 2])
    assert found == pytest.approx(moves, abs=(step / T) ** 2)
    assert spread == pytest.approx(noise, rel=3 * step / T)
