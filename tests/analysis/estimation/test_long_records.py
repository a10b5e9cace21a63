"""Long records: sums over blocks give what the whole record gives."""

import numpy as np
import pytest
from disturbed import LINEAR, linear_record

from analysis.estimation import long_records, output_error
from analysis.estimation.data import Segment
from analysis.estimation.simulation import build_simulator


@pytest.fixture
def segments():
    one, two = (linear_record(seed, strength=0.0, name=f"run {seed}") for seed in (0, 1))
    z = {name: values.copy() for name, values in one.z.items()}
    z["alpha"][40:50], z["q"][::7] = np.nan, np.nan
    return [Segment(name="gaps", t_s=one.t_s, u=one.u, z=z), two]


def test_a_fit_in_blocks_is_that_of_the_whole_record(segments, monkeypatch):
    whole = output_error.estimate(LINEAR, segments, start={"Mq": -1.0})
    monkeypatch.setattr(output_error, "LONG", 0)
    monkeypatch.setattr(long_records, "BLOCK", 64)
    in_blocks = output_error.estimate(LINEAR, segments, start={"Mq": -1.0})
    assert in_blocks.iterations == whole.iterations
    assert in_blocks.values == pytest.approx(whole.values, rel=1e-9)
    assert in_blocks.covariance == pytest.approx(whole.covariance, rel=1e-9)
    assert in_blocks.segment_fits[0].white.S == pytest.approx(whole.segment_fits[0].white.S, rel=1e-6, abs=1e-6)


def test_blocks_of_a_response_join(segments):
    simulator = build_simulator(LINEAR, ("Mq",))
    p, U = np.array([q.start for q in LINEAR.parameters]), segments[0].u["de"][:, None]
    whole = simulator.run(np.array([0.05, 0.0]), U, p, 0.04)
    blocks = list(simulator.run_in_blocks(np.array([0.05, 0.0]), U, p, 0.04, 99))
    assert [len(block.y) for block in blocks] == [99, 99, 52]
    for name in ("x", "y"):
        assert (np.concatenate([getattr(block, name) for block in blocks]) == getattr(whole, name)).all()
    # The recursion of the sensitivities sums in another order.
    S = np.concatenate([block.S for block in blocks])
    np.testing.assert_allclose(S, whole.S, rtol=0, atol=1e-14 * np.abs(whole.S).max())


def test_a_response_that_is_not_finite_has_no_likelihood_in_blocks(segments, monkeypatch):
    from flight.errors import InputError

    monkeypatch.setattr(output_error, "LONG", 0)
    with pytest.raises(InputError, match="the response is not finite"):
        output_error.estimate(LINEAR, segments, start={"Mq": 1e5})
