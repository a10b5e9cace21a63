"""Maximization of a likelihood: Gauss-Newton with Levenberg-Marquardt damping, step halving, and bounds.

Convergence is judged by the length of the step in standard errors and by the change of ln det R. The cost itself says
nothing about the quality of the fit when R is re-estimated from the residuals: its quadratic part (3.32) is then
constant.
"""

from collections.abc import Callable
from enum import Enum, auto
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.estimation.fit import Finding, Fit, FitStatus, ParameterEstimate, Remark, SegmentFit, Verdict
from flightpower.analysis.estimation.hints import collinearities
from flightpower.analysis.estimation.problem import Problem
from flightpower.analysis.estimation.settings import SEARCH, VERDICT
from flightpower.flight.arrays import Array


class Stop(Enum):
    """Why a maximization ended."""

    OPTIMUM = auto()  # or `stop` returned true
    NO_BETTER_STEP = auto()
    TOO_FEW_ITERATIONS = auto()

    @property
    def failed(self) -> bool:
        return self is not Stop.OPTIMUM


class Evaluation(NamedTuple):
    """The likelihood and its derivatives at one theta (m,)."""

    theta: Array
    cost: float  # negative log-likelihood, priors included; inf if the response is not finite
    segment_fits: tuple[SegmentFit, ...]
    R: Array
    gradient: Array  # (m,) of the log-likelihood (steepest descent of the cost), priors included
    information: Array  # (m, m) of the data
    variance_information: Array | float = 0.0  # part of `information` from the variances of the residuals
    ln_det_R: float = 0.0  # 0 if R is not re-estimated at every point
    costs: tuple[float, ...] = ()  # at the earlier points of the maximization
    steps: tuple[float, ...] = ()  # from each of these points to the next, in standard errors
    products: Array | None = None  # (outputs, m) sums of white residuals times sensitivities, if these are not kept
    observed: Array | None = None  # (m, m) curvature of the cost, if it comes free with the information


def nowhere(theta: Array) -> Evaluation:
    """The evaluation of a theta at which the response is not finite."""
    m = len(theta)
    return Evaluation(theta, np.inf, (), np.zeros((0, 0)), np.zeros(m), np.zeros((m, m)))


class Likelihood(Protocol):
    @property
    def problem(self) -> Problem: ...

    def evaluate(self, theta: Array) -> Evaluation: ...

    def curvature(self, point: Evaluation) -> Array:
        """(m, m) Hessian of the data's part of the cost; `point.information` where nothing better is known."""
        ...


class _EigenSystem(NamedTuple):
    """Eigenvalues and eigenvectors of the information matrix scaled to a unit diagonal: H = s V diag(values) V' s."""

    values: Array
    vectors: Array
    scale: Array

    @classmethod
    def of(cls, H: Array) -> "_EigenSystem":
        scale = _scale(H)
        return cls(*np.linalg.eigh(H / np.outer(scale, scale)), scale)

    @property
    def identifiable(self) -> NDArray[np.bool_]:
        return self.values > 1e-11  # smaller ones are rounding errors

    def step(self, g: Array, damping: float) -> Array:
        """Levenberg-Marquardt step; zero along directions that are not identifiable."""
        V = self.vectors[:, self.identifiable]
        return V @ ((V.T @ (g / self.scale)) / (self.values[self.identifiable] + damping)) / self.scale


def _scale(H: Array) -> Array:
    scale = np.sqrt(np.diag(H))
    scale[scale == 0] = 1.0
    return np.asarray(scale)


