"""Local quadratics equal SciPy's Savitzky-Golay filter, to the digit."""

import numpy as np
import pytest
from scipy.signal import savgol_filter

from flightpower.analysis.sources.grid import local_quadratic


@pytest.mark.parametrize("derivative", [0, 1])
@pytest.mark.parametrize(("window", "n"), [(3, 3), (5, 6), (25, 200), (77, 77)])
def test_it_is_the_filter_of_savitzky_and_golay(window: int, n: int, derivative: int) -> None:
    values = np.random.default_rng(n).standard_normal(n).cumsum()
    expected = savgol_filter(values, window, 2, deriv=derivative, delta=0.04)
    np.testing.assert_array_equal(local_quadratic(values, window, derivative, 0.04), expected)


def test_a_parabola_is_kept_with_its_slope_up_to_the_ends() -> None:
    t = np.arange(50) * 0.2
    np.testing.assert_allclose(local_quadratic(3 - t + 0.5 * t**2, 11), 3 - t + 0.5 * t**2, rtol=1e-12)
    np.testing.assert_allclose(local_quadratic(3 - t + 0.5 * t**2, 11, 1, 0.2), t - 1, atol=1e-11)
