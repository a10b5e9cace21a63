"""The verdict names the problem of each fit that must not be used."""

import pytest
from disturbed import LINEAR
from hard_cases import CASES, _record

from flightpower.analysis.estimation.output_error import MeasurementNoise, fit_output_error


@pytest.mark.parametrize("name", CASES)
def test_the_verdict_names_the_case(name):
    assert CASES[name].finding in CASES[name].fit(0).verdict.findings


def test_a_good_fit_has_no_hints():
    verdict = fit_output_error(LINEAR, _record(0)).verdict
    assert verdict.ok and not verdict.hints and str(verdict) == verdict.text


def test_outliers_are_no_matter_with_t_noise():
    segment = CASES["outliers"].fit(0).segment_fits[0].segment
    assert not fit_output_error(LINEAR, segment, noise=MeasurementNoise(tail_dof=4.0)).verdict.hints
