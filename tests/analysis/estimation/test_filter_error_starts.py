"""Tests filter error from starting values far from the truth, and with negligible noise."""

from dataclasses import replace

import numpy as np
import pytest
import twins

from flightpower.analysis.estimation import equation_error
from flightpower.analysis.estimation.filter_error import fit_filter_error
from flightpower.analysis.estimation.fit import Finding, FitStatus
from flightpower.analysis.estimation.problem import FitOptions
from flightpower.analysis.estimation.process_noise import intensity_key, noise_from_predictions, noise_key
from flightpower.flight.errors import InputError


def fitted(model, segment, noise, **options):
    return fit_filter_error(model, segment, noise, test_significance=False, **options)


def in_standard_errors(fit, truth):
    """Return the largest deviation from the truth, in standard errors."""
    return max(
        abs(fit.parameters[name].value - value) / fit.parameters[name].standard_error for name, value in truth.items()
    )


@pytest.mark.parametrize("seed", [3, 30])
def test_in_turbulence_it_converges_from_equation_error_in_15_iterations(seed):
    fit = fitted(twins.TURBULENCE, twins.in_turbulence(seed), twins.TURBULENCE_NOISE, start="equation error")
    assert fit.verdict.ok and fit.iterations <= 15
    assert in_standard_errors(fit, twins.TURBULENCE_TRUTH) < 4
    for state, intensity in twins.TURBULENCE_INTENSITY.items():
        assert fit.process_noise[state].value == pytest.approx(intensity, rel=0.3)


@pytest.mark.parametrize("seed", [58, 183, 415, 838])
def test_an_unstable_aircraft_converges_from_equation_error_in_15_iterations(seed):
    """Neither state has process noise. The fit tries each intensity at its lower bound, and then with the other
    intensity at zero."""
    fit = fitted(
        twins.UNSTABLE,
        twins.unstable(seed),
        twins.UNSTABLE_NOISE,
        options=FitOptions(inputs="held"),
        start="equation error",
    )
    assert fit.verdict.ok and fit.iterations <= 15
    assert in_standard_errors(fit, twins.UNSTABLE_TRUTH) < 4
    assert fit.process_noise["alpha"].value < 1e-5 and fit.process_noise["q"].value < 1e-5


@pytest.mark.parametrize("seed", [5, 224])
def test_an_unstable_aircraft_keeps_the_least_noise_of_the_state_with_the_highest_likelihood(seed):
    """Without any process noise, the filter would not correct the states. It matters which state has the noise: the
    cost differs by 0.8."""
    fit = fitted(
        twins.UNSTABLE,
        twins.unstable(seed),
        twins.UNSTABLE_NOISE,
        options=FitOptions(inputs="held"),
        start="equation error",
    )
    assert Finding.NEGLIGIBLE_BUT_STABILIZING in fit.verdict.findings and "process noise of q" in fit.verdict.text
    start = dict(zip(fit.names, fit.values.tolist(), strict=True))
    alpha, q = (replace(noise, start=noise.start / 1000, free=False) for noise in twins.UNSTABLE_NOISE)
    zero_alpha, zero_q = replace(alpha, start=0.0), replace(q, start=0.0)
    of_q, of_alpha = (
        fitted(
            twins.UNSTABLE, twins.unstable(seed), noise, options=FitOptions(inputs="held"), start=start
        ).negative_log_likelihood
        for noise in ((zero_alpha, q), (alpha, zero_q))
    )
    assert fit.negative_log_likelihood == pytest.approx(of_q, abs=1e-3)
    assert of_q < of_alpha - 0.5


def test_noise_starts_near_the_truth():
    """Starts are from predictions with the true parameters; noise of the rates is small compared with turbulence."""
    segment = twins.in_turbulence(4)
    predictions = noise_from_predictions(
        twins.TURBULENCE, [segment], twins.TURBULENCE_NOISE, twins.TURBULENCE_TRUTH, "linear"
    )
    for state, intensity in twins.TURBULENCE_INTENSITY.items():
        assert np.exp(predictions[intensity_key(state)]) == pytest.approx(intensity, rel=0.25)
    for output, sigma in twins.TURBULENCE_SIGMA.items():
        assert 0.5 < np.exp(predictions[noise_key(output)]) / sigma < 2


def test_innovations_that_are_not_white_are_named():
    """Turbulence drives both rates, but the filter assumes it in only one."""
    segment, noise = twins.in_turbulence(0), twins.TURBULENCE_NOISE
    incomplete = fitted(twins.TURBULENCE, segment, noise[1], start="equation error")
    assert Finding.NOT_WHITE in incomplete.verdict.findings
    assert not fitted(twins.TURBULENCE, segment, noise, start="equation error").verdict.hints


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_an_unstable_aircraft_in_light_noise_is_found_from_starts_off_by_a_factor_of_two(seed):
    """There is no process noise: it is dropped, except for the little that keeps the filter stable."""
    rng = np.random.default_rng(seed)
    start = {name: value * rng.uniform(0.5, 2.0) for name, value in twins.UNSTABLE_TRUTH.items()}
    fit = fitted(
        twins.UNSTABLE, twins.unstable(seed), twins.UNSTABLE_NOISE, options=FitOptions(inputs="held"), start=start
    )
    assert fit.verdict.ok
    assert in_standard_errors(fit, twins.UNSTABLE_TRUTH) < 4
    assert Finding.NEGLIGIBLE_BUT_STABILIZING in fit.verdict.findings
    assert "ln " not in fit.verdict.text


def test_negligible_measurement_noise_is_named_and_does_not_stop_the_fit():
    """The derivative of the rate is measured without noise, so the logarithm of its noise would go to -infinity."""
    segment = twins.in_turbulence(2, twins.TURBULENCE_SIGMA | {"pdot": 1e-9})
    fit = fitted(twins.TURBULENCE, segment, twins.TURBULENCE_NOISE, start="equation error")
    assert fit.verdict.ok
    assert Finding.NEGLIGIBLE_MEASUREMENT_NOISE in fit.verdict.findings and "noise of pdot" in fit.verdict.text
    assert noise_key("pdot") not in fit.keys
    assert in_standard_errors(fit, twins.TURBULENCE_TRUTH) < 4


def test_equation_error_of_a_model_that_measures_derivatives():
    regression = equation_error.regression_of(twins.TURBULENCE)
    assert regression.outputs == ("dp/dt", "dr/dt", "pdot", "rdot", "ay")


def test_an_unknown_method_for_the_start_is_refused():
    with pytest.raises(InputError, match="start = 'newton': choose one of equation error, output error"):
        fitted(twins.TURBULENCE, twins.in_turbulence(0), twins.TURBULENCE_NOISE, start="newton")


def test_a_fit_that_may_not_iterate_enough_is_not_converged():
    fit = fitted(
        twins.UNSTABLE, twins.unstable(0), twins.UNSTABLE_NOISE, options=FitOptions(inputs="held", max_iterations=2)
    )
    assert fit.verdict.status is FitStatus.NOT_CONVERGED
