"""Two configurations compared."""

from typing import Any

import numpy as np
import pytest
from synthetic_flights import POLAR, PRIOR_SIGMA, flight, truth

from flightpower.analysis.curve import Polar, power_required
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.flights.comparison import Comparison, compare
from flightpower.analysis.flights.evidence import SharedErrors
from flightpower.analysis.flights.flight_statistics import M
from flightpower.analysis.flights.joint_pool import JointPool, joint_polars
from flightpower.analysis.flights.pool import joint_pool
from flightpower.analysis.flights.pooled import flights_to_see
from flightpower.analysis.methods.consider import DENSITY
from flightpower.analysis.methods.rejected_assumptions import Assumption
from flightpower.analysis.records.flight import EvidenceKind
from flightpower.flight.errors import InputError


def pools(seed: int, factor: float, flights: int = 4, noise: float = 0.3, **facts: str) -> tuple[JointPool, JointPool]:
    """Pools of one installation and propeller, unless `facts` differ for B, whose drag is larger by the factor."""
    rng = np.random.default_rng(seed)
    x = truth(rng)
    y = np.concatenate([factor * POLAR, x[3:]])
    if "installation" in facts:
        y[6:] = truth(rng)[6:]
    return (
        joint_pool([flight(x, rng, f"a{i}", noise) for i in range(flights)]),
        joint_pool([flight(y, rng, f"b{i}", noise, **facts) for i in range(flights)]),
    )


def compared(seed: int, factor: float, **facts: str) -> Comparison:
    return compare(*pools(seed, factor, **facts))


def test_alarms_without_a_difference_are_rare_and_the_interval_covers() -> None:
    for facts in ({}, {"installation": "nose"}):
        results = [compared(seed, 1.0, **facts) for seed in range(50)]
        assert np.mean([item.differs for item in results]) < 0.15
        inside = [np.abs(item.difference_percent) < item.half_width_percent for item in results]
        assert np.mean(inside) == pytest.approx(0.95, abs=0.05)


def test_each_flight_has_its_own_error_of_the_density() -> None:
    """It acts only on that flight's polar, thrust and airspeed: without it most comparisons would raise an alarm
    here."""
    density = 0.016
    change = density * np.r_[-POLAR[0], 0.0, POLAR[2], -1.0, np.zeros(5), -0.5, 0.0]

    def measured(x: np.ndarray, rng: np.random.Generator, name: str, with_change: bool) -> dict[str, Any]:
        result = flight(x, rng, name, noise=0.1)["pooling"]
        values = np.array(result["values"]) + rng.standard_normal() * change
        changes = result["changes"] | ({DENSITY: change.tolist()} if with_change else {})
        result = result | {"values": values.tolist(), "changes": changes}
        return flight(x, rng, name) | {"pooling": result}

    def alarms(with_change: bool) -> float:
        results = []
        for seed in range(50):
            rng = np.random.default_rng(seed)
            x = truth(rng)
            a, b = (joint_pool([measured(x, rng, f"{n}{i}", with_change) for i in range(2)]) for n in "ab")
            results.append(compare(a, b).differs)
        return float(np.mean(results))

    assert alarms(with_change=True) < 0.15 and alarms(with_change=False) > 0.5


def test_two_measurements_of_thrust_at_rest_are_two_propellers() -> None:
    """With one table it is unknown whether the propeller is the same, so its errors do not cancel."""
    stand = {"name": "stand", "coefficients": {"thrust_scale": 1.0, "thrust_slope": -0.5}, "value": 0.0, "sigma": 0.03}
    assert compared(1, 1.0).relation.same_propeller
    result = compared(1, 1.0, stand=stand)  # type: ignore[arg-type]
    assert not result.relation.same_propeller and np.all(
        result.half_width_percent > compared(1, 1.0).half_width_percent
    )


