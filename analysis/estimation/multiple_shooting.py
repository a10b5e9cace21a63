"""Output error for unstable models: multiple shooting with tied knots.

Each segment is cut into parts. The initial state of every part is an unknown, and the end of each part is tied to the
beginning of the next, so that errors grow over one part only while the response stays that of one record. The ties are
measurements of a mismatch of zero, tightened in three steps to a hundredth of the standard error that the knot has
without them.

References: Bock, Recent Advances in Parameter Identification Techniques for ODE, 1983; Jategaonkar, Flight Vehicle
System Identification, 2nd ed., ch. 9.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.estimation import output_error
from analysis.estimation.data import Segment, split
from analysis.estimation.fit import Fit, FitStatus, Verdict
from analysis.estimation.hints import hints_of
from analysis.estimation.model import Model
from analysis.estimation.optimizer import Evaluation, converged_text, make_fit, maximize
from analysis.estimation.output_error import OutputErrorLikelihood
from analysis.estimation.problem import Problem, as_segments, free_names, inputs_of
from analysis.estimation.simulation import InputRule, Integrator, Simulator, build_simulator
from flight.errors import InputError

Array = NDArray[np.float64]

TIGHTNESS = (1.0, 0.1, 0.01)  # standard deviations of the ties, in standard errors of the knots without ties


def estimate(
    model: Model,
    segments: Segment | Sequence[Segment],
    *,
    parts: int,
    integrator: Integrator = "rk4",
    inputs: InputRule = "linear",
    start: Mapping[str, float] | None = None,
    max_iterations: int = 50,
) -> Fit:
    """Fit a model to one or several segments, each cut into `parts` with tied ends.

    Within a part an error should grow by less than about 100. The unknowns end with the initial states of all parts,
    "alpha(0)[run/2]". For the other arguments see `output_error.estimate`; the noise is normal and R diagonal.

    Raises InputError like output error, for fewer than two parts, and when the parts do not determine their states.
    """
    segments = as_segments(segments)
    if parts < 2:
        raise InputError(f"parts = {parts}: multiple shooting needs at least two; use output_error for whole segments")
    cut = [split(segment, parts) for segment in segments]
    pieces = [piece for of_segment in cut for piece in of_segment]
    loose = output_error.estimate(
        model, pieces, integrator=integrator, inputs=inputs, start=start, max_iterations=max_iterations
    )
    names = [[f"{state}(0)[{piece.name}]" for state in model.states] for piece in pieces]
    errors = np.array([[loose.parameters[name].standard_error for name in row] for row in names])
    if not np.isfinite(errors).all():
        raise InputError(f"model {model.name}: the parts are too short to determine their states; give fewer parts")
    problem = Problem.assemble(model, tuple(pieces), "free", dict(zip(loose.names, loose.values, strict=True)))
    of_states = replace(model, outputs=model.states, output_function=lambda x, u, p: [x[name] for name in model.states])
    likelihood = _TiedLikelihood(
        problem,
        OutputErrorLikelihood(problem, build_simulator(model, free_names(model), integrator, inputs)),
        build_simulator(of_states, free_names(model), integrator, inputs),
        [inputs_of(model, segment)[: len(piece) + 1] for segment, piece in _with_next(segments, cut)],
        [i for i in range(len(pieces) - 1) if (i + 1) % parts],
        np.median(errors, axis=0),
    )
    theta, iterations = problem.start, loose.iterations
    for tightness in TIGHTNESS:
        likelihood = replace(likelihood, sigma=tightness * np.median(errors, axis=0))
        point, more, why_stopped = maximize(likelihood, likelihood.evaluate(theta), max_iterations)
        theta, iterations = point.theta, iterations + more
    fit = replace(make_fit(likelihood, point, iterations, why_stopped), integrator=integrator, inputs=inputs)
    return replace(fit, verdict=_verdict(fit, iterations)) if fit.verdict.ok else fit


def _verdict(fit: Fit, iterations: int) -> Verdict:
    """With the collinearity of the parameters only: that of the knots comes from their ties."""
    own = [i for i, name in enumerate(fit.names) if "(0)[" not in name]
    names = tuple(fit.names[i] for i in own)
    information = np.asarray(np.linalg.inv(fit.covariance[np.ix_(own, own)]), dtype=np.float64)
    return Verdict(FitStatus.CONVERGED, converged_text(names, information, iterations), hints_of(fit))


def _with_next(segments: tuple[Segment, ...], cut: list[tuple[Segment, ...]]) -> list[tuple[Segment, Segment]]:
    """For each part, the rest of its segment from the first sample of the part on, and the part."""
    found = []
    for segment, pieces in zip(segments, cut, strict=True):
        at = 0
        for piece in pieces:
            rest = Segment(
                name=segment.name,
                t_s=segment.t_s[at:],
                u={name: values[at:] for name, values in segment.u.items()},
                z={},
            )
            found.append((rest, piece))
            at += len(piece)
    return found


@dataclass(frozen=True)
class _TiedLikelihood:
    """The likelihood of the parts and of the ties.

    U : per part, its inputs and the next sample's (n + 1, inputs)
    tied : parts whose end is tied to the beginning of the next
    sigma : (states,) standard deviations of the ties
    """

    problem: Problem
    parts: OutputErrorLikelihood
    of_states: Simulator
    U: list[Array]
    tied: list[int]
    sigma: Array

    def evaluate(self, theta: Array) -> Evaluation:
        point = self.parts.evaluate(theta)
        if not np.isfinite(point.cost):
            return point
        cost, g, H = point.cost, point.gradient.copy(), point.information.copy()
        for i in self.tied:
            mismatch, J = self.mismatch(theta, i)
            J = J / self.sigma[:, None]
            scaled = mismatch / self.sigma
            cost += float(scaled @ scaled) / 2
            g -= J.T @ scaled
            H += J.T @ J
        if not np.isfinite(cost):
            return point._replace(cost=np.inf)
        return point._replace(cost=cost, gradient=g, information=H)

    def mismatch(self, theta: Array, i: int) -> tuple[Array, Array]:
        """(states,) state at the end of part i minus the one at the beginning of the next; Jacobian (states, m)."""
        problem, states = self.problem, len(self.sigma)
        p, x0, _ = problem.unpack(theta, i)
        with np.errstate(over="ignore", invalid="ignore"):
            end = self.of_states.run(x0, self.U[i], p, problem.segments[i].step_s)
        following = problem.unpack(theta, i + 1)[1]
        J = np.zeros((states, len(theta)))
        J[:, problem.columns[i]] += end.S[-1]
        J[np.arange(states), problem.columns[i + 1][-states:]] -= 1.0
        return end.y[-1] - following, J

    def curvature(self, point: Evaluation) -> Array:
        return self.parts.curvature(point)
