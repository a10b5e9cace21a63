"""Changes of an airframe are reported soon, by kind, and rarely where nothing changed."""

import fleet as benchmark
import numpy as np
import pytest
from fleet_flights import flights_of

from flightpower.analysis.flights.agreement import ErrorParts
from flightpower.analysis.flights.changes import Change, Series, find_changes, flight_shares, series
from flightpower.analysis.flights.pool import joint_pool
from flightpower.analysis.records.fleet import Shape, What

A_YEAR = 200  # flights


def changes_of(count: int = 100, seed: int = 1, **change: object) -> list[Change]:
    flights = joint_pool(flights_of("one", seed, count, **change))  # type: ignore[arg-type]
    return find_changes(series(flights), np.arange(count, dtype=float), A_YEAR)


def after(flight: int, count: int = 100) -> np.ndarray:
    return np.arange(count) >= flight


@pytest.mark.parametrize("flights", [50, 200])
def test_an_airframe_that_does_not_change_raises_one_alarm_in_as_many_flights_as_allowed(flights: int) -> None:
    """Nothing was tuned on these seeds; the number of alarms in 4,000 flights is a Poisson number."""
    own = np.tile(np.diag([0.02, 0.006]) ** 2, (flights, 1, 1))
    shared = np.tile(np.diag([0.01, 0.01])[:, :1], (flights, 1, 1))
    times, sequences, message = np.arange(flights, dtype=float), 4000 // flights, 0
    for seed in range(1000, 1000 + sequences):
        noise = np.random.default_rng(seed).standard_normal((flights, 2)) * [0.02, 0.006]
        of_flights = Series(noise, np.tile(np.eye(2), (flights, 1, 1)), ErrorParts(own, shared))
        message += len(find_changes(of_flights, times, flights))
    assert message == pytest.approx(sequences, abs=4 * np.sqrt(sequences))
    assert message > 0.2 * sequences


def test_a_worn_propeller_is_reported_as_propulsion_within_a_few_flights() -> None:
    (change,) = changes_of(thrust=-0.05 * after(60))
    assert (change.what, change.shape, change.since) == (What.PROPULSION, Shape.STEP, 60)
    assert change.detected <= 63
    assert change.thrust == pytest.approx(-0.05, abs=3 * change.errors[1])
    assert abs(change.drag) < 3 * change.errors[0]


def test_a_dented_wing_is_reported_as_drag() -> None:
    (change,) = changes_of(drag=0.05 * after(60), noise=0.3)
    assert change.what is What.DRAG and change.since == pytest.approx(60, abs=3) and change.detected <= 66
    assert change.drag == pytest.approx(0.05, abs=3 * change.errors[0])
    assert change.errors[0] < 0.005


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("times", [np.zeros(12), np.r_[np.arange(11.0), 10.0]], ids=["all", "the last two"])
def test_flights_of_one_time_show_steps_and_no_drift(times: np.ndarray) -> None:
    """The clock stood still, or one log was split."""
    of_flights = series(joint_pool(flights_of("one", 5, 12, drag=0.3 * after(6, 12))))
    (change,) = find_changes(of_flights, times, A_YEAR)
    assert (change.shape, change.since) == (Shape.STEP, 6) and change.drag == pytest.approx(0.3, abs=0.1)


def test_each_flight_shows_the_change_within_its_own_errors() -> None:
    """40 of 100 flights have 5 % more drag and 3 % less thrust; the residuals are as large as stated."""
    changed = after(60)
    pool = joint_pool(flights_of("one", 3, 100, drag=0.05 * changed, thrust=-0.03 * changed, noise=0.3))
    of_flights = series(pool)
    changes = find_changes(of_flights, np.arange(100, dtype=float), A_YEAR)
    values, errors = flight_shares(of_flights, changes)
    truth = np.outer(changed, [0.05, -0.03])
    assert values[changed].mean(axis=0) == pytest.approx([0.05, -0.03], abs=0.004)
    assert np.std((values - truth) / errors, axis=0) == pytest.approx([1.0, 1.0], abs=0.25)


