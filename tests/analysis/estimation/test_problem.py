"""Tests the vector of unknowns: its order and names, what its parts belong to, and its priors."""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.analysis.estimation import FitOptions, Model, Parameter, ProcessNoise, Segment, fit_output_error
from flightpower.analysis.estimation.model import PriorMeasurement, UnknownKey, UnknownKind
from flightpower.analysis.estimation.problem import Problem
from flightpower.analysis.estimation.process_noise import noise_unknowns

T_S = np.arange(8) * 0.5
MODEL = Model(
    name="two rates",
    states=("x", "y"),
    outputs=("x", "y"),
    parameters=(
        Parameter(name="k", start=1.0, unit="1/s", prior_mean=1.5, prior_sigma=0.5),
        Parameter(name="c", start=3.0, free=False),
        Parameter(name="b", start=0.2, unit="m", shared=False, prior_sigma=2.0),
    ),
    dynamics=lambda x, u, p: (-p.k * x.x + p.b, -p.c * x.y),
    output_function=lambda x, u, p: (x.x, x.y),
    prior_measurements=(PriorMeasurement(name="sum", coefficients=(("k", 2.0), ("c", 1.0)), value=6.0, sigma=0.5),),
)
SEGMENTS = tuple(
    Segment(name=name, t_s=T_S, u={}, z={"x": np.exp(-T_S) + 0.01 * np.cos(9 * T_S), "y": np.exp(-3 * T_S)})
    for name in ("one", "two")
)


def assembled() -> Problem:
    noise = noise_unknowns(MODEL, SEGMENTS, (ProcessNoise(state="x", start=0.1),))
    return Problem.assemble(MODEL, SEGMENTS, ("x",), {}, noise)


def test_names_say_what_an_unknown_is_and_of_which_segment() -> None:
    assert assembled().names == ("k", "b[one]", "x(0)[one]", "b[two]", "x(0)[two]", "ln w(x)", "ln v(x)", "ln v(y)")
    assert assembled().keys[4] == UnknownKey(UnknownKind.INITIAL_STATE, "x", "two")
    assert [key.is_noise for key in assembled().keys] == [False] * 5 + [True] * 3


def test_a_segment_gets_its_own_values_and_the_shared_ones() -> None:
    """Fixed parameters and given initial states keep their values."""
    theta = np.arange(8.0) + 10
    p, x0, noise = assembled().unpack(theta, 1)
    assert p.tolist() == [10.0, 3.0, 13.0]
    assert x0.tolist() == [14.0, SEGMENTS[1].z["y"][0]]
    assert noise.tolist() == [15.0, 16.0, 17.0]


def test_the_gradient_of_the_priors_is_that_of_their_cost_and_the_matrix_its_slope() -> None:
    problem, theta = assembled(), np.linspace(-1.0, 2.0, 8)
    h = 1e-6 * np.eye(8)
    slope = [(problem.prior_cost(theta + d) - problem.prior_cost(theta - d)) / 2e-6 for d in h]
    assert problem.prior_gradient(theta) == pytest.approx(slope, abs=1e-7)
    curvature = [(problem.prior_gradient(theta + d) - problem.prior_gradient(theta - d)) / 2e-6 for d in h]
    assert problem.prior_matrix == pytest.approx(np.array(curvature), abs=1e-6)


def test_a_prior_measurement_counts_a_fixed_parameter_as_known() -> None:
    """2 k + c = 6 +- 0.5 with c fixed at 3 costs nothing at k = 1.5, which is also the mean of the prior of k."""
    problem = assembled()
    theta = np.where(problem.prior_information > 0, problem.prior_mean, 7.0)
    assert problem.prior_cost(theta) == pytest.approx(0.0)
    theta[0] += 0.5  # one sigma of k's own prior, two sigma of the measurement
    assert problem.prior_cost(theta) == pytest.approx((1 + 4) / 2)


def test_without_an_unknown_the_others_stay_what_they_were() -> None:
    problem = assembled()
    keep = np.array([key != UnknownKey(UnknownKind.PROCESS_NOISE, "x") for key in problem.keys])
    less = problem.without(keep)
    assert less.names == tuple(name for name in problem.names if name != "ln w(x)")
    for array in ("start", "lower", "upper", "prior_mean", "prior_information", "largest_step"):
        assert getattr(less, array).tolist() == getattr(problem, array)[keep].tolist()
    for i, (before, after) in enumerate(zip(problem.columns, less.columns, strict=True)):
        remaining = [problem.keys[c] for c in before if keep[c]]
        assert [less.keys[c] for c in after] == remaining, i


def test_units_of_a_table_are_those_of_the_parameters_also_with_a_value_in_each_segment() -> None:
    model = replace(MODEL, prior_measurements=())
    fit = fit_output_error(model, SEGMENTS, options=FitOptions(initial_states=("x",)))
    units = {row.name: row.unit for row in fit.summary().rows}
    assert units == {"k": "1/s", "b[one]": "m", "x(0)[one]": "", "b[two]": "m", "x(0)[two]": ""}