def test_a_difference_is_seen_and_shared_errors_cancel() -> None:
    same, other = compared(1, 1.05), compared(1, 1.05, installation="nose")
    assert same.differs
    assert np.all(np.abs(same.difference_percent - 5) < 1.5 * same.half_width_percent)
    assert np.all(same.half_width_percent < 0.9 * same.independent_half_width_percent)
    assert np.all(same.half_width_percent < other.half_width_percent)
    assert same.relation.shared is SharedErrors.INSTALLATION_AND_PROPELLER
    assert "Errors of installation and propeller table cancel" in same.results().text
    assert other.relation.shared is SharedErrors.PROPELLER


def days(seed: int, thrust: float, flights: int = 2) -> Comparison:
    """Compare an aircraft on two days; `thrust` is the relative change of thrust from the first day to the second.

    Uncounted pulses, a nick, or a wrong stated weight have the same effect.
    """
    rng = np.random.default_rng(seed)
    x = truth(rng)
    y = x + np.r_[np.zeros(3), thrust, np.zeros(M - 4)]
    a, b = (joint_pool([flight(z, rng, f"{n}{i}", 0.1) for i in range(flights)]) for z, n in ((x, "a"), (y, "b")))
    return compare(a, b)


def test_thrust_that_differs_between_the_days_is_reported_and_does_not_cancel() -> None:
    """If thrust were believed to be equal, 6 % less of it on one day would appear as a difference of drag."""
    comparison = [days(seed, -0.06) for seed in range(20)]
    messages = [comparison.relation.thrust_contradicted is not None for comparison in comparison]
    assert np.mean(messages) > 0.9
    covered = [np.abs(comparison.difference_percent) < comparison.half_width_percent for comparison in comparison]
    assert np.mean(covered) > 0.85
    this_days = comparison[messages.index(True)]
    assert (
        this_days.relation.shared is SharedErrors.NOT_THRUST
        and this_days.relation.same_installation
        and not this_days.relation.same_propeller
    )
    results = this_days.results("old", "new")
    texts = [evidence.text for evidence in results.evidence if evidence.kind is EvidenceKind.THRUST_TABLE]
    assert any("differs between A and B" in text for text in [*texts, *results.notes])


def test_thrust_that_is_the_same_is_seldom_denied() -> None:
    comparison = [days(seed, 0.0) for seed in range(60)]
    assert np.mean([comparison.relation.thrust_contradicted is not None for comparison in comparison]) < 0.1
    assert all(
        comparison.relation.same_installation for comparison in comparison if comparison.relation.contradicted is None
    )


def test_from_one_day_to_another_a_part_of_thrust_is_not_shared() -> None:
    """A fifth of the variance between two propellers of the table, less the part that the flights determine, is not
    shared."""
    a, b = pools(2, 1.0, flights=1, noise=3.0)
    half = {}
    for name, same_propeller, same_day in (("day", True, True), ("days", True, False), ("propellers", False, False)):
        C = joint_polars(a, b, True, same_propeller, same_day=same_day).covariance
        T = np.hstack([-np.eye(3), np.eye(3)])
        half[name] = float(np.sqrt(np.trace(T @ C @ T.T)))
    assert half["day"] < half["days"] < half["propellers"]


def test_another_propeller_leaves_its_thrust_error_in_the_difference() -> None:
    same, other = compared(2, 1.0), compared(2, 1.0, propeller="apc-10x5")
    assert not other.relation.same_propeller
    assert other.relation.same_installation
    assert np.all(other.half_width_percent > same.half_width_percent)


def test_without_a_named_installation_only_the_common_part_cancels() -> None:
    rng = np.random.default_rng(6)
    x = truth(rng)
    a, b = (joint_pool([flight(x, rng, f"{name}{i}", 0.3, installation="") for i in range(4)]) for name in ("a", "b"))
    comparison = compare(a, b)
    assert comparison.relation.same_installation
    assert comparison.relation.shared is SharedErrors.COMMON_PART


