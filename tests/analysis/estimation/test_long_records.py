"""In long records, sums over blocks give the same results as the whole record."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from disturbed import LINEAR, linear_record

from flightpower.analysis.estimation import output_error
from flightpower.analysis.estimation import output_error as long_records
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.simulation import build_simulator


@pytest.fixture
def segments():
    item, two = (linear_record(seed, strength=0.0, name=f"run {seed}") for seed in (0, 1))
    z = {name: values.copy() for name, values in item.z.items()}
    z["alpha"][40:50], z["q"][::7] = np.nan, np.nan
    return [Segment(name="gaps", t_s=item.t_s, u=item.u, z=z), two]


def test_a_fit_in_blocks_is_that_of_the_whole_record(segments, monkeypatch):
    at_once = fit_output_error(LINEAR, segments, start={"Mq": -1.0})
    monkeypatch.setattr(output_error.OutputErrorLikelihood, "LARGEST_KEPT", 0)
    monkeypatch.setattr(long_records, "BLOCK", 64)
    in_blocks = fit_output_error(LINEAR, segments, start={"Mq": -1.0})
    assert in_blocks.iterations == at_once.iterations
    assert in_blocks.values == pytest.approx(at_once.values, rel=1e-9)
    assert in_blocks.covariance == pytest.approx(at_once.covariance, rel=1e-9)
    assert in_blocks.segment_fits[0].white.S == pytest.approx(at_once.segment_fits[0].white.S, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(("samples", "long"), [((200_000,), False), ((200_001,), True), ((120_000, 80_000), False),
                                               ((120_000, 80_001), True)])  # fmt: skip
def test_sensitivities_of_more_than_8_megabytes_are_not_kept(samples: tuple[int, ...], long: bool) -> None:
    """The limit is a million numbers: samples times outputs times unknowns of a segment, summed over segments.

    With robust, correlated or known noise and in the frequency domain they are needed, and always kept.
    """
    problem = SimpleNamespace(Z=[np.empty((n, 1)) for n in samples], columns=[np.arange(5)] * len(samples))
    likelihood = output_error.OutputErrorLikelihood(problem, None)
    assert likelihood.is_long is long
    for needs in ({"noise": "full"}, {"known_R": np.eye(1)}, {"tail_dof": 4.0}, {"transforms": []}):
        assert not replace(likelihood, **needs).is_long


def test_blocks_of_a_response_join(segments):
    simulator = build_simulator(LINEAR, ("Mq",))
    p, U = np.array([q.start for q in LINEAR.parameters]), segments[0].u["de"][:, None]
    at_once = simulator.run(np.array([0.05, 0.0]), U, p, 0.04)
    blocks = list(simulator.run_in_blocks(np.array([0.05, 0.0]), U, p, 0.04, 99))
    assert [len(block.y) for block in blocks] == [99, 99, 52]
    for name in ("x", "y"):
        assert (np.concatenate([getattr(block, name) for block in blocks]) == getattr(at_once, name)).all()
    # The recursion of the sensitivities adds in another order.
    S = np.concatenate([block.S for block in blocks])
    np.testing.assert_allclose(S, at_once.S, rtol=0, atol=1e-14 * np.abs(at_once.S).max())


def test_a_response_that_is_not_finite_has_no_likelihood_in_blocks(segments, monkeypatch):
    from flightpower.flight.errors import InputError

    monkeypatch.setattr(output_error.OutputErrorLikelihood, "LARGEST_KEPT", 0)
    with pytest.raises(InputError, match="the response is not finite"):
        fit_output_error(LINEAR, segments, start={"Mq": 1e5})
