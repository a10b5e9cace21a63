"""Up a likelihood: Gauss-Newton with Levenberg-Marquardt damping and halved steps, bounds kept, and a verdict.

What is watched is the size of the step in standard errors, and ln det R: with R re-estimated from the residuals, the
cost (3.32) is the same number whatever the fit.
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from analysis.estimation.fit import Estimate, Fit, Piece, Status, Verdict
from analysis.estimation.problem import Problem

Array = NDArray[np.float64]

STEP_TOLERANCE = 1e-4  # of a standard error: the last step's length in the metric of the information matrix
LNDET_TOLERANCE = 1e-6  # change of ln det R in the last step
GAIN_TOLERANCE = 1e-4  # in cost, of one more Newton step, where no step improves any more
SINGULAR = 1e-11  # eigenvalue of the scaled information matrix below which only rounding is left
HALVINGS = 3  # of a step before the damping is raised
FIRST_DAMPING, LARGEST_DAMPING = 1e-3, 1e8


class Point(NamedTuple):
    theta: Array
    cost: float  # negative log-likelihood, priors included; inf where the response is not finite
    pieces: tuple[Piece, ...]
    R: Array
    gradient: Array  # downhill, priors included
    information: Array  # of the data
    spread_information: Array | float = 0.0  # the part of it that comes from the sizes of residuals
    ln_det_R: float = 0.0  # where R is re-estimated at every point; 0 where it is not


class Likelihood(Protocol):
    @property
    def problem(self) -> Problem: ...

    def at(self, theta: Array) -> Point: ...


class _Spectrum(NamedTuple):
    """Eigenvalues and vectors of the information matrix, scaled to a unit diagonal: H = s V diag(values) V' s."""

    values: Array
    vectors: Array
    scale: Array

    @classmethod
    def of(cls, H: Array) -> "_Spectrum":
        scale = np.sqrt(np.diag(H))
        scale[scale == 0] = 1.0
        return cls(*np.linalg.eigh(H / np.outer(scale, scale)), scale)

    @property
    def known(self) -> NDArray[np.bool_]:
        return self.values > SINGULAR

    def step(self, g: Array, damping: float) -> Array:
        """Levenberg-Marquardt step; nothing along directions of which the data know nothing."""
        V = self.vectors[:, self.known]
        return V @ ((V.T @ (g / self.scale)) / (self.values[self.known] + damping)) / self.scale


def climb(
    likelihood: Likelihood, point: Point, max_iterations: int, step_tolerance: float = STEP_TOLERANCE
) -> tuple[Point, int, str]:
    """From a point up the likelihood. Returns the last point, how many steps, and "" or why it is not the optimum."""
    problem = likelihood.problem
    damping = 0.0
    for iteration in range(1, max_iterations + 1):
        H = point.information + np.diag(problem.prior_information)
        # A bound that the gradient pushes against holds its parameter in this step.
        held = ((point.theta <= problem.lower) & (point.gradient < 0)) | (
            (point.theta >= problem.upper) & (point.gradient > 0)
        )
        move = np.flatnonzero(~held)
        if not len(move):
            return point, iteration, ""
        spectrum = _Spectrum.of(H[np.ix_(move, move)])
        new, damping = _improve(likelihood, point, spectrum, move, damping)
        if new is None or new.cost == point.cost:  # what is left is rounding, or the gradient is wrong
            newton = spectrum.step(point.gradient[move], 0.0)
            if point.gradient[move] @ newton < GAIN_TOLERANCE:  # half of it is what could still be gained
                return point, iteration, ""
            return point, iteration, "no step, however short, improves the likelihood any more"
        step = new.theta - point.theta
        length = np.sqrt(max(float(step @ H @ step), 0.0))
        change = abs(new.ln_det_R - point.ln_det_R)
        point = new
        if damping == 0 and length < step_tolerance and change < LNDET_TOLERANCE:
            return point, iteration, ""
    return point, max_iterations, f"{max_iterations} iterations were not enough"


