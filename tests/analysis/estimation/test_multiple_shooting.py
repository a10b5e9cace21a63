"""Output error of an unstable aircraft: what the verdict says, and multiple shooting with tied knots."""

import numpy as np
import pytest
import twins

from analysis.estimation import multiple_shooting, output_error
from analysis.estimation.data import split
from flight.errors import InputError

PARTS = 10


@pytest.fixture(scope="module")
def segment():
    return twins.unstable(2)


@pytest.fixture(scope="module")
def start():
    rng = np.random.default_rng(2)
    return {name: value * rng.uniform(0.5, 2.0) for name, value in twins.UNSTABLE_TRUTH.items()}


@pytest.fixture(scope="module")
def tied(segment, start):
    return multiple_shooting.estimate(twins.UNSTABLE, segment, parts=PARTS, inputs="held", start=start)


def test_output_error_of_the_whole_record_says_what_is_wrong(segment):
    start = {name: value * 1.2 for name, value in twins.UNSTABLE_TRUTH.items()}
    verdict = output_error.estimate(twins.UNSTABLE, segment, inputs="held", start=start).verdict
    assert not verdict.ok
    assert "are not white" in str(verdict)
    assert "unstable: with an eigenvalue of +" in str(verdict) and "split it (data.split)" in str(verdict)


def test_it_converges_from_starts_off_by_a_factor_of_two(tied):
    assert tied.verdict.ok and str(tied.verdict).startswith("converged") and not tied.verdict.hints
    for name, value in twins.UNSTABLE_TRUTH.items():
        estimate = tied.parameters[name]
        assert abs(estimate.value - value) < 4 * estimate.standard_error


def test_the_ends_of_the_parts_meet(segment, tied):
    """The next state, by an integration of one step from the last sample of a part, is that of the next part."""
    truth = [tied.parameters[name].value for name in twins.UNSTABLE_TRUTH]
    for i in range(1, PARTS):
        end = tied.responses[f"run/{i}"].x[-1]
        de = tied.segment_fits[i - 1].segment.u["de"][-1:]
        for _ in range(100):
            end = end + twins.STEP_S / 100 * np.array(twins.UNSTABLE.evaluate_dynamics(end, de, truth))
        begin = tied.responses[f"run/{i + 1}"].x[0]
        assert np.abs(end - begin).max() < 0.1 * twins.UNSTABLE_SIGMA["alpha"]


def test_ties_give_smaller_standard_errors_than_separate_parts(segment, start, tied):
    separate = output_error.estimate(twins.UNSTABLE, split(segment, PARTS), inputs="held", start=start)
    ratio = [tied.parameters[n].standard_error / separate.parameters[n].standard_error for n in twins.UNSTABLE_TRUTH]
    assert max(ratio) < 1 and min(ratio) < 0.85


def test_one_part_is_refused(segment):
    with pytest.raises(InputError, match="parts = 1: multiple shooting needs at least two"):
        multiple_shooting.estimate(twins.UNSTABLE, segment, parts=1)