def maximize(
    likelihood: Likelihood,
    point: Evaluation,
    max_iterations: int,
    *,
    step_tolerance: float = SEARCH.step_tolerance,
    stop: Callable[[Evaluation], bool] | None = None,
    secant: bool = False,
) -> tuple[Evaluation, int, Stop]:
    """Maximize the likelihood from `point`, to the optimum or the first point at which `stop` is true.

    secant : correct the curvature by the changes of the gradient over the steps near the optimum
    Returns the last point, the number of iterations, and why there were no more.
    """
    problem = likelihood.problem
    damping, length = 0.0, np.inf
    correction = np.zeros_like(point.information)
    values = sum(fit.white.present.sum() for fit in point.segment_fits)
    for iteration in range(1, max_iterations + 1):
        H = point.information + problem.prior_matrix
        # An unknown at a bound stays there in this step if the gradient points out of the bounds.
        at_bound = ((point.theta <= problem.lower) & (point.gradient < 0)) | (
            (point.theta >= problem.upper) & (point.gradient > 0)
        )
        moving = np.flatnonzero(~at_bound)
        if not len(moving):
            return point, iteration, Stop.OPTIMUM
        eigen = _step_matrix(likelihood, point, correction, moving, length < SEARCH.near * np.sqrt(values))
        gain = point.gradient[moving] @ eigen.step(point.gradient[moving], 0.0)
        if gain < 1e-13 * abs(point.cost):  # below the rounding errors of the cost
            return point, iteration, Stop.OPTIMUM
        new, damping = _improve(likelihood, point, eigen, moving, damping)
        if new is None or new.cost == point.cost:  # rounding errors dominate, or the gradient is wrong
            if gain < SEARCH.step_tolerance:
                return point, iteration, Stop.OPTIMUM
            return point, iteration, Stop.NO_BETTER_STEP
        step = new.theta - point.theta
        length = np.sqrt(max(float(step @ H @ step), 0.0))
        change = abs(new.ln_det_R - point.ln_det_R)
        if secant:
            prior = problem.prior_matrix
            curvature, H = likelihood.curvature(new) + prior, new.information + prior
            if length < SEARCH.secant_length:
                correction = _secant(correction, step, point.gradient - new.gradient, curvature, H)
            else:
                correction = np.zeros_like(H)
        point = new._replace(costs=(*point.costs, float(point.cost)), steps=(*point.steps, float(length)))
        if stop is not None and stop(point):
            return point, iteration, Stop.OPTIMUM
        if damping == 0 and length < step_tolerance and change < SEARCH.lndet_tolerance:
            return point, iteration, Stop.OPTIMUM
    return point, max_iterations, Stop.TOO_FEW_ITERATIONS


def _secant(correction: Array, step: Array, change: Array, curvature: Array, information: Array) -> Array:
    """The symmetric rank-one update after which (curvature + correction) step = change of the gradient.

    If the sum has too small an eigenvalue, earlier steps are forgotten. Reference: Nocedal & Wright, Numerical
    Optimization, 2nd ed., sec. 6.2.
    """
    zero = np.zeros_like(correction)
    scale = np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
    for before in (correction, zero):
        missing = change - (curvature + before) @ step
        product = missing @ step  # below 1e-8 of the norms only rounding errors are left
        if abs(product) <= 1e-8 * np.linalg.norm(missing / scale) * np.linalg.norm(step * scale):
            return before
        updated: Array = before + np.outer(missing, missing) / product
        if _convex(curvature + updated, information) is not None:
            return updated
    return zero


def _convex(curvature: Array, information: Array) -> _EigenSystem | None:
    """The eigensystem of the curvature, if its smallest eigenvalue is not much below the information's."""
    if (np.diag(curvature) > 0).all():
        of_curvature, scale = _EigenSystem.of(curvature), _scale(information)
        smallest = np.linalg.eigvalsh(information / np.outer(scale, scale))[0]  # a third of the time of `eigh`
        if of_curvature.values[0] > SEARCH.smallest_curvature * smallest > 0:
            return of_curvature
    return None


def _step_matrix(
    likelihood: Likelihood, point: Evaluation, correction: Array, moving: NDArray[np.intp], near: bool
) -> _EigenSystem:
    """The matrix of the Newton step of the unknowns `moving`: the curvature of the cost, or the information matrix."""
    block = np.ix_(moving, moving)
    prior = likelihood.problem.prior_matrix
    information = (point.information + prior)[block]
    convex = _convex((likelihood.curvature(point) + correction + prior)[block], information) if near else None
    return convex or _EigenSystem.of(information)


LARGEST_DAMPING = 1e8  # relative to the information: steps are then rounding errors


def _improve(
    likelihood: Likelihood, point: Evaluation, eigen: _EigenSystem, moving: NDArray[np.intp], damping: float
) -> tuple[Evaluation | None, float]:
    """A point whose cost is not larger, and the damping for the next step. None if no step improves it."""
    problem = likelihood.problem
    largest = problem.largest_step[moving]
    first = 1e-3  # relative to the information: hardly shortens a step
    while damping <= LARGEST_DAMPING:
        step = eigen.step(point.gradient[moving], damping)
        for halving in range(4):
            theta = point.theta.copy()
            theta[moving] += _limited(step, largest) / 2**halving
            new = likelihood.evaluate(np.clip(theta, problem.lower, problem.upper))
            if new.cost <= point.cost:
                if halving == 0:
                    damping = damping / 10 if damping > first else 0.0
                return new, damping
        damping = max(10 * damping, first)
    return None, damping


def _limited(step: Array, largest: Array) -> Array:
    """The step, with changes of ln sigma (those with a largest step) corrected for the shape of the likelihood.

    For a standard deviation alone, Gauss-Newton's step of ln sigma is (r - 1)/2, where r is the mean square of the
    residuals relative to sigma^2. The optimum is (ln r)/2 away.
    """
    logarithmic = np.isfinite(largest)
    if not logarithmic.any():
        return step
    limit = largest[logarithmic]
    ratio = np.maximum(1 + 2 * step[logarithmic], np.exp(-2 * limit))
    limited = step.copy()
    limited[logarithmic] = np.minimum(np.log(ratio) / 2, limit)
    return limited


