"""Power of slow vertical gusts over that of the assumed spectrum."""

import numpy as np
import pytest

from analysis.trajectory import dryden
from analysis.trajectory.slow_gusts import planned_ratio, slow_power_ratio, with_slow_power

STEP_S, HEIGHT_M, V = 0.2, 40.0, 15.0


def _gust(sigma: float, length: float, seconds: float, seed: int) -> np.ndarray:
    """Dryden's vertical gust, its scale `length` times the standard's."""
    gust = dryden.vertical(sigma, HEIGHT_M, V / length)
    decay, once, twice = gust.discretize(STEP_S)
    rng, n = np.random.default_rng(seed), round(seconds / STEP_S)
    noise, g1, g2, out = rng.standard_normal((n, 2)), 0.0, 0.0, np.empty(n)
    for i in range(n):
        before, g1 = g1, decay * g1 + once * noise[i, 0]
        g2 = decay * g2 + (1 - decay) * (before + g1) / 2 + twice * noise[i, 1]
        out[i] = g2 + np.sqrt(3) * (g1 - g2)
    return out


def _found(length: float, seconds: float, seed: int, prior: float = 1.4) -> float:
    """The ratio for such a gust, whose fast part has the assumed intensity: sigma^2 over length is the same."""
    gust = _gust(0.1 * np.sqrt(length), length, seconds, seed)
    return slow_power_ratio(gust, np.zeros((1, len(gust))), STEP_S, dryden.vertical(0.1, HEIGHT_M, V), prior)


def test_gusts_as_assumed_have_a_ratio_of_one_in_the_mean() -> None:
    """Flights of four minutes, 40 of them; a flight in gusts as the planner expects them has the planner's ratio."""
    found = [_found(1.0, 240, seed, prior=1.0) for seed in range(40)]
    assert np.mean(found) == pytest.approx(1, abs=0.12)
    assert np.std(found) < 0.4
    planned = planned_ratio(1200, STEP_S, dryden.vertical(0.1, HEIGHT_M, V), 1.0)
    assert planned == pytest.approx(np.mean(found), abs=0.12)


def test_longer_gusts_of_the_same_fast_part_have_more_slow_power() -> None:
    """Power at frequency zero is sigma^2 T: with sigma^2 over T the same, it grows with the square of T. Four minutes
    show it already."""
    assert np.mean([_found(2.0, 1200, seed) for seed in range(12)]) == pytest.approx(4, rel=0.2)
    assert np.mean([_found(0.5, 1200, seed) for seed in range(12)]) == pytest.approx(1 / 4, rel=0.2)
    assert np.mean([_found(2.0, 240, seed) for seed in range(30)]) == pytest.approx(4, rel=0.3)


def test_what_the_reconstruction_smooths_away_is_counted_by_its_random_errors() -> None:
    """Errors with a quarter of the gust's power and its spectrum: a quarter more."""
    gust = _gust(0.1, 1.0, 1200, 3)
    assumed = dryden.vertical(0.1, HEIGHT_M, V)
    lost = np.stack([_gust(0.05, 1.0, 1200, seed) for seed in range(10, 26)])
    whole, with_lost = (slow_power_ratio(gust, errors, STEP_S, assumed, 1.4) for errors in (0 * lost, lost))
    assert with_lost / whole - 1 == pytest.approx(0.25, rel=0.3)


def test_a_short_flight_keeps_the_users_length_and_a_long_one_its_own() -> None:
    assumed = dryden.vertical(0.1, HEIGHT_M, V)
    for n in (0, 20):
        assert slow_power_ratio(np.ones(n), np.zeros((1, n)), STEP_S, assumed, 1.7) == 1.7
        assert planned_ratio(n, STEP_S, assumed, 1.7) == 1.7
    of_user = {seconds: [_found(1.0, seconds, seed, 3.0) / _found(1.0, seconds, seed) for seed in range(6)]
               for seconds in (120, 2400)}  # fmt: skip
    assert np.mean(of_user[120]) > 1.2
    assert np.mean(of_user[2400]) == pytest.approx(1, abs=0.08)


def test_information_of_the_data_is_divided_by_the_length_and_that_of_the_prior_is_not() -> None:
    prior, data = np.diag([1.0, 4.0]), np.array([[2.0, 0.5], [0.5, 3.0]])
    storm = with_slow_power(np.linalg.inv(prior + data), np.array([1.0, 0.5]), 1e3, 2.0)
    assert np.linalg.inv(storm) == pytest.approx(prior + data / 2, rel=1e-6)
    calm = with_slow_power(np.linalg.inv(prior + data), np.array([1.0, 0.5]), 0.0, 2.0)
    assert np.linalg.inv(calm) == pytest.approx(prior + data)
