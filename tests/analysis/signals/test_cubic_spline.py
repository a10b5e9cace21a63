"""The cubic spline gives the numbers of SciPy's, whose not-a-knot condition is the default."""

import numpy as np
import pytest
from scipy import interpolate

from analysis.signals.cubic_spline import CubicSpline


@pytest.mark.parametrize("n", [4, 5, 40])
def test_value_and_derivative_are_those_of_scipy_also_beyond_the_ends(n):
    rng = np.random.default_rng(n)
    x = np.cumsum(rng.uniform(0.1, 1.0, n))
    values = rng.standard_normal((n, 3))
    at = np.r_[x[0] - 0.5, x, rng.uniform(x[0], x[-1], 50), x[-1] + 0.5]
    expected = interpolate.CubicSpline(x, values)
    ours = CubicSpline(x, values)
    assert ours(at) == pytest.approx(expected(at), rel=1e-11, abs=1e-11)
    assert ours(at, 1) == pytest.approx(expected(at, 1), rel=1e-11, abs=1e-10)


def test_a_cubic_is_reproduced_and_one_column_needs_no_second_axis():
    x = np.array([0.0, 0.3, 1.0, 1.2, 2.0])
    spline, at = CubicSpline(x, x**3 - 2 * x), np.linspace(-1, 3, 9)
    assert spline(at) == pytest.approx(at**3 - 2 * at)
    assert spline(at, 1) == pytest.approx(3 * at**2 - 2)


@pytest.mark.parametrize("x", [[0.0, 1.0, 2.0], [0.0, 1.0, 1.0, 2.0], [0.0, 1.0, np.nan, 2.0]])
def test_too_few_points_or_points_out_of_order_are_refused(x):
    with pytest.raises(ValueError, match="4 points in increasing order"):
        CubicSpline(np.array(x), np.zeros(len(x)))
