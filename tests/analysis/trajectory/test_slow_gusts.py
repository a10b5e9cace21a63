"""Power of slow vertical gusts over that of the assumed spectrum."""

import numpy as np
import pytest

from analysis.trajectory import dryden
from analysis.trajectory.slow_gusts import SlowGusts, expected_slow_gusts, slow_gusts, with_gust_length

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


def _found(length: float, seconds: float, seed: int) -> SlowGusts:
    """The ratio for such a gust, whose fast part has the assumed intensity: sigma^2 over length is the same."""
    gust = _gust(0.1 * np.sqrt(length), length, seconds, seed)
    return slow_gusts(gust, np.zeros((1, len(gust))), STEP_S, dryden.vertical(0.1, HEIGHT_M, V))


def test_gusts_as_assumed_have_a_ratio_of_one_with_the_stated_degrees_of_freedom() -> None:
    """A mean of m powers of a normal process is chi-squared over 2 m: variance 2/(2 m). 40 flights of four minutes."""
    found = [_found(1.0, 240, seed) for seed in range(40)]
    ratio, degrees = np.array([f.ratio for f in found]), found[0].degrees
    assert np.mean(ratio) == pytest.approx(1, abs=3 * np.sqrt(2 / degrees / 40))
    assert np.std(ratio) == pytest.approx(np.sqrt(2 / degrees), rel=0.35)
    assert expected_slow_gusts(1200, STEP_S, dryden.vertical(0.1, HEIGHT_M, V)).degrees == degrees


def test_longer_gusts_of_the_same_fast_part_have_more_slow_power() -> None:
    """Power at frequency zero is sigma^2 T: with sigma^2 over T the same, it grows with the square of T."""
    assert np.mean([_found(2.0, 1200, seed).ratio for seed in range(6)]) == pytest.approx(4, rel=0.2)
    assert np.mean([_found(0.5, 1200, seed).ratio for seed in range(6)]) == pytest.approx(1 / 4, rel=0.2)


def test_what_the_reconstruction_smooths_away_is_counted_by_its_random_errors() -> None:
    gust = _gust(0.1, 1.0, 1200, 3)
    assumed = dryden.vertical(0.1, HEIGHT_M, V)
    lost = np.stack([_gust(0.05, 1.0, 1200, seed) for seed in range(10, 26)])
    whole, with_lost = (slow_gusts(gust, errors, STEP_S, assumed).ratio for errors in (0 * lost, lost))
    assert with_lost - whole == pytest.approx(0.25, rel=0.3)


def test_a_short_flight_keeps_the_users_length_and_a_long_one_its_own() -> None:
    assert SlowGusts(1.0, 0.0).length(1.4) == 1.4
    assert SlowGusts(2.5, 8.0).length(1.5) == pytest.approx(2.0)
    assert SlowGusts(2.5, 800.0).length(1.4) == pytest.approx(2.5, rel=0.01)
    assert slow_gusts(np.ones(20), np.zeros((1, 20)), STEP_S, dryden.vertical(0.1, HEIGHT_M, V)).degrees == 0
    assert slow_gusts(np.ones(0), np.zeros((1, 0)), STEP_S, dryden.vertical(0.1, HEIGHT_M, V)).degrees == 0


def test_information_of_the_data_is_divided_by_the_length_and_that_of_the_prior_is_not() -> None:
    prior, data = np.diag([1.0, 4.0]), np.array([[2.0, 0.5], [0.5, 3.0]])
    storm = with_gust_length(np.linalg.inv(prior + data), np.array([1.0, 0.5]), 1e3, 2.0)
    assert np.linalg.inv(storm) == pytest.approx(prior + data / 2, rel=1e-6)
    calm = with_gust_length(np.linalg.inv(prior + data), np.array([1.0, 0.5]), 0.0, 2.0)
    assert np.linalg.inv(calm) == pytest.approx(prior + data)
