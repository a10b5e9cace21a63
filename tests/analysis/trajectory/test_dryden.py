"""Mean wind profile and gusts along a flight agree with the standard and the simulator."""

import numpy as np
import pytest
from scipy.linalg import expm

from flightpower.analysis.trajectory import dryden
from flightpower.flight.units import FOOT_M
from flightpower.sim.air import Air, gust_scales, mean_wind


def test_mean_wind_profile_is_the_standards_and_constant_outside_its_layer() -> None:
    air = Air(wind_mps=3.0, wind_from_rad=np.radians(310))
    heights = np.array([10.0, 20.0, 40.0, 100.0])
    north, _, _ = mean_wind(air, 0.0, 0.0, heights)
    assert dryden.mean_wind_profile(heights) / dryden.mean_wind_profile(heights)[0] == pytest.approx(north / north[0])
    below, above = (
        dryden.mean_wind_profile(np.array([-5.0, 0.0, 10 * FOOT_M])),
        dryden.mean_wind_profile(np.array([1000 * FOOT_M, 900.0])),
    )
    assert np.ptp(below) == np.ptp(above) == 0


def test_longitudinal_gusts_have_the_standards_intensity_and_length() -> None:
    heights = np.array([5.0, 40.0, 100.0])
    scales = gust_scales(4.0, heights)
    longitudinal = dryden.longitudinal(0.4, heights, 15.0)
    assert longitudinal.sigma_mps == pytest.approx(scales.sigma_u)
    assert longitudinal.time_s == pytest.approx(scales.L_u / 15.0)


def test_lateral_gusts_are_as_longitudinal_ones_and_vertical_ones_as_long_as_the_height() -> None:
    heights = np.array([5.0, 40.0, 100.0])
    scales = gust_scales(4.0, heights)
    lateral, vertical = dryden.lateral(0.4, heights, 15.0), dryden.vertical(0.4, heights, 15.0)
    assert (lateral.sigma_mps, vertical.sigma_mps) == (pytest.approx(scales.sigma_u), pytest.approx(scales.sigma_w))
    assert (lateral.time_s, vertical.time_s) == (pytest.approx(scales.L_u / 15.0), pytest.approx(scales.L_w / 15.0))


@pytest.mark.parametrize(("height", "V", "step"), [(40.0, 12.0, 0.2), (100.0, 20.0, 0.2), (20.0, 25.0, 0.2)])
def test_a_discrete_step_is_that_of_drydens_second_order_filter(height: float, V: float, step: float) -> None:
    """It agrees with the exact decay and new noise of T g1' = n - g1, T g2' = g1 - g2 over a step.

    The step assumes that g1 is linear: the decayed part is off by (step/T)^2, the new noise by a relative error of
    order step/T.
    """
    T, sigma = height / V, 0.7
    A = np.array([[-1.0, 0.0], [1.0, -1.0]]) / T
    Q = np.diag([sigma**2 / T, 0.0])
    # One matrix exponential gives the noise of a step (Van Loan 1978).
    both = expm(np.block([[-A, Q], [np.zeros((2, 2)), A.T]]) * step)
    moves = both[2:, 2:].T
    noise = moves @ both[:2, 2:]
    stays, once, twice = dryden.vertical(sigma, height, V).discretize(step)
    # As in the path's equations, g2 follows the mean of g1 before and after the step.
    follows = (1 - stays) / 2
    result = np.array([[stays, 0.0], [follows * (1 + stays), stays]])
    new = np.array([[1.0], [follows]]) * once
    spread = new @ new.T + np.diag([0.0, float(twice) ** 2])
    assert result == pytest.approx(moves, abs=(step / T) ** 2)
    assert spread == pytest.approx(noise, rel=3 * step / T)


def test_the_first_order_process_has_the_same_spectrum_at_low_and_high_frequencies() -> None:
    T, sigma = 3.0, 0.7
    first_order = dryden.SecondOrderGust(sigma, T).as_gauss_markov()

    def second_order_spectrum(x: float) -> float:
        return sigma**2 * T / np.pi * (1 + 3 * x**2) / (1 + x**2) ** 2

    def first_order_spectrum(x: float) -> float:
        t = float(first_order.time_s)
        return 2 * float(first_order.sigma_mps) ** 2 * t / np.pi / (1 + (x * t / T) ** 2)

    for x in (1e-3, 1e3):
        assert first_order_spectrum(x) == pytest.approx(second_order_spectrum(x), rel=1e-4)
