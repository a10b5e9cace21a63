"""Maximum likelihood by output error (3.24-3.34): Gauss-Newton on exact sensitivities, R by relaxation.

The noise covariance R is re-estimated from the residuals at every point that is tried, which makes the likelihood a
function of the parameters alone; its gradient is the one with R held. A step is taken only when this likelihood
grows, so the relaxation cannot cycle.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.estimation import noise as noise_model
from analysis.estimation.data import Segment
from analysis.estimation.fit import Estimate as Estimate
from analysis.estimation.fit import Fit as Fit
from analysis.estimation.fit import Piece as Piece
from analysis.estimation.fit import Status as Status
from analysis.estimation.fit import Verdict as Verdict
from analysis.estimation.model import Model
from analysis.estimation.optimizer import Point, climb, report
from analysis.estimation.problem import Problem, free_names
from analysis.estimation.simulation import InputRule, Integrator, Response, Simulator, trace
from flight.errors import InputError

Array = NDArray[np.float64]


def estimate(
    model: Model,
    segments: Segment | Sequence[Segment],
    *,
    integrator: Integrator = "rk4",
    inputs: InputRule = "linear",
    initial_states: Literal["free", "given"] | tuple[str, ...] = "free",
    noise: noise_model.Kind = "diagonal",
    noise_covariance: ArrayLike | None = None,
    tail_dof: float | None = None,
    start: Mapping[str, float] | None = None,
    max_iterations: int = 50,
) -> Fit:
    """Fit a model to one or several segments at once.

    initial_states : "free" estimates the state at the start of each segment, "given" takes it from `Segment.x0` (or
    the model's guess, or the first sample of an output of that name); a tuple names the states that are free
    noise_covariance : R (outputs, outputs), or variances (outputs,), when they are known; else R is estimated
    tail_dof : degrees of freedom of t noise (4 or so) where there are outliers; with diagonal noise only
    start : starting values that replace the parameters' own, by name or full name

    The verdict says whether the optimum was reached, lies at a bound, or does not determine every number. Raises
    InputError for data or options that cannot be used, and when the starting values do not give a finite response.
    """
    segments = (segments,) if isinstance(segments, Segment) else tuple(segments)
    simulator = trace(model, free_names(model), integrator, inputs)
    problem = Problem.prepare(model, segments, initial_states, start or {})
    if tail_dof is not None and (noise == "full" or noise_covariance is not None or tail_dof <= 0):
        raise InputError(
            "tail_dof must be greater than zero, and goes with a diagonal noise covariance to be estimated"
        )
    known = None if noise_covariance is None else _known_covariance(noise_covariance, model)
    likelihood = _Likelihood(problem, simulator, noise, known, tail_dof)
    point = likelihood.at(problem.start)
    if not np.isfinite(point.cost):
        raise InputError(_where_it_left(likelihood))
    point, iterations, why_stopped = climb(likelihood, point, max_iterations)
    return report(likelihood, point, iterations, why_stopped)


def _known_covariance(given: ArrayLike, model: Model) -> Array:
    R = np.asarray(given, dtype=float)
    R = np.diag(R) if R.ndim == 1 else R
    m = len(model.outputs)
    if R.shape != (m, m) or not np.allclose(R, R.T) or np.linalg.eigvalsh(R)[0] <= 0:
        raise InputError(f"noise_covariance must be a positive definite ({m}, {m}) matrix, or {m} variances")
    return R


@dataclass(frozen=True)
class _Likelihood:
    problem: Problem
    simulator: Simulator
    noise: noise_model.Kind
    known: Array | None
    tail_dof: float | None

    def respond(self, theta: Array, i: int) -> Response:
        """Segment i's response, its sensitivities reduced to the segment's own numbers."""
        problem, count = self.problem, len(self.simulator.free)
        p, x0, _ = problem.of_segment(theta, i)
        x, y, S = self.simulator.run(x0, problem.U[i], p, problem.segments[i].step_s)
        return Response(x, y, S[:, :, np.concatenate([np.arange(count), count + problem.free_states])])

    def at(self, theta: Array) -> Point:
        problem, m = self.problem, len(theta)
        with np.errstate(over="ignore", invalid="ignore"):
            responses = [self.respond(theta, i) for i in range(len(problem.segments))]
            residuals = [z - response.y for z, response in zip(problem.Z, responses, strict=True)]
        if not all(np.isfinite(r.y).all() and np.isfinite(r.S).all() for r in responses):
            return Point(theta, np.inf, (), np.zeros((0, 0)), np.zeros(m), np.zeros((m, m)))
        R = self._covariance(residuals)
        g, H, cost = np.zeros(m), np.zeros((m, m)), 0.0
        pieces = []
        for i, response in enumerate(responses):
            white = noise_model.whiten(residuals[i], response.S, R, self.tail_dof)
            cost += noise_model.negative_log_likelihood(white, R, self.tail_dof)
            columns = problem.columns[i]
            flat = white.S.reshape(-1, len(columns))
            g[columns] += flat.T @ (white.weight * white.e).ravel()
            H[np.ix_(columns, columns)] += flat.T @ flat
            pieces.append(Piece(problem.segments[i], response, residuals[i], white, columns))
        away = theta - problem.prior_mean
        cost += float(problem.prior_information @ away**2) / 2
        g -= problem.prior_information * away
        H *= noise_model.information_factor(self.tail_dof)
        return Point(theta, cost, tuple(pieces), R, g, H, ln_det_R=float(np.linalg.slogdet(R)[1]))

    def _covariance(self, residuals: list[Array]) -> Array:
        if self.known is not None:
            return self.known
        everything = np.concatenate(self.problem.Z)
        for name, measured in zip(self.problem.model.outputs, everything.T, strict=True):
            if not np.isfinite(measured).any():
                raise InputError(f"output {name} has not a single sample in any segment")
        scale = np.sqrt(np.nanmean(everything**2, axis=0))
        scale[scale == 0] = 1.0
        return noise_model.noise_covariance(np.concatenate(residuals), scale, self.noise, self.tail_dof)


def _where_it_left(likelihood: _Likelihood) -> str:
    problem = likelihood.problem
    for i, segment in enumerate(problem.segments):
        with np.errstate(over="ignore", invalid="ignore"):
            response = likelihood.respond(problem.start, i)
        finite = np.isfinite(response.y).all(axis=1) & np.isfinite(response.S).all(axis=(1, 2))
        if not finite.all():
            at = segment.t_s[int(np.argmin(finite))]
            break
    return (
        f"model {problem.model.name}, segment {segment.name}: with the starting values the response is not finite from"
        f" t = {at:g} s on; give better starting values, or, if the model is unstable, cut the segment (data.split)"
    )