def test_a_flight_that_does_not_tell_drag_from_thrust_is_left_out() -> None:
    by_truth = np.stack([np.eye(2), np.ones((2, 2)), np.eye(2)])
    errors = ErrorParts(np.tile(1e-4 * np.eye(2), (3, 1, 1)), np.zeros((3, 2, 1)))
    values, _ = flight_shares(Series(np.array([[0.9, 0.0], [5.0, 5.0], [1.1, 0.0]]), by_truth, errors), [])
    assert values[[0, 2]] == pytest.approx(np.array([[-0.1, 0.0], [0.1, 0.0]])) and np.isnan(values[1]).all()


def test_dirt_that_grows_is_reported_as_a_drift_until_the_last_flight() -> None:
    """Drag grows by 10 % over the last 60 of 100 flights."""
    grown = 0.1 * np.clip((np.arange(100) - 40) / 60, 0, None)
    changes = changes_of(drag=grown, noise=0.3)
    assert What.PROPULSION not in {change.what for change in changes} and Shape.DRIFT in {
        change.shape for change in changes
    }
    assert changes[0].since == pytest.approx(48, abs=10) and changes[0].detected < 70
    assert sum(change.drag for change in changes) == pytest.approx(0.1, abs=0.02)
    assert abs(sum(change.thrust for change in changes)) < 0.01


def test_the_change_has_the_error_stated() -> None:
    """The thrust of 12 airframes changes; errors of the change over stated errors have an rms near 1."""
    ratios = []
    for seed in range(1100, 1112):
        changes = changes_of(60, seed, thrust=0.05 * after(30, 60))
        nearest = min(changes, key=lambda change: abs(change.since - 30))
        ratios.append((nearest.thrust - 0.05) / nearest.errors[1])
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.45)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_flights_show_no_change(count: int) -> None:
    assert changes_of(count) == []


@pytest.mark.parametrize("odd", [2, 10])
def test_one_odd_flight_is_no_change(odd: int) -> None:
    """It has a fifth less drag than the flights before and after it."""
    assert changes_of(20, drag=-0.2 * (np.arange(20) == odd), noise=0.3) == []
    later = changes_of(40, drag=-0.2 * (np.arange(40) == odd), thrust=-0.05 * after(30, 40), noise=0.3)
    assert [(change.what, change.since) for change in later] == [(What.PROPULSION, 30)]


@pytest.mark.parametrize("slowly", [False, True])
def test_without_noise_a_change_is_reported_where_theory_has_it(slowly: bool) -> None:
    """The detector's own statistic of flights without scatter is compared with the closed form of the benchmark. It
    lacks the 2 that noise adds in the mean, so the alarm comes no sooner and only a little later."""
    n, change = benchmark.BEFORE + benchmark.A_YEAR, np.array([0.02, -0.003])
    own = np.tile([[0.03**2, 1e-5], [1e-5, 0.01**2]], (n, 1, 1))
    shared = np.tile(np.array([[0.02], [0.01]]), (n, 1, 1))
    by_truth = np.tile([[0.9, 0.1], [0.0, 0.8]], (n, 1, 1))
    late = np.arange(n) - benchmark.BEFORE
    grown = np.clip(late / 80, 0, None) if slowly else (late >= 0).astype(float)
    of_flights = Series(grown[:, None] * (by_truth[0] @ change), by_truth, ErrorParts(own, shared))
    (result, *_) = find_changes(of_flights, np.arange(float(n)), A_YEAR)
    expected = benchmark.expected_delay(of_flights, grown, (0.02, -0.003))
    assert expected is not None and expected > 20
    assert 0 <= result.detected - benchmark.BEFORE + 1 - expected <= 0.3 * expected