def test_where_nothing_is_shared_nothing_cancels() -> None:
    result = compared(7, 1.0, installation="nose", propeller="apc-10x5")
    np.testing.assert_allclose(result.half_width_percent, result.independent_half_width_percent, rtol=1e-3)
    assert result.relation.shared is SharedErrors.NONE


def test_errors_that_no_residual_shows_cancel_too_in_one_installation() -> None:
    comparison = compare(*pools(8, 1.0, noise=0.01))
    assert np.all(comparison.half_width_percent < 0.1)
    assert np.all(comparison.independent_half_width_percent > 0.5)


def with_doubt(results: dict[str, Any], about: str, sign: float) -> dict[str, Any]:
    """Results with a doubt `about` something, which changes the polar by 3 %."""
    pooling = dict(results["pooling"])
    pooling["changes"] = pooling["changes"] | {about: (sign * 0.03 * np.r_[POLAR, np.zeros(M - 3)]).tolist()}
    return results | {"pooling": pooling}


@pytest.mark.parametrize(("about", "facts", "cancels"), [
    (Assumption.THRUST_TABLE, {}, True),
    (Assumption.THRUST_TABLE, {"propeller": "apc-10x5"}, False),
    (Assumption.PARABOLIC_POLAR, {}, False),
])  # fmt: skip
def test_a_doubt_of_the_shape_never_cancels_and_one_of_thrust_with_one_propeller(
    about: str, facts: dict[str, str], cancels: bool
) -> None:
    rng = np.random.default_rng(3)
    x = truth(rng)
    a, b = flight(x, rng, "a", 0.3), flight(x, rng, "b", 0.3, **facts)
    plain = compare(joint_pool([a]), joint_pool([b])).half_width_percent
    doubted = compare(
        joint_pool([with_doubt(a, about, 1.0)]), joint_pool([with_doubt(b, about, 1.0)])
    ).half_width_percent
    assert np.all(doubted < 1.2 * plain) if cancels else np.all(doubted > 6.0)


def test_which_is_a_does_not_matter_where_only_b_has_a_wide_prior_of_thrust() -> None:
    rng = np.random.default_rng(4)
    x = truth(rng)
    wide = np.where(np.isin(np.arange(M), [3, 4]), 5.0, 1.0) * PRIOR_SIGMA
    a = joint_pool([flight(x, rng, "a", 3.0)])
    b = joint_pool([flight(x, rng, "b", 3.0, propeller="apc-10x5", prior_sigma=wide)])
    there, back = compare(a, b), compare(b, a)
    assert 1 + back.difference_percent / 100 == pytest.approx(1 / (1 + there.difference_percent / 100), rel=1e-3)


def test_b_differs_only_where_an_interval_says_so() -> None:
    """Parasitic drag falls and induced drag grows, so power changes by 2 % at either end with opposite signs: as curves
    the two differ widely, but at no single speed."""
    rng = np.random.default_rng(0)
    x = truth(rng)
    message, apart = [], []
    for seed in range(40):
        of_seed = np.random.default_rng(seed)
        turned = np.r_[[0.984, 1.0, 1.016] * POLAR, x[3:]]
        a, b = (joint_pool([flight(of, of_seed, name, 0.3)]) for of, name in ((x, "a"), (turned, "b")))
        comparison = compare(a, b)
        message.append(comparison.differs)
        apart.append(np.abs(comparison.difference_percent) > comparison.half_width_percent)
        assert not comparison.differs or apart[-1][comparison.test.speed_index]
        if seed < 8:
            text = comparison.results().text
            assert text.startswith("B differs from A" if comparison.differs else "No difference is seen")
            assert ("of 100 comparisons" in text) == (bool(apart[-1].any()) and not comparison.differs)
    assert 0 < np.mean(message) < 1


def test_comparison_is_symmetric() -> None:
    a, b = pools(3, 1.02)
    there, back = compare(a, b), compare(b, a)
    assert there.test.p == pytest.approx(back.test.p, rel=0.05)
    product = (1 + there.difference_percent / 100) * (1 + back.difference_percent / 100)
    np.testing.assert_allclose(product, 1, rtol=1e-9)


