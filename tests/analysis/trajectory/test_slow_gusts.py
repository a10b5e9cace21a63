"""Tests the ratio of slow gusts' power to that of the assumed spectra, and its effect on sensor errors."""

import numpy as np
import pytest

from flightpower.analysis.trajectory import dryden
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.gusts import (
    GUST_AXIS_OF_ERROR,
    LENGTHS,
    AxisSpectrum,
    Estimate,
    ScaleLength,
    gust_spectra,
    planned_ratios,
    scale_length,
    slow_power_ratios,
    with_slow_power,
)
from flightpower.analysis.trajectory.settings import GUSTS

STEP_S, HEIGHT_M, V = 0.2, 40.0, 15.0
AT = 0.1, HEIGHT_M, V
STANDARD = dryden.longitudinal(*AT), dryden.lateral(*AT), dryden.vertical(*AT)


def _of_length(gust, length: float, root_power: float = 1.0):
    return gust._replace(time_s=gust.time_s * length, sigma_mps=gust.sigma_mps * root_power)


def _first_order(gust: dryden.GaussMarkov, noise: np.ndarray) -> np.ndarray:
    decay, increment = gust.discretize(STEP_S)
    out = np.zeros(len(noise))
    for i in range(1, len(noise)):
        out[i] = decay * out[i - 1] + increment * noise[i]
    return out


def _second_order(gust: dryden.SecondOrderGust, noise: np.ndarray) -> np.ndarray:
    decay, once, twice = gust.discretize(STEP_S)
    g1, g2, out = 0.0, 0.0, np.empty(len(noise))
    for i in range(len(noise)):
        before, g1 = g1, decay * g1 + once * noise[i, 0]
        g2 = decay * g2 + (1 - decay) * (before + g1) / 2 + twice * noise[i, 1]
        out[i] = g2 + np.sqrt(3) * (g1 - g2)
    return out


def _gusts(length: float, seconds: float, seed: int, root_power: float = 1.0) -> np.ndarray:
    """Return Dryden gusts of three axes (3, n), with scales `length` times the standard's."""
    rng, n = np.random.default_rng(seed), round(seconds / STEP_S)
    u, v, w = (_of_length(gust, length, root_power) for gust in STANDARD)
    return np.stack(
        [
            _first_order(u, rng.standard_normal(n)),
            _second_order(v, rng.standard_normal((n, 2))),
            _second_order(w, rng.standard_normal((n, 2))),
        ]
    )


def _ratios(gusts: np.ndarray, errors: np.ndarray | None = None, prior: float = 1.4) -> np.ndarray:
    errors = np.zeros((3, 1, gusts.shape[1])) if errors is None else errors
    return slow_power_ratios(gust_spectra(gusts, errors, STEP_S, STANDARD, GUSTS.slow), prior)


def _estimated(length: float, seconds: float, seed: int, prior: float = 1.4) -> np.ndarray:
    """Return the ratios for gusts whose fast part has the assumed intensity: sigma^2 over length is unchanged."""
    return _ratios(_gusts(length, seconds, seed, np.sqrt(length)), prior=prior)


def test_gusts_as_assumed_have_a_ratio_of_one_in_the_mean() -> None:
    """The mean is over 80 flights of four minutes. Gusts as the planner expects them have the planner's ratios."""
    result = np.array([_estimated(1.0, 240, seed, prior=1.0) for seed in range(80)])
    assert np.mean(result, axis=0) == pytest.approx(1, abs=0.12)
    assert np.std(result, axis=0).max() < 0.4
    planned = planned_ratios(1200, STEP_S, STANDARD, 1.0)
    assert planned == pytest.approx(np.mean(result, axis=0), abs=0.12)


