"""Whether flights agree: the test of homogeneity, and outliers with their likely cause."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import norm
from synthetic_flights import flight, truth

from flightpower.analysis.curve import Condition, speed_at
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.flights.agreement import (
    INSTALLATION_PART,
    POLAR_PART,
    ErrorParts,
    differences_in_pool,
    homogeneity,
    largest_of_errors,
    least_squares,
    likely_cause,
    quadratic_form,
    trends,
)
from flightpower.analysis.flights.evidence import cause_text
from flightpower.analysis.flights.flight_statistics import POOLED, M
from flightpower.analysis.flights.joint_pool import JointPool, thrust_known
from flightpower.analysis.flights.pool import joint_pool
from flightpower.analysis.records.flight import EvidenceKind, Trust
from flightpower.analysis.records.pool import Agreement, TrendQuantity


def test_homogeneity_is_calibrated_on_flights_drawn_from_the_model() -> None:
    p, of_installation, of_flights = [], [], []
    for seed in range(80):
        rng = np.random.default_rng(seed)
        x = truth(rng)
        pooled = joint_pool([flight(x, rng, f"{i}", noise) for i, noise in enumerate((0.5, 1.0, 1.0, 3.0))])
        assert pooled.homogeneity is not None
        assert pooled.installation_homogeneity is not None
        p.append(pooled.homogeneity.p)
        of_installation.append(pooled.installation_homogeneity.p)
        of_flights += [difference.p for difference in pooled.differences]
    for values in (p, of_installation, of_flights):
        assert np.mean(np.array(values) < 0.05) == pytest.approx(0.05, abs=0.05)
        assert np.mean(values) == pytest.approx(0.5, abs=0.07)


def test_differences_from_the_pool_have_the_covariance_stated() -> None:
    """The flights alone and the pool share the error of the prior; the flights in the pool share their own errors
    too."""
    ratios = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        x = truth(rng)
        pooled = joint_pool([flight(x, rng, f"{i}") for i in range(3)])
        for difference in differences_in_pool(pooled.stack, pooled.estimate):
            ratios += difference.standardized.tolist()
    assert np.mean(np.abs(ratios) < NORMAL_95) == pytest.approx(0.95, abs=0.03)


def test_errors_common_to_all_flights_do_not_widen_the_differences_between_them() -> None:
    rng = np.random.default_rng(3)
    x = truth(rng)
    pooled = joint_pool([flight(x, rng, f"{i}", 0.01) for i in range(8)])
    polar = [d.standardized[:3] for d in pooled.differences]
    assert np.sqrt(np.mean(np.square(polar))) == pytest.approx(1, abs=0.4)


def spoiled(name: str, change: float) -> JointPool:
    """A pool of six calm flights, of which the third has another value of one parameter."""
    rng = np.random.default_rng(1)
    x = truth(rng)
    other = x.copy()
    other[POOLED.index(name)] += change
    return joint_pool([flight(other if i == 2 else x, rng, f"{i}", 0.1) for i in range(6)])


def test_an_outlier_is_named_and_the_scatter_between_flights_exceeds_what_is_expected() -> None:
    pool = spoiled("A0", 0.002)
    assert [outlier.log for outlier in pool.results().outliers] == ["2.mcap"]
    assert likely_cause(pool.outliers[2]) is None
    assert pool.homogeneity is not None and pool.homogeneity.p < 1e-3
    assert pool.results().between_flights[-1].excess_percent > 1
    differing = [evidence.log for evidence in pool.evidence if evidence.kind is EvidenceKind.FLIGHTS_DIFFER]
    assert differing == ["", "2.mcap"] and pool.agreement is Agreement.NOT_THE_CURVES


def test_a_probe_that_was_moved_in_one_flight_is_named() -> None:
    pool = spoiled("alpha_bias", 0.02)
    cause = likely_cause(pool.outliers[2])
    assert cause is not None and cause.parameter == "alpha_bias" and cause.difference > 0.015
    assert "offset of angle of attack differs by +1." in cause_text(cause)
    assert pool.installation_homogeneity is not None and pool.installation_homogeneity.p < 1e-3
    assert pool.homogeneity is not None and pool.homogeneity.p > 1e-3
    assert {(evidence.kind, evidence.log) for evidence in pool.evidence} == {
        (EvidenceKind.INSTALLATIONS_DIFFER, ""), (EvidenceKind.INSTALLATIONS_DIFFER, "2.mcap")
    }  # fmt: skip
    assert pool.agreement is Agreement.NOT_THE_INSTALLATION


def test_flights_that_agree_have_no_outlier() -> None:
    pool = spoiled("A0", 0.0)
    assert not pool.outliers
    assert not pool.notes
    assert pool.homogeneity is not None and not pool.homogeneity.differs


@pytest.mark.parametrize(
    ("pools", "expected"), [(25, 1), pytest.param(80, 4, marks=[pytest.mark.slow, pytest.mark.thorough])]
)
def test_what_is_said_of_a_pool_has_the_level_of_its_verdict(pools: int, expected: int) -> None:
    """Some of 80 pools that differ by chance have p below 5 %, and still no result says that flights differ.

    The two tests and the outliers, each at 0.3 %, make at most one of 80 pools doubtful.
    """
    unlikely = doubtful = 0
    for seed in range(pools):
        rng = np.random.default_rng(seed)
        x = truth(rng)
        pool = joint_pool([flight(x, rng, f"{i}", noise) for i, noise in enumerate((0.5, 1.0, 1.0, 3.0, 1.0, 1.0))])
        message = pool.results()
        doubtful += message.trust is Trust.DOUBTFUL
        if message.trust is Trust.TRUSTED:
            assert (message.agreement, message.outliers) == (Agreement.YES, [])
            assert pool.homogeneity is not None and pool.installation_homogeneity is not None
            unlikely += min(pool.homogeneity.p, pool.installation_homogeneity.p) < 0.05
    assert unlikely >= expected and doubtful <= 1


def test_at_most_half_of_the_flights_are_named() -> None:
    """With five flights of five different aircraft it is unknown which ones are wrong."""
    rng = np.random.default_rng(1)
    x = truth(rng)
    others = [x.copy() for _ in range(5)]
    for i, other in enumerate(others):
        other[POOLED.index("A0")] += 0.004 * 2**i
    pool = joint_pool([flight(other, rng, f"{i}", 0.1) for i, other in enumerate(others)])
    assert len(pool.outliers) == 2


def test_the_largest_of_errors_has_the_probability_with_which_it_is_drawn() -> None:
    """The errors come from a curve of three parameters at seven speeds; from one error common to seven speeds; and from
    seven independent errors, for which the largest is known exactly."""
    V = np.linspace(10.0, 25.0, 7)
    curve = np.stack([V**-2, np.ones(7), V**2 / 1e3])
    maxima = np.max(np.abs(np.random.default_rng(1).standard_normal((200_000, 3)) @ curve) / norms(curve.T), axis=1)
    of_curve = largest_of_errors(curve.T @ curve)
    assert [of_curve(z) for z in (1.5, 2.3, 3.0)] == pytest.approx(
        [np.mean(maxima > z) for z in (1.5, 2.3, 3.0)], rel=0.05
    )
    assert largest_of_errors(np.outer(V, V))(1.96) == pytest.approx(0.05, rel=1e-3)
    assert largest_of_errors(np.diag(V))(2.0) == pytest.approx(1 - (1 - 2 * norm.sf(2.0)) ** 7, rel=0.02)
    assert 0 < largest_of_errors(curve.T @ curve)(20.0) < 1e-80


def norms(rows: np.ndarray) -> np.ndarray:
    return np.linalg.norm(rows, axis=1)


def test_a_quadratic_form_is_that_of_the_inverse() -> None:
    C = np.array([[4e-6, 1e-4], [1e-4, 0.04]])
    d = np.array([1e-3, 0.3])
    assert quadratic_form(d, C) == pytest.approx(d @ np.linalg.inv(C) @ d)


def test_the_likely_cause_is_the_installation_s_largest_difference_in_its_unit() -> None:
    """The limit is two and a half standard deviations; a difference of the polar itself is not a cause."""
    value, standardized = np.zeros(len(POOLED)), np.zeros(len(POOLED))
    i = POOLED.index("thrust_scale")
    value[i], standardized[i], standardized[0] = 0.05, 2.6, 9.0
    cause = likely_cause(SimpleNamespace(value=value, standardized=standardized))  # type: ignore[arg-type]
    assert cause == ("thrust_scale", 0.05, 2.6)
    assert "scale of thrust differs by +5 %, 2.6 standard deviations" in cause_text(cause)
    standardized[i] = 2.4
    assert likely_cause(SimpleNamespace(value=value, standardized=standardized)) is None  # type: ignore[arg-type]


def own_errors(variance: float, flights: int) -> ErrorParts:
    return ErrorParts(np.full((flights, 1, 1), variance), np.zeros((flights, 1, 0)))


@pytest.mark.parametrize("part", [POLAR_PART, INSTALLATION_PART])
def test_homogeneity_is_that_of_the_covariance_of_all_flights_together(part: slice) -> None:
    """They agree to 1e-8 for 200 unlike flights with errors shared by all and an installation without a name."""
    rng = np.random.default_rng(5)
    x = truth(rng)
    pooled = joint_pool([flight(x, rng, f"{i}", 0.3 + 0.01 * i) for i in range(200)])
    stack = pooled.stack
    values = stack.values[:, part]
    n, k = values.shape
    a = stack.prior_part[:, part].reshape(n * k, M)
    covariance = a @ pooled.prior.covariance @ a.T + block_diag(*stack.own_covariance[:, part, part])
    for change in stack.changes.values():
        covariance += np.outer(change[:, part], change[:, part])
    scale = np.sqrt(np.diag(covariance))
    factor = np.linalg.cholesky(covariance / np.outer(scale, scale))
    z, X = (np.linalg.solve(factor, (item.T / scale).T) for item in (values.ravel(), np.tile(np.eye(k), (n, 1))))
    residual = z - X @ np.linalg.lstsq(X, z, rcond=None)[0]
    assert stack.changes
    assert homogeneity(stack, pooled.prior, part).chi_square == pytest.approx(residual @ residual, rel=1e-8)


def test_a_flight_that_adds_nothing_to_the_prior_agrees_with_all() -> None:
    errors = ErrorParts(np.array([[[1.0]], [[1.0]], [[0.0]]]), np.array([[[3.0]], [[3.0]], [[3.0]]]))
    fit = least_squares(np.array([[1.0], [-1.0], [0.0]]), np.ones((3, 1, 1)), errors)
    assert fit.chi_square == pytest.approx(2.0)
    assert fit.values == pytest.approx(0.0, abs=1e-6) and np.sqrt(fit.covariance[0, 0]) == pytest.approx(3.0)


def test_a_trend_is_the_slope_of_generalized_least_squares() -> None:
    """0.5 % a day; for flights known equally well, the slope's error is theirs over the root of sum (x - mean)^2."""
    days = np.array([0.0, 1.0, 2.0, 5.0])
    flights = [
        SimpleNamespace(
            start_unix_s=86400.0 * day,
            battery_V=14.0,
            content=SimpleNamespace(air_temperature_K=T),
        )
        for day, T in zip(days, (280.0, None, 290.0, 295.0), strict=True)
    ]
    (trend,) = trends(flights, 3.0 + 0.5 * days, own_errors(0.04, 4))  # type: ignore[arg-type]
    assert (trend.quantity, trend.lowest, trend.highest, trend.flights) == (TrendQuantity.DATE, 0.0, 5.0, 4)
    assert trend.change_percent == pytest.approx(5 * 0.5)
    assert trend.standard_error_percent == pytest.approx(5 * 0.2 / np.sqrt(np.sum((days - 2.0) ** 2)))
    assert trend.p == pytest.approx(2 * norm.sf(2.5 / trend.standard_error_percent))


