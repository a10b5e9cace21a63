"""Tests where the optimizer stops, on likelihoods with a known optimum and a known rate of convergence."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from flightpower.analysis.estimation.optimizer import (
    LARGEST_DAMPING,
    Evaluation,
    Stop,
    _EigenSystem,
    _improve,
    maximize,
)

CURVATURE = 4.0  # of the cost, for a standard error of 0.5


@dataclass
class Parabola:
    """A cost with its minimum at zero. Its information exceeds the curvature, so each step covers the fraction `share`
    of the distance.

    ln_det_R: growth per standard error of distance     kink: slope of the cost on either side of the start
    """

    share: float = 1.0
    ln_det_R: float = 0.0
    kink: float = 0.0

    @property
    def problem(self):
        return SimpleNamespace(
            prior_matrix=np.zeros((1, 1)),
            lower=np.array([-np.inf]),
            upper=np.array([np.inf]),
            largest_step=np.array([np.inf]),
        )

    def evaluate(self, theta):
        (x,) = theta
        cost = CURVATURE * x**2 / 2 + self.kink * abs(x - self.start)
        information = np.array([[CURVATURE / self.share]])
        ln_det_R = self.ln_det_R * abs(x) * np.sqrt(information[0, 0])
        gradient = -CURVATURE * theta
        return Evaluation(theta, cost, (), np.eye(1), gradient, information, ln_det_R=ln_det_R)

    def stop(self, start, **options):
        """Return where a search from `start` stops, as distance from the optimum in standard errors, and the reason."""
        error = np.sqrt(self.share / CURVATURE)
        self.start = start * error
        point, _, reason = maximize(self, self.evaluate(np.array([self.start])), 100, **options)
        return abs(point.theta[0]) / error, reason


@pytest.mark.parametrize("last", [1.01, 1.3, 1.9])
def test_the_gradient_at_the_stop_is_zero_to_a_ten_thousandth_of_a_standard_error(last):
    """Each step halves the distance, so the last step is as long as the remaining distance. The last two steps are
    `last` times 1e-4 standard errors and half of that; the latter is the first that is short enough."""
    left, reason = Parabola(share=0.5).stop(2**10 * last * 1e-4)
    assert reason is Stop.OPTIMUM
    assert left == pytest.approx(last / 2 * 1e-4)


@pytest.mark.parametrize("last", [1.01, 1.9])
def test_the_change_of_the_residuals_covariance_at_the_stop_is_a_millionth(last):
    """ln det R changes by 1/10 per standard error, so a step that is within the tolerance on steps may change it by
    1e-5, ten times too much."""
    left, reason = Parabola(share=0.5, ln_det_R=0.1).stop(2**12 * last * 1e-5)
    assert reason is Stop.OPTIMUM
    assert 0.1 * left == pytest.approx(last / 2 * 1e-6)


@pytest.mark.parametrize(("gain", "optimum"), [(0.51e-4, True), (0.99e-4, True), (1.01e-4, False), (1.99e-4, False)])
def test_where_no_step_lowers_the_cost_the_predicted_gain_decides(gain, optimum):
    """The cost rises on either side of the start. Twice the predicted decrease is the squared distance in standard
    errors: below 1e-4 rounding hides the decrease, above it the gradient is wrong."""
    left, reason = Parabola(kink=1e3).stop(np.sqrt(gain))
    assert left == pytest.approx(np.sqrt(gain)), "no step must be taken"
    assert reason is (Stop.OPTIMUM if optimum else Stop.NO_BETTER_STEP)


def test_a_caller_may_stop_earlier():
    point = Parabola(share=0.5).stop(1.0, step_tolerance=0.1)
    assert point == (pytest.approx(1 / 16), Stop.OPTIMUM), "stops at the first step below 0.1 standard errors"


@pytest.mark.parametrize(("damping", "then"), [(0.0, 0.0), (1e-4, 0.0), (1e-3, 0.0), (1e-2, 1e-3), (1.0, 0.1)])
def test_a_whole_step_that_succeeds_is_followed_by_less_damping(damping: float, then: float) -> None:
    """It falls to a tenth, and below the least value to none. Against the slope, it grows until none is left to try."""
    parabola = Parabola()
    parabola.start = 3.0
    point = parabola.evaluate(np.array([3.0]))
    moving = np.array([0])
    better, next_damping = _improve(parabola, point, _EigenSystem.of(point.information), moving, damping)
    assert better is not None and better.cost < point.cost
    assert better.theta[0] == pytest.approx(3.0 - 3.0 / (1 + damping))
    assert next_damping == pytest.approx(then)
    uphill = point._replace(gradient=-point.gradient)
    none, most = _improve(parabola, uphill, _EigenSystem.of(point.information), moving, damping)
    assert none is None and most > LARGEST_DAMPING


def test_a_step_that_raises_the_cost_is_halved_before_it_is_damped() -> None:
    """Steps are five times too long: of 1, 1/2 and 1/4 of the step, the first two end higher than they began."""
    parabola = Parabola(share=5.0)
    parabola.start = 3.0
    point, tried = parabola.evaluate(np.array([3.0])), []
    evaluate = parabola.evaluate
    parabola.evaluate = lambda theta: tried.append(theta[0]) or evaluate(theta)  # type: ignore[method-assign]
    better, damping = _improve(parabola, point, _EigenSystem.of(point.information), np.array([0]), 0.0)
    assert tried == pytest.approx([3 - 15.0, 3 - 15.0 / 2, 3 - 15.0 / 4])
    assert better is not None and better.theta[0] == tried[-1] and damping == 0.0


@pytest.mark.parametrize("most", [1, 4])
def test_as_many_steps_are_made_as_allowed(most: int) -> None:
    """Each step goes a third of the way, so none of the first few reaches the optimum."""
    parabola = Parabola(share=1 / 3)
    parabola.start = 9.0
    point, iterations, reason = maximize(parabola, parabola.evaluate(np.array([9.0])), most)
    assert (iterations, len(point.steps)) == (most, most) and reason is Stop.TOO_FEW_ITERATIONS
    assert point.theta[0] == pytest.approx(9.0 * (2 / 3) ** most)


@dataclass
class Quadratic:
    """Two unknowns, a prior on each, and a cost whose curvature is not the information matrix."""

    information: np.ndarray
    hessian: np.ndarray  # of the data's part of the cost
    prior: np.ndarray

    @property
    def problem(self):
        two = np.ones(2)
        return SimpleNamespace(
            prior_matrix=np.diag(self.prior), lower=-np.inf * two, upper=np.inf * two, largest_step=np.inf * two
        )

    def curvature(self, point):
        return self.hessian

    def evaluate(self, theta):
        total = self.hessian + np.diag(self.prior)
        white = SimpleNamespace(present=np.ones((1000, 1)))
        fits = (SimpleNamespace(white=white),)
        return Evaluation(theta, 1.0 + theta @ total @ theta / 2, fits, np.eye(1), -total @ theta, self.information)


@pytest.mark.parametrize("secant", [False, True])
def test_near_the_optimum_a_step_is_newton_s_with_the_prior_s_curvature(secant: bool) -> None:
    """With the exact curvature of data and prior, the step that follows one near the optimum ends at the optimum."""
    hessian = np.array([[4.0, 1.0], [1.0, 3.0]])
    likelihood = Quadratic(1.5 * hessian, hessian, np.array([6.0, 2.0]))
    start = likelihood.evaluate(np.array([0.05, -0.08]))
    point, iterations, reason = maximize(likelihood, start, 20, secant=secant)
    first = np.linalg.solve(likelihood.information + np.diag(likelihood.prior), start.gradient)
    assert point.steps[0] ** 2 == pytest.approx(first @ (likelihood.information + np.diag(likelihood.prior)) @ first)
    assert reason is Stop.OPTIMUM and np.abs(point.theta).max() < 1e-12
    assert iterations <= 4 and len(point.steps) <= 3


def test_secants_find_the_curvature_that_the_likelihood_does_not_give() -> None:
    """The likelihood reports half of its curvature; after two steps, changes of the gradient supply the rest."""
    hessian = np.array([[4.0, 1.0], [1.0, 3.0]])
    prior = np.array([2.0, 1.0])
    steps = {}
    for secant in (False, True):
        likelihood = Quadratic(1.5 * hessian, hessian, prior)
        likelihood.curvature = lambda point: 0.5 * hessian
        point, _, reason = maximize(likelihood, likelihood.evaluate(np.array([0.05, -0.08])), 60, secant=secant)
        assert reason is Stop.OPTIMUM
        steps[secant] = len(point.steps)
    assert steps[True] <= 6 < steps[False]