def test_the_ratio_is_the_mean_of_the_posterior_of_intensity_and_length() -> None:
    """It agrees with a sum over a grid of both. With few frequencies, another degree of freedom would be a tenth."""
    m = GUSTS.fewest_frequencies
    omega = np.linspace(0.05, 0.7, m)
    assumed = STANDARD[2]
    axis = AxisSpectrum(np.random.default_rng(5).exponential(assumed.power(omega)), omega, assumed)
    log_intensity = np.linspace(np.log(0.05), np.log(50.0), 3000)
    spectra = np.array([_of_length(assumed, length).power(omega) for length in LENGTHS])
    A = np.sum(axis.power / spectra, axis=1)
    log_likelihood = -np.sum(np.log(spectra), axis=1)[:, None] - m * log_intensity - A[:, None] / np.exp(log_intensity)
    log_prior = -((np.log(LENGTHS) / np.log(GUSTS.length_factor)) ** 2) / 2
    posterior = np.exp(log_likelihood + log_prior[:, None] - np.max(log_likelihood))
    mean = np.sum(posterior * np.exp(log_intensity) * LENGTHS[:, None]) / np.sum(posterior)
    assert slow_power_ratios([axis], 1.0) == pytest.approx(mean, rel=1e-3)


def test_longer_gusts_of_the_same_fast_part_have_more_slow_power() -> None:
    """Power at frequency zero is sigma^2 T; with sigma^2 over T unchanged, it grows with the square of T. Four minutes
    already show it for vertical gusts, and twenty minutes for all gusts."""
    assert np.mean([_estimated(2.0, 1200, seed) for seed in range(12)], axis=0) == pytest.approx(4, rel=0.2)
    assert np.mean([_estimated(0.5, 1200, seed) for seed in range(12)], axis=0) == pytest.approx(1 / 4, rel=0.2)
    assert np.mean([_estimated(2.0, 240, seed)[2] for seed in range(30)]) == pytest.approx(4, rel=0.3)


def test_each_axis_has_an_intensity_of_its_own() -> None:
    """Longitudinal gusts have twice the assumed power, and the others are as assumed."""
    twice = np.sqrt([2.0, 1.0, 1.0])[:, None]
    ratios = [_ratios(twice * _gusts(1.0, 1200, seed)) for seed in range(12)]
    assert np.mean(ratios, axis=0) == pytest.approx([2.0, 1.0, 1.0], rel=0.2)


def test_what_the_reconstruction_smooths_away_is_counted_by_its_random_errors() -> None:
    """Errors with the gusts' spectra and a quarter of their power make the ratio a quarter larger."""
    lost = np.stack([_gusts(1.0, 1200, seed, 0.5) for seed in range(10, 26)], axis=1)
    complete, with_lost = (
        np.mean([_ratios(_gusts(1.0, 1200, seed), errors) for seed in range(30, 42)], axis=0)
        for errors in (0 * lost, lost)
    )
    assert with_lost / complete - 1 == pytest.approx(0.25, rel=0.3)


def test_a_short_flight_keeps_the_users_length_and_a_long_one_its_own() -> None:
    for n in (0, 20):
        assert _ratios(np.ones((3, n)), prior=1.7).tolist() == [1.7] * 3
        assert planned_ratios(n, STEP_S, STANDARD, 1.7).tolist() == [1.7] * 3
    of_user = {seconds: [(_estimated(1.0, seconds, seed, 3.0) / _estimated(1.0, seconds, seed))[2] for seed in range(6)]
               for seconds in (120, 2400)}  # fmt: skip
    assert np.mean(of_user[120]) > 1.2
    assert np.mean(of_user[2400]) == pytest.approx(1, abs=0.08)


def test_a_length_that_the_user_states_denies_nothing_in_a_flight_too_short_to_show_it() -> None:
    for assumed in (0.1, 1.0, 10.0):
        assert not _scale_length(1.0, 10.0, 0, assumed).assumed_length_rejected


def _scale_length(length: float, seconds: float, seed: int, assumed: float = 1.0) -> ScaleLength:
    """Return the scale length found for gusts with the standard's fast part."""
    gusts = _gusts(length, seconds, seed, np.sqrt(length))
    errors = np.zeros((3, 1, gusts.shape[1]))
    return scale_length(gust_spectra(gusts, errors, STEP_S, STANDARD, GUSTS.around_corner), assumed)