def test_a_trend_is_reported_over_the_range_flown_alone() -> None:
    """Flights within 0.1 K cannot show a change per kelvin: it is given per 0.1 K, as uncertain as the flights."""
    flights = [
        SimpleNamespace(
            start_unix_s=None,
            battery_V=None,
            content=SimpleNamespace(air_temperature_K=288.0 + 0.1 * i / 4),
        )
        for i in range(5)
    ]
    (trend,) = trends(flights, np.array([0.3, -0.2, 0.1, 0.4, -0.1]), own_errors(0.09, 5))  # type: ignore[arg-type]
    assert trend.highest - trend.lowest == pytest.approx(0.1)
    assert abs(trend.change_percent) < 0.5 and trend.standard_error_percent < 0.5


def test_thrust_is_known_where_a_flight_that_was_there_had_it_within_the_table() -> None:
    """Flights count at their own lift coefficients, whatever their weight; one without a curve covers all that it
    flew."""
    condition = Condition(weight_N=37.0, rho=1.2, wing_area_m2=0.46)
    CL = np.array([0.25, 0.35, 0.55, 0.75, 0.95])

    def flight_of(CLs: list[float], extrapolated: list[bool]) -> SimpleNamespace:
        points = [
            SimpleNamespace(speed_mps=float(speed_at(c, condition)), extrapolated=e)
            for c, e in zip(CLs, extrapolated, strict=True)
        ]
        return SimpleNamespace(content=SimpleNamespace(power_required=points), flown_CL=(0.3, 0.8), condition=condition)

    flights = [flight_of([0.35, 0.55, 0.75], [True, False, False])]
    assert thrust_known(flights, CL).tolist() == [False, False, True, True, False]  # type: ignore[arg-type]
    flights.append(
        SimpleNamespace(content=SimpleNamespace(power_required=[]), flown_CL=(0.3, 0.4), condition=condition)
    )
    assert thrust_known(flights, CL).tolist() == [False, True, True, True, False]  # type: ignore[arg-type]
    assert thrust_known(flights, np.array([0.3, 0.8])).tolist() == [True, True]  # type: ignore[arg-type]
