"""Tests process noise in filter error: priors, starting values, standard errors and significance."""

from dataclasses import replace

import numpy as np
import pytest
from disturbed import INTENSITY, LINEAR, LINEAR_NOISE, T_S, linear_record

from flightpower.analysis.estimation import uncertainty
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.filter_error import ProcessNoise, fit_filter_error
from flightpower.analysis.estimation.fit import Finding
from flightpower.analysis.estimation.process_noise import intensity_key, noise_key, noise_unknowns

NONE = ProcessNoise(state="alpha", start=0.0, free=False)


def test_a_prior_pulls_the_estimate():
    """A prior as good as the data, one standard error away, moves it by half of that; its error falls to 1/sqrt(2)."""
    segment = linear_record(6)
    Mq = fit_filter_error(LINEAR, segment, LINEAR_NOISE, test_significance=False).parameters["Mq"]
    model = LINEAR.changed(Mq={"prior_mean": Mq.value + Mq.standard_error, "prior_sigma": Mq.standard_error})
    pulled = fit_filter_error(model, segment, LINEAR_NOISE, test_significance=False).parameters["Mq"]
    assert pulled.value == pytest.approx(Mq.value + Mq.standard_error / 2, abs=0.1 * Mq.standard_error)
    assert pulled.standard_error == pytest.approx(Mq.standard_error / np.sqrt(2), rel=0.05)


def test_the_interval_of_an_intensity_is_that_of_its_logarithm():
    fit = fit_filter_error(LINEAR, linear_record(3), LINEAR_NOISE, test_significance=False)
    alpha, ln_w = fit.process_noise["alpha"], fit.parameters[str(intensity_key("alpha"))]
    factor = np.exp(1.96 * ln_w.standard_error)
    assert (alpha.lo, alpha.hi) == pytest.approx((alpha.value / factor, alpha.value * factor), rel=1e-4)
    assert alpha.lo < INTENSITY < alpha.hi


def test_the_search_for_measurement_noise_starts_at_the_noise_of_the_record():
    """2000 samples of a slow motion with white noise give it to 5 %."""
    t_s, noise = np.arange(2000) * 0.02, np.random.default_rng(0).standard_normal((2, 2000))
    z = {"alpha": 0.1 * np.sin(0.5 * t_s) + 0.003 * noise[0], "q": 0.05 * np.cos(0.5 * t_s) + 0.005 * noise[1]}
    segment = Segment(name="slow", t_s=t_s, u={"de": 0 * t_s}, z=z)
    unknowns = noise_unknowns(LINEAR, (segment,), (LINEAR_NOISE,))
    start = {unknown.key: np.exp(unknown.start) for unknown in unknowns}
    assert (start[noise_key("alpha")], start[noise_key("q")]) == pytest.approx((0.003, 0.005), rel=0.05)


def test_a_known_offset_of_the_sensors_changes_nothing():
    """Outputs that are not zero at zero state, with measurements shifted by as much, give the same estimates."""
    segment = linear_record(3)
    offset = replace(LINEAR, output_function=lambda x, u, p: (x.alpha + 0.1, x.q - 0.2))
    shifted = replace(segment, z={"alpha": segment.z["alpha"] + 0.1, "q": segment.z["q"] - 0.2})
    fits = [
        fit_filter_error(model, data, LINEAR_NOISE, test_significance=False)
        for model, data in ((LINEAR, segment), (offset, shifted))
    ]
    assert fits[1].verdict.ok
    assert np.all(np.abs(fits[1].values - fits[0].values) < 0.01 * np.sqrt(np.diag(fits[0].covariance)))


@pytest.mark.parametrize("factor", [1 / 300, 3])
def test_a_starting_intensity_may_be_far_too_small_and_a_little_too_large(factor):
    near, far = (
        fit_filter_error(LINEAR, linear_record(3), ProcessNoise(state="alpha", start=start), test_significance=False)
        for start in (INTENSITY, INTENSITY * factor)
    )
    assert far.verdict.ok
    assert far.process_noise["alpha"].value == pytest.approx(near.process_noise["alpha"].value, rel=0.01)


def test_a_starting_intensity_that_is_far_too_large_still_leads_to_the_optimum():
    """From there, process noise explains everything, so the fit is repeated from equation error with less noise."""
    near = fit_filter_error(LINEAR, linear_record(3), LINEAR_NOISE, test_significance=False)
    noise = ProcessNoise(state="alpha", start=300 * INTENSITY)
    far = fit_filter_error(LINEAR, linear_record(3), noise, test_significance=False)
    assert far.verdict.ok and Finding.NEGLIGIBLE_MEASUREMENT_NOISE not in far.verdict.findings
    assert far.negative_log_likelihood == pytest.approx(near.negative_log_likelihood, abs=1e-3)


def test_morelli_klein_of_an_intensity_is_its_cramer_rao_bound():
    """If innovations are white, the correction changes nothing, neither for parameters nor for noise levels."""
    ratio = []
    for seed in range(10):
        fit = fit_filter_error(LINEAR, linear_record(seed), LINEAR_NOISE, test_significance=False)
        corrected = np.diag(uncertainty.morelli_klein(fit).covariance)
        ratio.append(corrected / np.diag(uncertainty.cramer_rao(fit).covariance))
    assert np.mean(ratio, axis=0) == pytest.approx(np.ones(len(fit.names)), abs=0.25)


def test_the_standard_error_of_a_noise_level():
    """ln sigma of n white samples has the information 2 n."""
    fit = fit_filter_error(LINEAR, linear_record(0, strength=0.0), NONE)
    for output in LINEAR.outputs:
        assert fit.parameters[str(noise_key(output))].standard_error == pytest.approx(
            1 / np.sqrt(2 * len(T_S)), rel=0.02
        )


def test_the_p_value_is_that_of_a_one_sided_likelihood_ratio():
    """It is half of that of a chi-squared of one degree of freedom, because an intensity cannot be negative."""
    from scipy.stats import chi2

    segment = linear_record(1, strength=0.1)
    fit = fit_filter_error(LINEAR, segment, LINEAR_NOISE)
    without = fit_filter_error(LINEAR, segment, NONE)
    ratio = 2 * (without.negative_log_likelihood - fit.negative_log_likelihood)
    assert fit.process_noise["alpha"].p_value == pytest.approx(chi2.sf(ratio, 1) / 2, rel=1e-2)
