"""Output error from several starting values."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.estimation import output_error, starts
from analysis.estimation.data import Segment
from analysis.estimation.fit import FitStatus
from analysis.estimation.model import Model, Parameter
from flight.errors import InputError
from tests.analysis.estimation.test_output_error import SHORT_PERIOD, TRUTH, noisy

# A frequency to be found in a sine: the likelihood has an optimum every 1/T, of which one is right.
OSCILLATION = Model(
    name="oscillation",
    inputs=("t",),
    outputs=("y",),
    parameters=(Parameter(name="omega", start=3.0, lower=0.1), Parameter(name="size", start=1.0)),
    output_function=lambda x, u, p: (p.size * np.sin(p.omega * u.t),),
)
T = np.arange(0, 10, 0.05)
SINE = Segment(
    name="sine",
    t_s=T,
    u={"t": T},
    z={"y": np.sin(4.4 * T) + 0.05 * np.random.default_rng(0).standard_normal(T.size)},
)


def test_a_false_optimum_is_left_and_the_verdict_says_so():
    single = output_error.estimate(OSCILLATION, SINE)
    assert single.verdict.ok and abs(single.parameters["omega"].value - 4.4) > 0.5, "this start finds the truth"
    best = starts.estimate(OSCILLATION, SINE, starts=20)
    assert best.parameters["omega"].value == pytest.approx(4.4, abs=0.01)
    assert "of 20 starts" in best.verdict.text and "ended at worse optima" in best.verdict.text


def test_one_optimum_is_reached_from_everywhere():
    fit = starts.estimate(SHORT_PERIOD, noisy(0), starts=5, smoothing_s=0.1)
    assert "reached from 6 of 6 starts" in fit.verdict.text
    assert "worse" not in fit.verdict.text


def test_equation_error_gives_starting_values_near_the_truth():
    """Noise in the regressors biases them by some 10 %, no more."""
    found = starts.from_equation_error(SHORT_PERIOD, noisy(0), smoothing_s=0.1)
    assert found == pytest.approx(TRUTH, rel=0.4)


def test_when_no_start_gives_a_response_the_reason_is_told():
    far = SHORT_PERIOD.changed(Zal={"start": 1e5}, Mq={"start": 1e5})
    with pytest.raises(InputError, match="not finite"):
        starts.estimate(far, noisy(0), starts=2)


def test_starts_without_a_fit_are_counted(monkeypatch):
    """Of four starts the third gives a fit that did not converge: it is no optimum, and is not compared."""
    fit, ends = output_error.estimate(SHORT_PERIOD, noisy(0)), iter(["good", "good", "lost", "good"])
    lost = fit.verdict._replace(status=FitStatus.NOT_CONVERGED)
    found = {"good": fit, "lost": replace(fit, verdict=lost, negative_log_likelihood=-1e9)}
    monkeypatch.setattr(output_error, "estimate", lambda *_, **__: found[next(ends)])
    best = starts.estimate(SHORT_PERIOD, noisy(0), starts=4)
    assert best.verdict.text.endswith("reached from 3 of 4 starts, 1 did not converge")
