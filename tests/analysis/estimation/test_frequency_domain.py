"""Tests output error and equation error on Fourier transforms."""

import numpy as np
import pytest

from flightpower.analysis.estimation.data import Segment, band_matrix
from flightpower.analysis.estimation.equation_error import fit_equation_error_in_band
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.flight.errors import InputError
from tests.analysis.estimation.test_output_error import SHORT_PERIOD, SIGMA, STEP_S, T_S, TRUTH, noisy

BAND_HZ = (0.15, 2.5)


def drifting(seed):
    """Return a record with drift far below the band and vibration above it, each ten times as large as the noise."""
    segment = noisy(seed)
    z = {
        name: values + 10 * SIGMA[name] * (np.cos(2 * np.pi * 0.02 * T_S) + np.sin(2 * np.pi * 8.5 * T_S))
        for name, values in segment.z.items()
    }
    return Segment(name="run", t_s=T_S, u=segment.u, z=z)


def test_transforms_of_white_noise_keep_its_variance_and_are_independent():
    T = band_matrix(BAND_HZ, 150, STEP_S)
    assert T @ T.T == pytest.approx(np.eye(len(T)), abs=1e-12)


def test_output_error_in_a_band_is_unbiased_and_scatters_as_its_bound():
    """With 64 seeds, the scatter is known to 9 %, and the mean to 1/8 of the scatter."""
    fits = [fit_output_error(SHORT_PERIOD, noisy(seed), band_Hz=BAND_HZ) for seed in range(64)]
    assert all(fit.verdict.ok for fit in fits)
    errors = np.array([fit.values[:4] for fit in fits]) - np.array([*TRUTH.values()])
    scatter = errors.std(axis=0)
    bound = np.sqrt(np.mean([np.diag(fit.covariance)[:4] for fit in fits], axis=0))
    assert np.all(np.abs(errors.mean(axis=0)) < 4 * scatter / 8)
    assert scatter / bound == pytest.approx(np.ones(4), abs=0.3)


def test_drift_and_vibration_outside_the_band_do_no_harm():
    """In the band, estimates are right to 10 %; in the time domain, their errors are more than twice as large."""
    in_band = fit_output_error(SHORT_PERIOD, drifting(0), band_Hz=(0.3, 2.5))
    in_time = fit_output_error(SHORT_PERIOD, drifting(0))
    truth = np.array([*TRUTH.values()])

    def worst(fit):
        return np.max(np.abs(fit.values[:4] - truth) / np.abs(truth))

    assert worst(in_band) < 0.1
    assert worst(in_time) > 2 * worst(in_band)


def test_the_whole_band_gives_what_time_gives():
    """The transform to all frequencies is orthonormal, except that mean and Nyquist frequency are left out."""
    full_band = fit_output_error(SHORT_PERIOD, noisy(1), band_Hz=(0.0, 12.4))
    in_time = fit_output_error(SHORT_PERIOD, noisy(1))
    assert np.all(np.abs(full_band.values - in_time.values)[:4] < 0.5 * np.sqrt(np.diag(in_time.covariance))[:4])


def test_equation_error_in_a_band_is_near_the_truth():
    """Two biases remain: noise in the regressors within the band, and leakage of the derivative's noise."""
    equation_error_in_bands = [
        fit_equation_error_in_band(SHORT_PERIOD, noisy(seed), band_Hz=BAND_HZ) for seed in range(10)
    ]
    mean = np.mean([[fit.parameters[name].value for name in TRUTH] for fit in equation_error_in_bands], axis=0)
    assert mean == pytest.approx([*TRUTH.values()], rel=0.15)


def test_wrong_bands_and_records_are_refused():
    with pytest.raises(InputError, match=r"resolves 0\.17 Hz only"):
        fit_output_error(SHORT_PERIOD, noisy(0), band_Hz=(0.2, 0.3))
    with pytest.raises(InputError, match="half the sampling rate of 25 Hz"):
        fit_output_error(SHORT_PERIOD, noisy(0), band_Hz=(0.2, 13.0))
    holed = noisy(0)
    holed.z["q"][3] = np.nan
    with pytest.raises(InputError, match="output q has missing samples"):
        fit_output_error(SHORT_PERIOD, holed, band_Hz=BAND_HZ)
