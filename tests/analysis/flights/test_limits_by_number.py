"""Limits by the number of tests: among many tests, a false alarm is as rare as in a single test."""

import numpy as np
import pytest
from scipy.stats import norm
from synthetic_flights import flight, truth

from flightpower.analysis.flights.agreement import ErrorParts, remounted_flights, trends
from flightpower.analysis.flights.changes import Change
from flightpower.analysis.flights.flight_statistics import POOLED
from flightpower.analysis.flights.pool import Pool, pool_results
from flightpower.analysis.records.fleet import Shape, What
from flightpower.analysis.records.pool import TrendQuantity
from flightpower.analysis.results.evidence import noise_limit
from flightpower.analysis.results.settings import TRUST
from flightpower.analysis.settings import EVIDENCE


@pytest.mark.parametrize("tests", [1, 2, 5, 20])
def test_noise_exceeds_the_limit_of_evidence_as_seldom_as_stated(tests: int) -> None:
    """This holds for any one of many values, on either side."""
    within = 1 - 2 * norm.sf(noise_limit(tests))
    assert 1 - within**tests == pytest.approx(TRUST.false_alarm_rate, rel=0.01)


def campaign(drag: float, alpha: float = 0.0, count: int = 5) -> Pool:
    """The pool of flights whose last one has other drag and a probe turned by `alpha` [rad]."""
    rng = np.random.default_rng(8)
    x = truth(rng)
    flights = []
    for i in range(count):
        now = x.copy()
        if i == count - 1:
            now[:3] *= 1 + drag
            now[POOLED.index("alpha_bias")] += alpha
        flights.append(flight(now, rng, f"{i}", 0.3))
    return pool_results(flights)


def test_a_flight_is_an_outlier_by_the_limit_of_two_tests_of_each_flight() -> None:
    """Each flight has two tests, of polar and of installation, and the evidence states their limit."""
    limit, between = TRUST.false_alarm_rate / (2 * 5), 0
    for drag in np.linspace(0.0, 0.02, 41):
        pooled = campaign(drag)
        p = [min(difference.p, difference.p_installation) for difference in pooled.differences]
        assert bool(pooled.outliers) is bool(min(p) < limit)
        assert bool(pooled.outlying_curves) is any(outlier.p < limit for outlier in pooled.outliers.values())
        between += limit < min(p) < TRUST.false_alarm_rate
        for evidence in pooled.evidence:
            assert evidence.limit == pytest.approx(limit if evidence.log else TRUST.false_alarm_rate)
    assert between > 1, "a value between both limits was tested"


def test_a_flight_whose_probe_moved_is_named_by_the_same_rule() -> None:
    """Its polar agrees, so it is an outlier, but not because of its curve. Only that flight is treated as remounted."""
    pooled = campaign(0.0, alpha=0.03)
    assert list(pooled.outliers) == [4] and pooled.outliers[4].p_installation < TRUST.false_alarm_rate / 10
    assert remounted_flights(pooled.as_stated, pooled.prior) == {4} == pooled.remounted
    assert pooled.outlying_curves == [] or pooled.outliers[4].p < TRUST.false_alarm_rate / 10


@pytest.mark.parametrize(("drag", "thrust"), [(1, 1), (-1, 1), (1, -1)])
def test_drag_and_thrust_have_both_changed_beyond_the_limit_of_both_sides(drag: int, thrust: int) -> None:
    limit = norm.isf(EVIDENCE.rare_false_alarms / 2)

    def of(z: float) -> What:
        covariance = np.diag([0.01**2, 0.02**2])
        return Change(Shape.STEP, 3, 5, drag * 0.01 * (z + 1), thrust * 0.02 * z, covariance).what

    assert of(limit + 0.05) is What.BOTH
    assert of(limit - 0.05) is What.DRAG


def test_a_trend_is_the_change_over_the_range_with_the_error_of_a_straight_line() -> None:
    """0.2 % a kelvin is 4 % over 20 K; flights known to 1 % each give 1 % over the root of the sum of squares."""
    rng = np.random.default_rng(2)
    x = truth(rng)
    temperatures = np.array([280.0, 284.0, 290.0, 291.0, 296.0, 300.0])
    pooled = pool_results([flight(x, rng, f"{i}", temperature_K=T) for i, T in enumerate(temperatures.tolist())])
    errors = ErrorParts(np.full((6, 1, 1), 1.0), np.zeros((6, 1, 1)))
    (trend,) = trends(pooled.flights, 0.2 * (temperatures - 290.0), errors)
    error = 20 / np.sqrt(np.sum((temperatures - temperatures.mean()) ** 2))
    assert trend.quantity is TrendQuantity.TEMPERATURE and trend.flights == 6
    assert (trend.lowest, trend.highest) == (280.0, 300.0)
    assert (trend.change_percent, trend.standard_error_percent) == pytest.approx((4.0, error))
    assert trend.p == pytest.approx(2 * norm.sf(4.0 / error))
