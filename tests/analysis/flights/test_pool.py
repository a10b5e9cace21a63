"""The joint estimate of several flights."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic_flights import CHANGES, POLAR, PRIOR_MEAN, PRIOR_SIGMA, flight, truth

from flightpower.analysis.curve import Polar
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.flights.comparison import compare
from flightpower.analysis.flights.evidence import NOT_NAMED
from flightpower.analysis.flights.flight_statistics import POOLED
from flightpower.analysis.flights.joint import _without_prior, without_each
from flightpower.analysis.flights.joint_pool import JointPool
from flightpower.analysis.flights.pool import joint_pool, pool_results
from flightpower.analysis.flights.pool_settings import POOLING
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.records.flight import EvidenceKind, PartOfResult, Trust
from flightpower.flight.errors import InputError


def campaign(seed: int, flights: int, **facts: Any) -> list[dict[str, Any]]:
    rng = np.random.default_rng(seed)
    x = truth(rng)
    return [flight(x, rng, f"{seed}-{i}", **facts) for i in range(flights)]


def slowest_error_percent(pooled: JointPool, A: np.ndarray) -> tuple[float, float]:
    """Error of the power from the polar A at the slowest speed, and half the 95 % interval of `pooled`."""
    V = pooled.speeds_mps[:1]
    power, error = pooled.power(V)
    other, _ = replace(pooled, polar=Polar(A, np.zeros((3, 3)))).power(V)
    return float(100 * (other / power - 1)[0]), float(100 * NORMAL_95 * (error / power)[0])


def test_one_flight_equals_its_own_analysis_and_the_equations_agree() -> None:
    (results,) = campaign(1, 1)
    pooled = joint_pool([results])
    assert pooled.polar.A.tolist() == results["pooling"]["values"][:3]
    assert pooled.polar.covariance.tolist() == results["pooling"]["polar_covariance"]
    total = pooled.estimate.parameters.covariance[:3, :3] + covariance.floor()
    np.testing.assert_allclose(pooled.estimate.parameters.value[:3], pooled.polar.A, rtol=1e-9)
    np.testing.assert_allclose(total, pooled.polar.covariance, rtol=1e-7, atol=1e-16)


STAND = {
    "name": "stand", "coefficients": {"thrust_scale": 1.0, "thrust_slope": -0.5}, "value": 0.04, "sigma": 0.02
}  # fmt: skip


@pytest.mark.parametrize("number", [1, 3])
def test_a_stand_counts_once_in_a_pool(number: int) -> None:
    """The pool equals that of the same flights without a stand, updated by the stand's measurement: a Kalman update of
    drag and thrust for given errors of the installation, which thrust does not change."""
    with_stand, without = (joint_pool(campaign(5, number, **facts)).estimate for facts in ({"stand": STAND}, {}))
    h = np.array([STAND["coefficients"].get(name, 0.0) for name in POOLED])  # type: ignore[attr-defined]
    Ch = without.prior_part @ (np.where(h, PRIOR_SIGMA, 0.0) ** 2 * h)
    gain = Ch / (h @ Ch + STAND["sigma"] ** 2)  # type: ignore[operator]
    expected = without.parameters.value + gain * (STAND["value"] - h @ without.parameters.value)
    np.testing.assert_allclose(with_stand.parameters.value, expected, rtol=1e-6, atol=1e-9)
    left = np.eye(len(h)) - np.outer(gain, h)
    total = left @ without_weight(without) @ left.T + STAND["sigma"] ** 2 * np.outer(gain, gain)  # type: ignore[operator]
    np.testing.assert_allclose(without_weight(with_stand), total, rtol=1e-5, atol=1e-12)


def without_weight(estimate) -> np.ndarray:
    """The covariance by noise and priors, without the error of the weight."""
    change = estimate.influences[0].sum(axis=0) @ CHANGES["weight"]
    return np.asarray(estimate.parameters.covariance - np.outer(change, change))


def test_an_estimate_less_certain_than_its_prior_keeps_its_covariance() -> None:
    """The data's information combined with the prior's gives the estimate again."""
    prior = np.diag([4.0, 1.0])
    covariance = np.linalg.inv(prior) * 1.5
    data = _without_prior(covariance, prior)
    np.testing.assert_allclose(data.information, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.inv(data.information + prior) + data.excess, covariance)


def test_flights_that_say_nothing_of_a_parameter_do_not_make_a_pool_worse() -> None:
    """With colored residuals, thrust beyond the table is less certain than its prior. Such a flight alone gives what
    its analysis gave; over 40 campaigns the errors of pools of 1, 5 and 20 flights match those stated, and both shrink
    with the number."""
    item = campaign(3, 1, color=3.0)[0]
    beyond = POOLED.index("thrust_beyond")
    assert item["pooling"]["covariance"][beyond][beyond] > PRIOR_SIGMA[beyond] ** 2
    np.testing.assert_allclose(
        joint_pool([item]).estimate.parameters.value, item["pooling"]["values"], rtol=1e-7, atol=1e-10
    )
    flown = [campaign(seed, 20, color=3.0) for seed in range(40)]
    expected, actual = [], []
    for number in (1, 5, 20):
        pools = np.array([slowest_error_percent(joint_pool(flights[:number]), POLAR) for flights in flown])
        expected.append(np.median(pools[:, 1]))
        actual.append(np.sqrt(np.mean(pools[:, 0] ** 2)))
        assert 0.7 < actual[-1] / (expected[-1] / NORMAL_95) < 1.25  # 40 draws: 1 +- 0.11
    assert expected == sorted(expected, reverse=True) and expected[2] < 0.6 * expected[0]
    assert actual == sorted(actual, reverse=True)


@pytest.mark.parametrize("color", [1.0, 3.0])
def test_the_pool_without_each_flight_is_that_of_the_others(color: float) -> None:
    flights = campaign(4, 4, color=color)
    pooled = joint_pool(flights)
    others = without_each(pooled.stack, pooled.prior)
    for i in range(4):
        expected = joint_pool([*flights[:i], *flights[i + 1 :]]).estimate
        np.testing.assert_allclose(others.x[i], expected.parameters.value, rtol=1e-7, atol=1e-10)
        np.testing.assert_allclose(
            others.total(pooled.prior.covariance)[i], expected.parameters.covariance, rtol=1e-6, atol=1e-12
        )


def test_flights_with_two_stands_are_not_one_pool() -> None:
    flights = [*campaign(5, 1, stand=STAND), *campaign(6, 1)]
    with pytest.raises(
        InputError, match=r"two measurements of thrust on a stand .* \+0.040 ± 0.020, .* has none; .*--thr"
    ):
        joint_pool(flights)


def test_flights_with_different_stated_priors_are_pooled_with_the_widest() -> None:
    """One flight was analyzed with a narrower prior, which is subtracted, so the pool is the same."""
    x, narrower = truth(np.random.default_rng(0)), PRIOR_SIGMA / np.where(np.arange(len(PRIOR_SIGMA)) > 2, 2.0, 1.0)

    def pooled(first: np.ndarray) -> JointPool:
        rng = np.random.default_rng(1)
        return joint_pool([flight(x, rng, "first", prior_sigma=first), flight(x, rng, "second")])

    mixed, wide = pooled(narrower), pooled(PRIOR_SIGMA)
    np.testing.assert_allclose(mixed.estimate.parameters.value, wide.estimate.parameters.value, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(without_weight(mixed.estimate), without_weight(wide.estimate), rtol=1e-6, atol=1e-15)


def test_the_prior_of_thrust_moves_a_pool_of_twenty_flights_by_its_own_share_only() -> None:
    """Thrust lies 2 and 1.5 prior standard deviations beyond its table in 60 campaigns of 20 flights: the prior of
    thrust moves neither the airspeed scale nor the polar by more than its own share."""
    rng, campaigns, finite = np.random.default_rng(11), 60, np.isfinite(PRIOR_SIGMA)
    errors, totals = [], []
    for _ in range(campaigns):
        x = truth(rng)
        x[3:5] = [0.036, -0.22]
        pooled = joint_pool([flight(x, rng, str(i)) for i in range(20)])
        prior = pooled.estimate.prior_part
        errors.append(pooled.estimate.parameters.value - x - prior @ np.where(finite, PRIOR_MEAN - x, 0.0))
        by_prior = prior @ np.diag(np.where(finite, PRIOR_SIGMA, 0.0) ** 2) @ prior.T
        totals.append(np.diag(without_weight(pooled.estimate) - by_prior))
    mean, sigma = np.mean(errors, axis=0), np.sqrt(np.mean(totals, axis=0))
    assert np.all(np.abs(mean) < 3.5 * sigma / np.sqrt(campaigns))
    assert np.std(errors, axis=0) == pytest.approx(sigma, rel=0.35)


def test_one_flight_without_a_named_installation_equals_its_own_analysis_too() -> None:
    (results,) = campaign(1, 1, installation="")
    pooled = joint_pool([results])
    total = pooled.estimate.parameters.covariance[:3, :3] + covariance.floor()
    np.testing.assert_allclose(pooled.estimate.parameters.value[:3], pooled.polar.A, rtol=1e-9)
    np.testing.assert_allclose(total, pooled.polar.covariance, rtol=1e-7, atol=1e-16)


def test_the_mean_of_curves_keeps_the_error_by_the_prior_that_all_flights_used() -> None:
    """With twenty flights the joint estimate covers the truth; the mean of the flights' polars states less than its
    error."""
    mean, joint = [], []
    for seed in range(40):
        results = campaign(seed, 20)
        pooled = joint_pool(results)
        joint.append(slowest_error_percent(pooled, POLAR))
        polars = [f.polar for f in pooled.flights]
        of_mean = Polar(
            np.mean([polar.A for polar in polars], axis=0),
            np.mean([p.covariance for p in polars], axis=0) / len(polars),
        )
        mean.append(slowest_error_percent(replace(pooled, polar=of_mean), POLAR))
    error, half = np.array(joint).T
    assert np.mean(np.abs(error) < half) >= 0.9
    mean_error, mean_half = np.array(mean).T
    assert np.mean(np.abs(mean_error) < mean_half) < 0.8
    assert np.std(mean_error) > 1.5 * np.std(error)


@pytest.mark.parametrize("installation", ["boom", ""])
def test_the_interval_narrows_with_flights_and_less_where_the_probe_is_mounted_anew(installation: str) -> None:
    results = campaign(3, 20, installation=installation)
    half = [joint_pool(results[:n]).half_widths_percent([1] * n, np.array([12.0]))[0] for n in (1, 2, 5, 20)]
    assert half == sorted(half, reverse=True)
    assert half[0] / half[-1] > (3 if installation else 1.5)


def test_the_common_part_of_mountings_is_known_no_better_than_their_scatter_allows() -> None:
    named, unnamed = (joint_pool(campaign(3, 6, noise=0.1, installation=name)) for name in ("boom", ""))
    index = POOLED.index("alpha_bias")
    scatter = 0.95 * POOLING.remounted * PRIOR_SIGMA[index] / np.sqrt(6)  # the prior adds a little information
    assert (
        unnamed.estimate.parameters.covariance[index, index] ** 0.5
        > scatter
        > 2 * named.estimate.parameters.covariance[index, index] ** 0.5
    )
    assert unnamed.notes == [NOT_NAMED]
    assert not named.notes


@pytest.mark.parametrize(
    ("facts", "message"),
    [
        ({"aircraft": "yours"}, "two aircraft"),
        ({"propeller": "apc-10x5"}, "two propellers"),
        ({"installation": "nose"}, "two installations"),
    ],
)
def test_flights_that_share_no_errors_are_refused(facts: dict[str, str], message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        joint_pool([*campaign(4, 1), *campaign(5, 1, **facts)])
    assert "4-0.mcap" in str(error.value)
    assert "5-0.mcap" in str(error.value)
    assert "compare" in str(error.value)


def test_a_flight_given_twice_and_results_without_statistics_are_refused(tmp_path: Path) -> None:
    (results,) = campaign(6, 1)
    with pytest.raises(InputError, match="same flight"):
        joint_pool([results, results])
    with pytest.raises(InputError, match="no flights"):
        pool_results([])
    path = tmp_path / "results.json"
    for content, message in (
        ({**results, "pooling": None}, "no statistics"),
        ({**results, "pooling": {**results["pooling"], "format": "flightpower-pooling-0"}}, "no statistics"),
        ({**results, "pooling": {**results["pooling"], "values": [1.0]}}, "malformed"),
        ([], "not a JSON object"),
    ):
        path.write_text(json.dumps(content), "utf-8")
        with pytest.raises(InputError, match=message) as error:
            joint_pool([path])
        assert str(path) in str(error.value)


def test_the_pool_of_files_equals_that_of_their_content(tmp_path: Path) -> None:
    results = campaign(7, 3)
    paths = [tmp_path / f"{i}.json" for i in range(3)]
    for path, item in zip(paths, results, strict=True):
        path.write_text(json.dumps(item), "utf-8")
    assert joint_pool(paths).results() == joint_pool(results).results()


def evidence(level: Trust) -> dict[str, Any]:
    return {"kind": EvidenceKind.MOTOR_SPEED, "level": level, "part": PartOfResult.CURVE, "text": "Check the poles."}


def test_a_pool_and_a_comparison_are_as_bad_as_their_worst_flight_and_name_it() -> None:
    good, bad, other = campaign(10, 3)
    for level in (Trust.DOUBTFUL, Trust.NOT_TO_BE_TRUSTED):
        pools = joint_pool([good, {**bad, "evidence": [evidence(level)], "trust": level}]), joint_pool([other])
        (piece,) = pools[0].evidence
        assert (piece.log, piece.level, piece.kind) == ("10-1.mcap", level, EvidenceKind.MOTOR_SPEED)
        pooled, (alone, with_bad) = pools[0].results(), (compare(*order).results("old", "new") for order in (
            pools, pools[::-1]))  # fmt: skip
        assert {pooled.trust, alone.trust, with_bad.trust} == {level}
        assert [flight.trust for flight in pooled.flights] == [Trust.TRUSTED, level]
        assert [result.evidence[0].log for result in (alone, with_bad)] == ["old/10-1.mcap", "new/10-1.mcap"]
    assert joint_pool([good, other]).results().trust is Trust.TRUSTED


def test_a_flight_of_an_earlier_version_has_no_verdict() -> None:
    good, old = campaign(10, 2)
    (evidence,) = joint_pool([good, {name: value for name, value in old.items() if name != "evidence"}]).evidence
    assert (evidence.log, evidence.kind, evidence.level) == ("10-1.mcap", EvidenceKind.NO_VERDICT, Trust.DOUBTFUL)


def test_a_calm_flight_contributes_most_and_another_like_it_is_offered() -> None:
    rng = np.random.default_rng(8)
    x = truth(rng)
    results = [flight(x, rng, f"windy {i}", noise=3.0) for i in range(3)] + [flight(x, rng, "calm")]
    result = joint_pool(results).results()
    shares = [flight.share_of_information for flight in result.flights]
    assert shares.index(max(shares)) == 3
    assert sum(shares) == pytest.approx(1)
    more = result.one_more
    assert more.like == "calm.mcap"
    assert np.all(np.array(more.half_width_then_percent) < more.half_width_percent)


def test_a_trend_over_temperature_is_found_and_none_over_date() -> None:
    rng = np.random.default_rng(9)
    x = truth(rng)
    results = []
    for i in range(8):
        factor = 1 + 0.01 * (i - 4)  # drag grows by 1 % per 5 K
        drift = np.concatenate([factor * POLAR, x[3:]])
        results.append(flight(drift, rng, str(i), 0.3, temperature_K=280.0 + 5 * i, start_unix_s=1.7e9 + i % 2 * 1e6))
    temperature, date = sorted(joint_pool(results).results().trends, key=lambda trend: trend.p)
    assert temperature.quantity == "air temperature"
    assert (temperature.lowest, temperature.highest) == (280.0, 315.0)
    assert temperature.change_percent == pytest.approx(7.0, abs=3 * temperature.standard_error_percent)
    assert temperature.p < 0.01
    assert date.quantity == "date"


@pytest.mark.parametrize(("dated", "trends", "expected"), [(8, 1, 0), (5, 1, 1), (0, 0, 1)])
def test_flights_without_a_date_are_left_out_of_its_trend_which_is_reported(
    dated: int, trends: int, expected: int
) -> None:
    rng = np.random.default_rng(9)
    x = truth(rng)
    starts = [1.7e9 + 1e6 * i if i < dated else None for i in range(8)]
    results = joint_pool([flight(x, rng, str(i), 0.3, start_unix_s=start) for i, start in enumerate(starts)]).results()
    over_date = [trend.flights for trend in results.trends if trend.quantity == "date"]
    assert over_date == [dated] * trends
    assert sum(f"{8 - dated} of 8 flights have no date" in note for note in results.notes) == expected


def test_half_widths_are_of_power_in_per_cent() -> None:
    pooled, V = joint_pool(campaign(3, 3)), np.array([12.0, 18.0])
    power, error = pooled.power(V)
    assert pooled.half_widths_percent([1, 1, 1], V) == pytest.approx(196 * error / power, rel=1e-3)
