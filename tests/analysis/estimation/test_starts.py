"""Tests output error from several starting values."""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.fit import Finding, FitStatus
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.starts import best_of_starts, starting_values_by_equation_error
from flightpower.flight.errors import InputError
from tests.analysis.estimation.test_output_error import SHORT_PERIOD, TRUTH, noisy

# The frequency of a sine is estimated. The likelihood has an optimum every 1/T, and only one is right.
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
    single = fit_output_error(OSCILLATION, SINE)
    assert single.verdict.ok and abs(single.parameters["omega"].value - 4.4) > 0.5, "this start must miss the truth"
    best = best_of_starts(lambda start: fit_output_error(OSCILLATION, SINE, start=start), OSCILLATION, starts=20)
    assert best.parameters["omega"].value == pytest.approx(4.4, abs=0.01)
    assert {Finding.REACHED_FROM_STARTS, Finding.WORSE_OPTIMA} <= set(best.verdict.findings)


def test_one_optimum_is_reached_from_everywhere():
    segment = noisy(0)
    regression = starting_values_by_equation_error(SHORT_PERIOD, segment, smoothing_s=0.1)
    fit = best_of_starts(
        lambda start: fit_output_error(SHORT_PERIOD, segment, start=start), SHORT_PERIOD, starts=5,
        more_starts=[regression],
    )  # fmt: skip
    assert "reached from 6 of 6 starts" in fit.verdict.text
    assert Finding.WORSE_OPTIMA not in fit.verdict.findings


def test_equation_error_gives_starting_values_near_the_truth():
    """Noise in the regressors biases them by some 10 %; up to 40 % are allowed."""
    error = starting_values_by_equation_error(SHORT_PERIOD, noisy(0), smoothing_s=0.1)
    assert error == pytest.approx(TRUTH, rel=0.4)


def test_when_no_start_gives_a_response_the_reason_is_reported():
    far = SHORT_PERIOD.changed(Zal={"start": 1e5}, Mq={"start": 1e5})
    with pytest.raises(InputError, match="not finite"):
        best_of_starts(lambda start: fit_output_error(far, noisy(0), start=start), far, starts=2)


def test_starts_without_a_fit_are_counted():
    """The third of four starts does not converge, so its end is no optimum and is not compared."""
    fit, ends = fit_output_error(SHORT_PERIOD, noisy(0)), iter(["good", "good", "lost", "good"])
    lost = fit.verdict._replace(status=FitStatus.NOT_CONVERGED)
    results = {"good": fit, "lost": replace(fit, verdict=lost, negative_log_likelihood=-1e9)}
    best = best_of_starts(lambda start: results[next(ends)], SHORT_PERIOD, starts=4)
    assert best.verdict.text.endswith("reached from 3 of 4 starts; 1 did not converge")
