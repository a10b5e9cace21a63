"""Sizes in electrical pools and comparisons: intervals, probabilities, and limits by the number of tests."""

import msgspec
import numpy as np
import pytest
from scipy.stats import multivariate_normal
from test_electrical_pool import OWN, SHARED, compared, electrical_pool, flight, power_of

from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.records.flight import Kind, PowerStatistics, Results
from flightpower.analysis.results.settings import TRUST


def less_certain(results: Results, factor: float) -> Results:
    """The flight, with its own errors multiplied by a factor."""
    statistics = results.curves[Kind.ELECTRICAL].statistics
    assert isinstance(statistics, PowerStatistics)
    own = (factor**2 * np.array(statistics.own_covariance)).tolist()
    return results.with_curve(Kind.ELECTRICAL, statistics=msgspec.structs.replace(statistics, own_covariance=own))


def correlation(speeds: np.ndarray) -> np.ndarray:
    """Correlation of the own errors of `flight`."""
    return np.exp(-(((speeds[:, None] - speeds) / 3.0) ** 2))


def p_of_one_share(share: float, speeds: np.ndarray) -> float:
    """Probability that two flights differ by more than `share` at any of the speeds, from the normal density."""
    z = np.full(len(speeds), share / (np.sqrt(2) * OWN))
    errors = multivariate_normal(
        np.zeros(len(speeds)), correlation(speeds), allow_singular=True, seed=1, maxpts=200_000
    )
    return 1 - float(errors.cdf(z, lower_limit=-z))


@pytest.mark.parametrize("share", [0.03, 0.08, 0.15])
def test_a_difference_has_the_probability_and_the_width_of_two_flights(share: float) -> None:
    result = compared([flight("a")], [flight("b", share)]).results()
    speeds = np.array([row.speed_mps for row in result.differences])
    assert result.p == pytest.approx(p_of_one_share(share, speeds), rel=0.02)
    for row in result.differences:
        half = (row.hi_percent - row.lo_percent) / 2
        assert half == pytest.approx(100 * NORMAL_95 * np.sqrt(2) * OWN, rel=0.01), "the same watts of both cancel"
        assert row.difference_percent == pytest.approx(100 * share, rel=1e-3)
        assert row.power_b_W == pytest.approx((1 + share) * power_of(np.array(row.speed_mps)), rel=1e-3)
        apart = 100 * NORMAL_95 * np.sqrt(2) * np.hypot(OWN, SHARED)
        assert row.independent_half_width_percent == pytest.approx(apart, rel=0.01)


def test_flights_weigh_by_the_inverse_of_their_variance() -> None:
    """A flight with twice the errors has a quarter of the weight: a difference of 10 % moves the pool by a fifth of
    it."""
    pool = electrical_pool([flight("a"), less_certain(flight("b", 0.1), 2.0)])
    assert pool.curve.power_W.value / power_of(pool.curve.V_mps) - 1 == pytest.approx(0.1 / 5, rel=1e-3)
    own = np.sqrt(np.diag(pool.curve.power_W.own)) / power_of(pool.curve.V_mps)
    assert own == pytest.approx(OWN * 2 / np.sqrt(5), rel=1e-3)


def test_an_outlier_is_one_among_as_many_tests_as_flights() -> None:
    """A flight between the limit for one test and the limit for five is not an outlier."""
    between = 0
    for error in np.linspace(0.06, 0.09, 7):
        result = electrical_pool([flight(str(i), 1e-6 * i) for i in range(4)] + [flight("odd", error)]).results()
        odd = result.flights[-1]
        assert odd.p is not None and odd.outlier is bool(odd.p < TRUST.false_alarm_rate / 5)
        between += TRUST.false_alarm_rate / 5 < odd.p < TRUST.false_alarm_rate
    assert between > 1, "a value between both limits was tested"


def test_a_flight_differs_from_the_pool_by_its_share_and_their_errors() -> None:
    """One of five flights is 10 % higher: it raises the pool by 2 %, and is 8 of 102 above it; shared errors cancel."""
    result = electrical_pool([flight(str(i), 1e-6 * i) for i in range(4)] + [flight("odd", 0.1)]).results()
    for row in result.flights[-1].against_pool:
        assert row.difference_percent == pytest.approx(100 * 0.08 / 1.02, rel=0.01)
        assert row.limit_percent == pytest.approx(100 * NORMAL_95 * OWN * np.sqrt(1 - 1 / 5) / 1.02, rel=0.02)
    assert result.flights[-1].half_width_percent == pytest.approx(
        [100 * NORMAL_95 * np.hypot(OWN, SHARED) / 1.02] * len(result.flights[-1].half_width_percent), rel=0.01
    )
