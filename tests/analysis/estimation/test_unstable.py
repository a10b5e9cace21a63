"""Output error fails on an unstable aircraft, as the verdict says, and works on separate parts of the record."""

import numpy as np
import pytest
import twins

from flightpower.analysis.estimation.data import split
from flightpower.analysis.estimation.fit import Finding
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.problem import FitOptions


@pytest.fixture(scope="module")
def segment():
    return twins.unstable(2)


def test_output_error_of_the_whole_record_says_what_is_wrong(segment):
    start = {name: value * 1.2 for name, value in twins.UNSTABLE_TRUTH.items()}
    verdict = fit_output_error(twins.UNSTABLE, segment, options=FitOptions(inputs="held"), start=start).verdict
    assert not verdict.ok
    assert {Finding.NOT_WHITE, Finding.UNSTABLE} <= set(verdict.findings)
    assert "split it (data.split)" in str(verdict)


def test_separate_parts_converge_from_starts_off_by_a_factor_of_two(segment):
    rng = np.random.default_rng(2)
    start = {name: value * rng.uniform(0.5, 2.0) for name, value in twins.UNSTABLE_TRUTH.items()}
    fit = fit_output_error(twins.UNSTABLE, split(segment, 10), options=FitOptions(inputs="held"), start=start)
    assert fit.verdict.ok
    for name, value in twins.UNSTABLE_TRUTH.items():
        estimate = fit.parameters[name]
        assert abs(estimate.value - value) < 4 * estimate.standard_error
