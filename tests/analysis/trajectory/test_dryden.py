"""How the wind is taken to change along a flight."""

import numpy as np
import pytest
from scipy.linalg import expm

from analysis.trajectory import dryden as gusts
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


def test_gusts_along_the_flight_are_as_strong_and_as_long_as_in_the_standard() -> None:
    heights = np.array([5.0, 40.0, 100.0])
    scales = dryden_scales(4.0, heights)
    found = gusts.along(0.4, heights, 15.0)
    assert found.sigma_mps == pytest.approx(scales.sigma_u)
    assert found.time_s == pytest.approx(scales.L_u / 15.0)


def test_lateral_gusts_are_as_those_along_the_flight_and_vertical_ones_as_long_as_high() -> None:
    heights = np.array([5.0, 40.0, 100.0])
    scales = dryden_scales(4.0, heights)
    across, down = gusts.across(0.4, heights, 15.0), gusts.vertical(0.4, heights, 15.0)
    assert (across.sigma_mps, down.sigma_mps) == (pytest.approx(scales.sigma_u), pytest.approx(scales.sigma_w))
    assert (across.time_s, down.time_s) == (pytest.approx(scales.L_u / 15.0), pytest.approx(scales.L_w / 15.0))


@pytest.mark.parametrize(("height", "V", "step"), [(40.0, 12.0, 0.2), (100.0, 20.0, 0.2), (20.0, 25.0, 0.2)])
def test_a_step_of_gusts_across_is_that_of_drydens_filter(height: float, V: float, step: float) -> None:
    """Against the exact solution of T g1' = n - g1, T g2' = g1 - g2 over a step: what stays, and the noise that is new.

    The step takes g1 as straight: what stays is off by (step/T)^2, new noise by the order of step/T of itself.
    """
    T, sigma = height / V, 0.7
    A = np.array([[-1.0, 0.0], [1.0, -1.0]]) / T
    Q = np.diag([sigma**2 / T, 0.0])
    # Van Loan (1978): the noise of a step from one matrix exponential.
    both = expm(np.block([[-A, Q], [np.zeros((2, 2)), A.T]]) * step)
    moves = both[2:, 2:].T
    noise = moves @ both[:2, 2:]
    stays, once, twice = gusts.vertical(sigma, height, V).step(step)
    # As the path's equations have it: g2 follows the mean of g1 before and after.
    follows = (1 - stays) / 2
    found = np.array([[stays, 0.0], [follows * (1 + stays), stays]])
    new = np.array([[1.0], [follows]]) * once
    spread = new @ new.T + np.diag([0.0, float(twice) ** 2])
    assert found == pytest.approx(moves, abs=(step / T) ** 2)
    assert spread == pytest.approx(noise, rel=3 * step / T)


def test_the_first_order_process_agrees_with_gusts_across_for_slow_and_for_quick_changes() -> None:
    T, sigma = 3.0, 0.7
    alike = gusts.Swaying(sigma, T).as_gauss_markov()

    def dryden(x: float) -> float:
        return sigma**2 * T / np.pi * (1 + 3 * x**2) / (1 + x**2) ** 2

    def first_order(x: float) -> float:
        t = float(alike.time_s)
        return 2 * float(alike.sigma_mps) ** 2 * t / np.pi / (1 + (x * t / T) ** 2)

    for x in (1e-3, 1e3):
        assert first_order(x) == pytest.approx(dryden(x), rel=1e-4)
