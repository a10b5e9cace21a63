"""A ParameterVector's covariance propagates exactly through linear functions, and to first order through others."""

import numpy as np
import pytest

from flightpower.analysis.performance.propagation import (
    ParameterVector,
    UncertainValue,
    combine_independent,
    exact,
    from_sigma_points,
)

COVARIANCE = np.array([[0.04, 0.01], [0.01, 0.09]])
PARAMETERS = ParameterVector(("a", "b"), np.array([3.0, -1.0]), COVARIANCE)


def test_a_linear_function_gets_its_exact_standard_error() -> None:
    points = PARAMETERS.sigma_points()
    x = np.linspace(-2, 2, 9)
    uncertain_value = from_sigma_points(2 * points["a"] + x * points["b"])
    gradient = np.stack([np.full_like(x, 2.0), x], axis=1)
    assert uncertain_value.value == pytest.approx(6 - x, rel=1e-12)
    assert uncertain_value.standard_error == pytest.approx(
        np.sqrt(np.einsum("ni,ij,nj->n", gradient, COVARIANCE, gradient))
    )


def test_a_curved_function_gets_that_of_many_draws() -> None:
    """For sin(a) exp(b/3) with these covariances, draws scatter within 6 % of the first-order standard error."""
    points = PARAMETERS.sigma_points()
    uncertain_value = from_sigma_points((np.sin(points["a"]) * np.exp(points["b"] / 3))[:, 0])
    draws = np.random.default_rng(1).multivariate_normal(PARAMETERS.values, COVARIANCE, 200_000)
    scatter = np.std(np.sin(draws[:, 0]) * np.exp(draws[:, 1] / 3))
    assert float(uncertain_value.standard_error) == pytest.approx(scatter, rel=0.06)


def test_independent_numbers_stand_side_by_side() -> None:
    both = combine_independent(PARAMETERS, exact(c=5.0))
    assert both.names == ("a", "b", "c")
    points = both.sigma_points()
    assert float(from_sigma_points(points["c"][:, 0]).standard_error) == 0.0
    assert float(from_sigma_points(points["a"][:, 0] + points["c"][:, 0]).standard_error) == pytest.approx(0.2)


def test_an_interval_is_of_95_percent_on_both_sides() -> None:
    value = UncertainValue(np.array(10.0), np.array(2.0))
    assert (value.lo, value.hi) == pytest.approx((10 - 3.92, 10 + 3.92), abs=1e-3)
