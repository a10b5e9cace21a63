"""The optimum is that of SciPy's trust-region method, to the digit."""

import numpy as np
import pytest
from scipy import optimize

from analysis.electrical.least_squares import least_squares


@pytest.mark.parametrize("start", [(1.0, 0.5, 0.0), (8.0, -3.0, 5.0), (0.0, 0.0, 0.0)])
def test_an_exponential_is_fitted_as_by_scipy(start: tuple[float, ...]) -> None:
    t = np.linspace(0, 3, 40)
    z = 2 * np.exp(-1.3 * t) + 0.4 + 0.05 * np.random.default_rng(1).normal(size=40)
    scale = np.array([1.0, 0.5, 2.0])

    def residual(x: np.ndarray) -> np.ndarray:
        return x[0] * np.exp(x[1] * t) + x[2] - z

    expected = optimize.least_squares(residual, np.array(start), x_scale=scale, ftol=1e-6, xtol=1e-6)
    x, J = least_squares(residual, np.array(start), scale, 1e-6)
    np.testing.assert_array_equal(x, expected.x)
    np.testing.assert_array_equal(J, expected.jac)
