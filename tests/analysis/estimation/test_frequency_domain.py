"""Estimation on Fourier transforms: output error, equation error, transfer functions, and regression in flight."""

import numpy as np
import pytest

from analysis.estimation import equation_error, output_error
from analysis.estimation.data import Segment, band_matrix, frequencies_of, transform
from analysis.estimation.recursive_fourier import RecursiveFourierRegression
from analysis.estimation.transfer_function import starting_values, transfer_function
from flight.errors import InputError
from tests.analysis.estimation.test_output_error import CLEAN, DE, SHORT_PERIOD, SIGMA, STEP_S, T_S, TRUTH, noisy

BAND_HZ = (0.15, 2.5)


def drifting(seed):
    """A record with drift far below the band and a vibration above it, each ten times as large as the noise."""
    segment = noisy(seed)
    z = {
        name: values + 10 * SIGMA[name] * (np.cos(2 * np.pi * 0.02 * T_S) + np.sin(2 * np.pi * 8.5 * T_S))
        for name, values in segment.z.items()
    }
    return Segment(name="run", t_s=T_S, u=segment.u, z=z)


def test_transforms_of_white_noise_keep_its_variance_and_are_independent():
    T = band_matrix(BAND_HZ, 150, STEP_S)
    assert T @ T.T == pytest.approx(np.eye(len(T)), abs=1e-12)


def test_the_transform_is_that_of_the_integral():
    """exp(-t) on 0 to 20 s: 1/(1 + j omega), to the error of the sum, half a step."""
    t = np.arange(0, 20, 0.001)
    f = np.array([0.1, 0.5])
    assert transform(np.exp(-t), 0.001, f) == pytest.approx(1 / (1 + 2j * np.pi * f), abs=1e-3)


def test_output_error_in_a_band_is_unbiased_and_scatters_as_its_bound():
    """64 seeds: the scatter is known to 9 %, the mean to 1/8 of the scatter."""
    fits = [output_error.estimate(SHORT_PERIOD, noisy(seed), band_Hz=BAND_HZ) for seed in range(64)]
    assert all(fit.verdict.ok for fit in fits)
    errors = np.array([fit.values[:4] for fit in fits]) - np.array([*TRUTH.values()])
    scatter = errors.std(axis=0)
    bound = np.sqrt(np.mean([np.diag(fit.covariance)[:4] for fit in fits], axis=0))
    assert np.all(np.abs(errors.mean(axis=0)) < 4 * scatter / 8)
    assert scatter / bound == pytest.approx(np.ones(4), abs=0.3)


def test_drift_and_vibration_outside_the_band_do_no_harm():
    """In time they bias the estimates by many standard errors; in the band by less than three."""
    in_band = output_error.estimate(SHORT_PERIOD, drifting(0), band_Hz=(0.3, 2.5))
    in_time = output_error.estimate(SHORT_PERIOD, drifting(0))
    truth = np.array([*TRUTH.values()])

    def worst(fit):
        return np.max(np.abs(fit.values[:4] - truth) / np.abs(truth))

    assert worst(in_band) < 0.1
    assert worst(in_time) > 2 * worst(in_band)


def test_the_whole_band_gives_what_time_gives():
    """All frequencies are an orthonormal change of coordinates, but for mean and Nyquist frequency."""
    whole = output_error.estimate(SHORT_PERIOD, noisy(1), band_Hz=(0.0, 12.4))
    in_time = output_error.estimate(SHORT_PERIOD, noisy(1))
    assert np.all(np.abs(whole.values - in_time.values)[:4] < 0.5 * np.sqrt(np.diag(in_time.covariance))[:4])


def test_equation_error_in_a_band_is_near_the_truth():
    """Two biases stay: noise in the regressors within the band, and the leakage of the derivative's noise."""
    found = [equation_error.estimate_in_band(SHORT_PERIOD, noisy(seed), band_Hz=BAND_HZ) for seed in range(10)]
    mean = np.mean([[fit.parameters[name].value for name in TRUTH] for fit in found], axis=0)
    assert mean == pytest.approx([*TRUTH.values()], rel=0.15)