def make_fit(likelihood: Likelihood, point: Evaluation, iterations: int, stop: Stop) -> Fit:
    """The fit at `point`, the result of `maximize`."""
    problem = likelihood.problem
    eigen = _EigenSystem.of(point.information + problem.prior_matrix)
    V = eigen.vectors[:, eigen.identifiable] / eigen.scale[:, None]
    covariance = V / eigen.values[eigen.identifiable] @ V.T
    singular_vectors = eigen.vectors[:, ~eigen.identifiable]
    indeterminate = np.flatnonzero((np.abs(singular_vectors) > VERDICT.negligible_share).any(axis=1))
    covariance[indeterminate, :] = covariance[:, indeterminate] = np.nan
    covariance[indeterminate, indeterminate] = np.inf
    errors, units = np.sqrt(np.diag(covariance)), [unknown.unit for unknown in problem.unknowns]
    parameters = {
        q.name: ParameterEstimate(q.name, q.start, 0.0, q.unit, False) for q in problem.model.parameters if not q.free
    } | {
        name: ParameterEstimate(name, float(value), float(error), unit, True)
        for name, value, error, unit in zip(problem.names, point.theta, errors, units, strict=True)
    }
    return Fit(
        model=problem.model,
        keys=problem.keys,
        values=point.theta,
        covariance=covariance,
        parameters=parameters,
        noise_covariance=point.R,
        verdict=_judge(problem, point, eigen, iterations, stop),
        iterations=iterations,
        negative_log_likelihood=point.cost,
        information=point.information,
        prior_information=problem.prior_matrix,
        segment_fits=point.segment_fits,
        variance_information=point.variance_information,
        costs=(*point.costs, point.cost),
        steps=point.steps,
    )


def _judge(problem: Problem, point: Evaluation, eigen: _EigenSystem, iterations: int, stop: Stop) -> Verdict:
    values = sum(fit.white.present.sum() for fit in point.segment_fits)
    without_prior = int((problem.prior_information == 0).sum())
    if values <= without_prior:
        text = f"not identifiable: {values} measured values are too few for {without_prior} unknowns without prior"
        return Verdict(FitStatus.NOT_IDENTIFIABLE, (Remark(Finding.TOO_FEW_VALUES, text),))
    if stop is Stop.NO_BETTER_STEP:
        text = "not converged: no step, however short, improves the likelihood any more"
        return Verdict(FitStatus.NOT_CONVERGED, (Remark(Finding.NO_BETTER_STEP, text),))
    if stop is Stop.TOO_FEW_ITERATIONS:
        text = f"not converged: {iterations} iterations were not enough"
        return Verdict(FitStatus.NOT_CONVERGED, (Remark(Finding.TOO_FEW_ITERATIONS, text),))
    if not eigen.identifiable.all():
        directions = eigen.vectors[:, ~eigen.identifiable] / eigen.scale[:, None]
        combinations = "; ".join(
            _combination(problem.names, direction, shares)
            for direction, shares in zip(directions.T, eigen.vectors.T, strict=False)
        )
        text = f"not identifiable: the data do not determine {combinations}"
        return Verdict(FitStatus.NOT_IDENTIFIABLE, (Remark(Finding.UNDETERMINED, text),))
    at_bound = [
        f"{name} = {value:g}"
        for name, value, low, high in zip(problem.names, point.theta, problem.lower, problem.upper, strict=True)
        if value in (low, high)
    ]
    if at_bound:
        text = f"converged at a bound: {', '.join(at_bound)}"
        return Verdict(FitStatus.AT_BOUND, (Remark(Finding.AT_BOUND, text),))
    converged = Remark(Finding.OPTIMUM, f"converged in {iterations} iterations")
    collinear = [
        Remark(
            Finding.COLLINEAR,
            f"collinear: {unknowns}: fix one of them, or give data in which they do not move together",
        )
        for unknowns in collinearities(problem.names, point.information + problem.prior_matrix)
    ]
    return Verdict(FitStatus.CONVERGED, (converged, *collinear))


def _combination(names: tuple[str, ...], direction: Array, shares: Array) -> str:
    """A direction in theta as text, its largest element scaled to 1. shares : the same direction in scaled units."""
    involved: NDArray[np.intp] = np.flatnonzero(np.abs(shares) > VERDICT.negligible_share * np.abs(shares).max())
    largest = direction[involved][np.argmax(np.abs(direction[involved]))]
    parts = [f"{direction[i] / largest:+.3g} {names[i]}" for i in involved]
    return parts[0].removeprefix("+1 ") if len(parts) == 1 else "a change by " + " ".join(parts)
