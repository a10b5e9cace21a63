"""Tests the curvature of the concentrated likelihood, and the optimizer's number of iterations."""

import numpy as np
import pytest

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.model import Model
from flightpower.analysis.estimation.output_error import OutputErrorLikelihood, fit_output_error
from flightpower.analysis.estimation.problem import Problem, free_names
from flightpower.analysis.estimation.simulation import build_simulator
from tests.analysis.estimation.test_output_error import CLEAN, DE, SHORT_PERIOD, T_S, TRUTH, noisy

# The third output, lift from a wrong speed, contradicts the other two, so R changes along a step.
CONTRADICTORY = Model(
    name="short period with load factor",
    states=SHORT_PERIOD.states,
    inputs=SHORT_PERIOD.inputs,
    outputs=("alpha", "q", "n_z"),
    parameters=SHORT_PERIOD.parameters,
    dynamics=SHORT_PERIOD.dynamics,
    output_function=lambda x, u, p: (x.alpha, x.q, -2 * p.Zal * x.alpha),
)


def contradictory(seed, factor=1.3):
    rng = np.random.default_rng(seed)
    n_z = -2 * factor * TRUTH["Zal"] * CLEAN["alpha"] + 0.01 * rng.standard_normal(len(T_S))
    return Segment(name="run", t_s=T_S, u={"de": DE}, z={**noisy(seed).z, "n_z": n_z})


@pytest.mark.parametrize("noise", ["diagonal", "full"])
def test_the_curvature_is_the_hessian_of_the_cost(noise):
    """It leaves out second derivatives of the response, which are zero here, where outputs are linear in parameters.

    The model is a regression, y = a u1 + b u2, on data that it does not fit, so R changes with a and b.
    """
    model = Model(
        name="regression",
        inputs=("u1", "u2"),
        outputs=("y1", "y2"),
        parameters=SHORT_PERIOD.parameters[:2],
        output_function=lambda x, u, p: (p.Zal * u.u1 + p.Mal * u.u2, p.Zal * u.u2 - p.Mal * u.u1),
    )
    rng = np.random.default_rng(3)
    u1, u2 = rng.standard_normal((2, 40))
    z = {"y1": 2 * u1 + rng.standard_normal(40), "y2": -u2 + 2 * u1 + rng.standard_normal(40)}
    segment = Segment(name="run", t_s=np.arange(40.0), u={"u1": u1, "u2": u2}, z=z)
    problem = Problem.assemble(model, (segment,), "free", {})
    simulator = build_simulator(model, free_names(model), "rk4", "linear")
    likelihood = OutputErrorLikelihood(problem, simulator, noise, None, None)
    theta, h = np.array([1.0, -1.0]), 1e-4
    steps = h * np.eye(2)
    hessian = np.array(
        [
            [
                sum(a * b * likelihood.evaluate(theta + a * i + b * j).cost for a in (1, -1) for b in (1, -1))
                for j in steps
            ]
            for i in steps
        ]
    ) / (4 * h**2)
    point = likelihood.evaluate(theta)
    assert likelihood.curvature(point) == pytest.approx(hessian, rel=1e-4)
    assert not np.allclose(point.information, hessian, rtol=0.1), "the data do not show the difference"


def test_outputs_that_contradict_each_other_converge_quadratically():
    """With the information matrix alone, they would need 16 to 23 iterations: each step is off by the same factor."""
    fits = [fit_output_error(CONTRADICTORY, contradictory(seed, factor=1.6)) for seed in range(6)]
    assert all(fit.verdict.ok for fit in fits)
    assert max(fit.iterations for fit in fits) <= 13


@pytest.mark.parametrize("factor", [1.0, 1.3])
def test_at_the_stop_the_gradient_is_zero(factor):
    """A Newton step from the stop is shorter than 1e-3 standard errors."""
    fit = fit_output_error(CONTRADICTORY, contradictory(2, factor))
    g = sum(piece.white.S.reshape(-1, len(piece.columns)).T @ piece.white.e.ravel() for piece in fit.segment_fits)
    assert np.sqrt(g @ fit.covariance @ g) < 1e-3