def test_a_transfer_function_is_found_from_its_response():
    """Pitch rate from elevator of the short period: q/de = Mde (s - Zal)/(s^2 - (Zal + Mq) s + Zal Mq - Mal)."""
    model = transfer_function(1, 2, u="de", y="q")
    segment = Segment(name="run", t_s=T_S, u={"de": DE}, z={"q": noisy(3).z["q"]})
    start = starting_values(model, segment, BAND_HZ)
    truth = {
        "b0": -TRUTH["Mde"] * TRUTH["Zal"],
        "b1": TRUTH["Mde"],
        "a0": TRUTH["Zal"] * TRUTH["Mq"] - TRUTH["Mal"],
        "a1": -TRUTH["Zal"] - TRUTH["Mq"],
    }
    assert start == pytest.approx(truth, rel=0.35)
    for options in ({}, {"band_Hz": BAND_HZ}):
        fit = output_error.estimate(model, segment, start=start, initial_states="given", **options)
        assert fit.verdict.ok
        for name, value in truth.items():
            assert fit.parameters[name].value == pytest.approx(value, abs=4 * fit.parameters[name].standard_error)


def test_the_recursive_estimate_ends_where_the_batch_does():
    rng = np.random.default_rng(4)
    X = np.column_stack([CLEAN["alpha"], CLEAN["q"], DE])
    z = X @ [-20.0, -3.0, -25.0] + 0.2 * rng.standard_normal(len(X)) + 5.0
    f = frequencies_of(BAND_HZ, len(X), STEP_S)
    recursive = RecursiveFourierRegression(3, f, STEP_S)
    for row, value in zip(X, z, strict=True):
        recursive.add(row, value)
    found = recursive.estimate()
    T = band_matrix(BAND_HZ, len(X), STEP_S)
    assert found.values == pytest.approx(np.linalg.lstsq(T @ X, T @ z, rcond=None)[0], rel=1e-9)
    assert np.sqrt(found.noise_variance) == pytest.approx(0.2, rel=0.25)
    assert np.all(np.abs(found.values - [-20.0, -3.0, -25.0]) < 4 * found.standard_errors)


def test_with_memory_the_recursive_estimate_follows_a_change():
    rng = np.random.default_rng(5)
    u = rng.standard_normal(2000)
    gain = np.where(np.arange(2000) < 1000, 1.0, 2.0)
    followed = RecursiveFourierRegression(1, np.arange(0.1, 3, 0.1), STEP_S, memory_s=8.0)
    for value, factor in zip(u, gain, strict=True):
        followed.add([value], factor * value)
    assert followed.estimate().values[0] == pytest.approx(2.0, abs=0.1)


def test_wrong_bands_and_records_are_refused():
    with pytest.raises(InputError, match=r"resolves 0\.17 Hz only"):
        output_error.estimate(SHORT_PERIOD, noisy(0), band_Hz=(0.2, 0.3))
    with pytest.raises(InputError, match="half the sampling rate of 25 Hz"):
        output_error.estimate(SHORT_PERIOD, noisy(0), band_Hz=(0.2, 13.0))
    holed = noisy(0)
    holed.z["q"][3] = np.nan
    with pytest.raises(InputError, match="output q has missing samples"):
        output_error.estimate(SHORT_PERIOD, holed, band_Hz=BAND_HZ)
    with pytest.raises(InputError, match="numerator's order must be smaller"):
        transfer_function(2, 2)
    with pytest.raises(InputError, match="half the sampling rate of 25 Hz"):
        RecursiveFourierRegression(1, [1.0, 13.0], STEP_S)
    with pytest.raises(InputError, match="determine 1 of 2 coefficients"):
        twice = RecursiveFourierRegression(2, [0.5, 1.0], STEP_S)
        twice.add([1.0, 2.0], 3.0)
        twice.estimate()