def _improve(
    likelihood: Likelihood, point: Point, spectrum: _Spectrum, move: NDArray[np.intp], damping: float
) -> tuple[Point | None, float]:
    """A point with a smaller cost, and the damping to go on with; None when there is none to be found."""
    problem = likelihood.problem
    while damping <= LARGEST_DAMPING:
        step = spectrum.step(point.gradient[move], damping)
        for halving in range(HALVINGS + 1):
            theta = point.theta.copy()
            theta[move] += step / 2**halving
            new = likelihood.at(np.clip(theta, problem.lower, problem.upper))
            if new.cost <= point.cost:
                if halving == 0:
                    damping = damping / 10 if damping > FIRST_DAMPING else 0.0
                return new, damping
        damping = max(10 * damping, FIRST_DAMPING)
    return None, damping


def report(likelihood: Likelihood, point: Point, iterations: int, why_stopped: str) -> Fit:
    """What a climb that ended at `point` has to say."""
    problem = likelihood.problem
    spectrum = _Spectrum.of(point.information + np.diag(problem.prior_information))
    known = spectrum.known
    V = spectrum.vectors[:, known] / spectrum.scale[:, None]
    covariance = V / spectrum.values[known] @ V.T
    unknown = np.flatnonzero((np.abs(spectrum.vectors[:, ~known]) > 0.01).any(axis=1))
    covariance[unknown, :] = covariance[:, unknown] = np.nan
    covariance[unknown, unknown] = np.inf
    errors = np.sqrt(np.diag(covariance))
    parameters = {
        q.name: Estimate(q.name, q.start, 0.0, q.unit, False) for q in problem.model.parameters if not q.free
    } | {
        name: Estimate(name, float(value), float(error), unit, True)
        for name, value, error, unit in zip(problem.names, point.theta, errors, problem.units, strict=True)
    }
    return Fit(
        model=problem.model,
        names=problem.names,
        values=point.theta,
        covariance=covariance,
        parameters=parameters,
        noise_covariance=point.R,
        verdict=_judge(problem, point, spectrum, iterations, why_stopped),
        iterations=iterations,
        negative_log_likelihood=point.cost,
        information=point.information,
        prior_information=np.diag(problem.prior_information),
        pieces=point.pieces,
        spread_information=point.spread_information,
    )


def _judge(problem: Problem, point: Point, spectrum: _Spectrum, iterations: int, why_stopped: str) -> Verdict:
    if why_stopped:
        return Verdict(Status.NOT_CONVERGED, f"not converged: {why_stopped}")
    if not spectrum.known.all():
        free = spectrum.vectors[:, ~spectrum.known] / spectrum.scale[:, None]
        combinations = "; ".join(
            _combination(problem.names, v, w) for v, w in zip(free.T, spectrum.vectors.T, strict=False)
        )
        return Verdict(Status.NOT_IDENTIFIABLE, f"not identifiable: the data do not notice {combinations}")
    at_bound = [
        f"{name} = {value:g}"
        for name, value, low, high in zip(problem.names, point.theta, problem.lower, problem.upper, strict=True)
        if value in (low, high)
    ]
    if at_bound:
        return Verdict(Status.AT_BOUND, f"converged at a bound: {', '.join(at_bound)}")
    return Verdict(Status.CONVERGED, f"converged in {iterations} iterations")


def _combination(names: tuple[str, ...], direction: Array, shares: Array) -> str:
    """`direction` in words, its largest part 1; `shares` are its parts in comparable units, to leave out the zeros."""
    matters: NDArray[np.intp] = np.flatnonzero(np.abs(shares) > 0.01 * np.abs(shares).max())
    largest = direction[matters][np.argmax(np.abs(direction[matters]))]
    parts = [f"{direction[i] / largest:+.3g} {names[i]}" for i in matters]
    return parts[0].removeprefix("+1 ") if len(parts) == 1 else "a change by " + " ".join(parts)