@pytest.mark.parametrize(("length", "rejected"), [(1.0, False), (0.4, True), (2.5, False)])
def test_four_minutes_show_short_gusts_at_the_corner_of_the_spectrum(length: float, rejected: bool) -> None:
    """Longer gusts differ below the corner, where four minutes have few periods."""
    assert [_scale_length(length, 240, seed).assumed_length_rejected for seed in range(12)] == [rejected] * 12


@pytest.mark.parametrize("length", [1.0, 0.6, 0.4])
def test_twenty_minutes_show_the_scale_length_within_its_error(length: float) -> None:
    scale_lengths = [_scale_length(length, 1200, seed) for seed in range(12)]
    log_error = np.log([scale_length.ratio for scale_length in scale_lengths]) - np.log(length)
    assert np.mean(log_error) == pytest.approx(0, abs=0.1)
    assert 0.5 < np.std(log_error) / np.mean([scale_length.log_sigma for scale_length in scale_lengths]) < 1.3


def test_a_length_is_denied_beyond_three_standard_deviations() -> None:
    """So 1 of 370 flights with gusts as assumed is reconstructed twice."""
    assert (
        ScaleLength(np.exp(0.31), 0.1).assumed_length_rejected
        and ScaleLength(np.exp(-0.31), 0.1).assumed_length_rejected
    )
    assert (
        not ScaleLength(np.exp(0.29), 0.1).assumed_length_rejected
        and not ScaleLength(np.exp(-0.29), 0.1).assumed_length_rejected
    )


def _estimate(factor: np.ndarray | float = 1.0) -> tuple[Estimate, Estimate, np.ndarray, np.ndarray]:
    """Return the estimate and prior of all sensor errors from data whose errors are `factor` times as large, and the
    data's own estimate and information, with correlations."""
    m, rng = len(SENSOR_ERRORS), np.random.default_rng(5)
    root = np.eye(m) + 0.1 * rng.standard_normal((m, m))
    information, data = root @ root.T / np.outer(factor, factor), rng.standard_normal(m)
    of_prior, expected = np.diag(rng.uniform(0.5, 4.0, m)), rng.standard_normal(m)
    covariance = np.linalg.inv(information + of_prior)
    values = covariance @ (information @ data + of_prior @ expected)
    return Estimate(values, covariance), Estimate(expected, np.linalg.inv(of_prior)), data, information


def test_the_estimate_is_that_of_data_with_larger_errors_where_gusts_look_like_the_error() -> None:
    """It is as if errors of the data were larger by the root of the ratio, so the prior has more weight."""
    result, prior, data, information = _estimate()
    ratios, factor = np.array([4.0, 2.0, 3.0]), np.ones(len(SENSOR_ERRORS))
    for name, axis in GUST_AXIS_OF_ERROR.items():
        factor[SENSOR_ERRORS.index(name)] = np.sqrt(ratios[axis])
    storm = with_slow_power(result, prior, 1e3, ratios)
    less, of_prior = information / np.outer(factor, factor), np.linalg.inv(prior.covariance)
    assert np.linalg.inv(storm.covariance) == pytest.approx(less + of_prior, rel=1e-4, abs=1e-4)
    expected = storm.covariance @ (less @ data + of_prior @ prior.values)
    assert storm.values == pytest.approx(expected, abs=1e-4)


def test_in_calm_air_the_estimate_stays() -> None:
    result, prior, *_ = _estimate()
    calm = with_slow_power(result, prior, 0.0, np.array([4.0, 2.0, 3.0]))
    assert calm.values == pytest.approx(result.values, abs=1e-4)
    assert calm.covariance == pytest.approx(result.covariance, abs=1e-4)


def test_what_the_data_do_not_show_stays_at_its_prior() -> None:
    """If the data contain nothing about an error, neither its estimate nor its standard error changes."""
    factor = np.ones(len(SENSOR_ERRORS))
    factor[0] = 1e5
    result, prior, *_ = _estimate(factor)
    storm = with_slow_power(result, prior, 1e3, np.array([4.0, 2.0, 3.0]))
    assert storm.values[0] == pytest.approx(prior.values[0], abs=2e-3)
    assert storm.covariance[0, 0] == pytest.approx(prior.covariance[0, 0], rel=1e-3)
