"""Operations on a value apply to its errors as well; random draws of the errors confirm it."""

import numpy as np
import pytest

from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.uncertain import Uncertain, total

RNG = np.random.default_rng(3)
ROOT = RNG.normal(size=(3, 3))
ONE = Uncertain(np.array([1.0, 2.0, 3.0]), ROOT @ ROOT.T, {"a": np.array([0.5, -1.0, 2.0]), "b": np.ones(3)})
OTHER = Uncertain(np.array([4.0, 5.0, 6.0]), 0.25 * np.eye(3), {"b": np.full(3, 3.0), "c": np.array([1.0, 0.0, 0.0])})


def draws(of: Uncertain, errors: dict[str, np.ndarray], count: int) -> np.ndarray:
    """Return draws (count, n) of a value: own errors are drawn here, shared ones (count,) are given by name."""
    own = RNG.multivariate_normal(of.value, of.own, count)
    return own + sum(errors[name][:, None] * change for name, change in of.shared.items())


def test_the_covariance_is_that_of_draws_of_all_errors() -> None:
    errors = {name: RNG.normal(size=40000) for name in "ab"}
    covariance = np.cov(draws(ONE, errors, 40000).T)
    assert covariance == pytest.approx(ONE.covariance, abs=0.04 * np.max(ONE.covariance))
    assert ONE.covariance - ONE.by_shared == pytest.approx(ONE.own)
    assert ONE.half_width == pytest.approx(NORMAL_95 * np.sqrt(np.diag(ONE.covariance)))


def test_a_function_of_values_has_their_errors_by_its_derivative() -> None:
    J = np.array([[1.0, -1.0, 0.0], [2.0, 0.5, 1.0]])
    assert ONE.through(J).value == pytest.approx([-1.0, 6.0])
    assert ONE.through(J).covariance == pytest.approx(J @ ONE.covariance @ J.T)
    assert ONE.through(J, np.array([7.0, 8.0])).value == pytest.approx([7.0, 8.0])
    assert ONE.at([2, 0]).covariance == pytest.approx(ONE.covariance[np.ix_([2, 0], [2, 0])])


@pytest.mark.parametrize("cancel", [True, False])
def test_shared_errors_cancel_in_a_difference_where_they_are_the_same(cancel: bool) -> None:
    """The change by b is 1 in one and 3 in the other: (3 - 1)^2 = 4 remains if it cancels, and 1 + 9 if not."""
    difference = ONE.minus(OTHER, cancel)
    assert difference.value == pytest.approx([-3.0, -3.0, -3.0])
    by_b = 4.0 if cancel else 10.0
    a, c = ONE.shared["a"], OTHER.shared["c"]
    assert difference.covariance == pytest.approx(ONE.own + OTHER.own + np.outer(a, a) + np.outer(c, c) + by_b)


def test_shared_errors_do_not_average_out_in_a_mean() -> None:
    mean = total(ONE.through(np.eye(3) / 4) for _ in range(4))
    assert mean.value == pytest.approx(ONE.value) and mean.own == pytest.approx(ONE.own / 4)
    assert mean.by_shared == pytest.approx(ONE.by_shared)


def test_values_without_shared_errors_have_their_own_alone() -> None:
    alone = Uncertain(ONE.value, ONE.own)
    assert alone.covariance == pytest.approx(ONE.own)
    assert alone.standard_error == pytest.approx(np.sqrt(np.diag(ONE.own)))