def test_a_flight_in_both_pools_is_refused() -> None:
    a, _ = pools(4, 1.0)
    with pytest.raises(InputError, match="in both pools"):
        compare(a, a)


def test_flights_to_see_are_those_by_which_nine_of_ten_campaigns_see_it() -> None:
    a, _ = pools(5, 1.0, flights=2)
    number = flights_to_see(a, 0.02)
    assert number is not None
    more = flights_to_see(a, 0.005)
    assert more is None or more > number
    seen = [compare(*pools(seed, 1.02, flights=number)).differs for seed in range(20)]
    assert np.mean(seen) > 0.8
    assert flights_to_see(a, 1e-6) is None
    with pytest.raises(InputError, match="above 0"):
        flights_to_see(a, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flights", "seeds"), [(1, 25), *(pytest.param(flights, 60, marks=pytest.mark.thorough) for flights in (1, 4))]
)
def test_a_false_name_of_the_installation_is_denied_and_the_interval_contains_the_truth(
    flights: int, seeds: int
) -> None:
    """Flights of two installations carry one name. If it were believed, only 22 to 35 % of the truths would be
    covered."""
    believed, comparisons, of_one = [], [], []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        x, other = truth(rng), truth(rng)
        y = np.concatenate([x[:6], other[6:]])
        a, b, c = (
            joint_pool([flight(z, rng, f"{name}{i}", 0.5) for i in range(flights)])
            for z, name in ((x, "a"), (y, "b"), (x, "c"))
        )
        comparisons.append(compare(a, b))
        of_one.append(compare(a, c))
        believed.append(np.abs(comparisons[-1].difference_percent) < of_one[-1].half_width_percent)

    def covered(comparisons: list[Comparison]) -> float:
        return float(
            np.mean(
                [np.abs(comparison.difference_percent) < comparison.half_width_percent for comparison in comparisons]
            )
        )

    assert (
        np.mean([comparison.relation.contradicted is not None for comparison in comparisons]) > 0.9
        and covered(comparisons) > 0.88
    )
    assert np.mean([item.relation.contradicted is not None for item in of_one]) < 0.12 and covered(of_one) > 0.92
    assert np.mean(believed) < 0.5
    for comparison in comparisons + of_one:
        assert comparison.relation.same_installation == (comparison.relation.contradicted is None)
        results = comparison.results("old", "new")
        kinds = [evidence.kind for evidence in results.evidence if not evidence.log]
        assert comparison.relation.contradicted is None or kinds == [EvidenceKind.INSTALLATIONS_DIFFER] or results.notes


@pytest.mark.parametrize("seeds", [25, pytest.param(60, marks=pytest.mark.thorough)])
def test_two_flights_that_deny_their_installation_are_both_mounted_anew(seeds: int) -> None:
    """Only one of six flights contradicts its installation, and only this flight is named."""
    covered, contradicted, V = [], [], np.array([12.0, 16.0, 20.0])
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        x, other = truth(rng), truth(rng)
        pool = joint_pool([flight(x, rng, "a", 0.5), flight(np.r_[x[:6], other[6:]], rng, "b", 0.5)])
        contradicted.append(pool.remounted == {0, 1} and all(flight.mounted_anew for flight in pool.results().flights))
        assert contradicted[-1] or not pool.remounted
        power, error = pool.power(V)
        right, _ = power_required(V, Polar(POLAR, np.zeros((3, 3))), pool.condition)
        covered.append(np.abs(power - right) < NORMAL_95 * error)
    assert np.mean(contradicted) > 0.9 and np.mean(covered) > 0.88
    rng = np.random.default_rng(1)
    x, other = truth(rng), truth(rng)
    six = [flight(np.r_[x[:6], other[6:]] if i == 2 else x, rng, f"{i}", 0.1) for i in range(6)]
    assert joint_pool(six).remounted == {2}
