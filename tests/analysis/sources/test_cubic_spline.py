"""The cubic spline gives the numbers of SciPy's (not-a-knot); on a grid it invents nothing in a gap."""

import numpy as np
import pytest
from scipy import interpolate

from flightpower.analysis.sources.grid import CubicSpline, on_grid


@pytest.mark.parametrize("n", [4, 5, 40])
def test_value_and_derivative_are_those_of_scipy_also_beyond_the_ends(n):
    rng = np.random.default_rng(n)
    x = np.cumsum(rng.uniform(0.1, 1.0, n))
    values = rng.standard_normal((n, 3))
    points = np.r_[x[0] - 0.5, x, rng.uniform(x[0], x[-1], 50), x[-1] + 0.5]
    expected = interpolate.CubicSpline(x, values)
    ours = CubicSpline(x, values)
    assert ours(points) == pytest.approx(expected(points), rel=1e-11, abs=1e-11)
    assert ours(points, 1) == pytest.approx(expected(points, 1), rel=1e-11, abs=1e-10)


def test_a_cubic_is_reproduced_and_one_column_needs_no_second_axis():
    x = np.array([0.0, 0.3, 1.0, 1.2, 2.0])
    spline, points = CubicSpline(x, x**3 - 2 * x), np.linspace(-1, 3, 9)
    assert spline(points) == pytest.approx(points**3 - 2 * points)
    assert spline(points, 1) == pytest.approx(3 * points**2 - 2)


@pytest.mark.parametrize("x", [[0.0, 1.0, 2.0], [0.0, 1.0, 1.0, 2.0], [0.0, 1.0, np.nan, 2.0]])
def test_too_few_points_or_points_out_of_order_are_refused(x):
    with pytest.raises(ValueError, match="4 points in increasing order"):
        CubicSpline(np.array(x), np.zeros(len(x)))


GRID = np.arange(0, 10, 0.04)


def signal(t):
    return np.sin(2 * np.pi * 0.5 * t)


def test_a_channel_sampled_late_and_unevenly_lands_on_the_grid() -> None:
    rng = np.random.default_rng(3)
    taken = GRID + 0.013 + rng.uniform(-0.004, 0.004, len(GRID))
    inside = slice(2, -2)
    # A cubic spline over steps h errs by at most (5/384) h^4 max|f''''| (de Boor), here 4e-6; twice that for uneven h.
    bound = 2 * 5 / 384 * 0.048**4 * np.pi**4
    assert on_grid(GRID, taken, signal(taken))[inside] == pytest.approx(signal(GRID)[inside], abs=bound)


def test_a_gap_stays_a_gap() -> None:
    outside_gap = (GRID < 4) | (GRID > 5)
    out = on_grid(GRID, GRID[outside_gap], signal(GRID[outside_gap]))
    assert np.isnan(out[(GRID > 4.01) & (GRID < 4.99)]).all()
    assert np.isfinite(out[outside_gap]).all()


def test_two_lost_samples_are_bridged_and_three_are_not() -> None:
    for lost, bridged in ((2, True), (3, False)):
        present = np.ones(len(GRID), dtype=bool)
        present[100 : 100 + lost] = False
        out = on_grid(GRID, GRID[present], signal(GRID[present]))
        assert np.isfinite(out[100 : 100 + lost]).all() == bridged


def test_nothing_is_known_before_the_first_and_after_the_last_sample() -> None:
    out = on_grid(GRID, GRID[50:200], signal(GRID[50:200]))
    assert np.isnan(out[:50]).all()
    assert np.isnan(out[200:]).all()
