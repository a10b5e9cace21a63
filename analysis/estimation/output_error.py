"""Maximum likelihood by output error (3.24-3.34): Gauss-Newton on exact sensitivities, R by relaxation.

The noise covariance R is re-estimated from the residuals at every point that is tried, which makes the likelihood a
function of the parameters alone; its gradient is the one with R held. A step is taken only when this likelihood
grows, so the relaxation cannot cycle. With R re-estimated, the cost (3.32) is the same number whatever the fit: what
is watched is ln det R and the size of the step in standard errors.
"""

import enum
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.estimation import noise as noise_model
from analysis.estimation.data import Segment, inputs_of, measurements_of
from analysis.estimation.model import Model, Named
from analysis.estimation.noise import Whitened
from analysis.estimation.simulation import InputRule, Integrator, Response, Simulator, trace
from flight.errors import InputError

Array = NDArray[np.float64]

STEP_TOLERANCE = 1e-4  # of a standard error: the last step's length in the metric of the information matrix
LNDET_TOLERANCE = 1e-6  # change of ln det R in the last step
SINGULAR = 1e-11  # eigenvalue of the scaled information matrix below which only rounding is left
HALVINGS = 3  # of a step before the damping is raised
FIRST_DAMPING, LARGEST_DAMPING = 1e-3, 1e8


class Status(enum.StrEnum):
    CONVERGED = "converged"
    AT_BOUND = "at a bound"
    NOT_IDENTIFIABLE = "not identifiable"
    NOT_CONVERGED = "not converged"


class Verdict(NamedTuple):
    """What to think of a fit: a status, and one line for people."""

    status: Status
    text: str

    @property
    def ok(self) -> bool:
        return self.status is Status.CONVERGED

    def __str__(self) -> str:
        return self.text


class Estimate(NamedTuple):
    name: str
    value: float
    standard_error: float  # Cramer-Rao, priors included; 0 for a parameter that was held, inf if not identifiable
    unit: str
    free: bool


@dataclass(frozen=True)
class Piece:
    """What one segment contributed: its response, residuals z - y (NaN where missing), and these in noise units.

    columns : place in `Fit.names` of each column of `white.S`
    """

    segment: Segment
    response: Response
    residuals: Array
    white: Whitened
    columns: NDArray[np.intp]


@dataclass(frozen=True)
class Fit:
    """The outcome of `estimate`.

    names : of all free numbers, "CLa" for a shared parameter, "b[run]" for a segment's own, "V(0)[run]" for an
    initial state; `values` (m,), `information` (of the data), `prior_information` (diagonal) and `covariance` (m, m;
    Cramer-Rao with the priors) follow this order. `parameters` also holds what was not free.
    """

    model: Model
    names: tuple[str, ...]
    values: Array
    covariance: Array
    parameters: dict[str, Estimate]
    noise_covariance: Array
    verdict: Verdict
    iterations: int
    negative_log_likelihood: float
    information: Array
    prior_information: Array
    pieces: tuple[Piece, ...]

    @property
    def residuals(self) -> dict[str, Array]:
        """Segment name to (n, outputs), z - y; NaN where a sample is missing."""
        return {piece.segment.name: piece.residuals for piece in self.pieces}

    @property
    def responses(self) -> dict[str, Response]:
        return {piece.segment.name: piece.response for piece in self.pieces}

    @property
    def samples(self) -> int:
        """Number of measured values that went in."""
        return int(sum(piece.white.present.sum() for piece in self.pieces))

    def shared(self, values: Array | None = None) -> Named:
        """The model's shared parameters by name, at `values` (in the order of `names`) or at the estimate."""
        free = dict(zip(self.names, self.values if values is None else values, strict=True))
        return Named("shared parameter", {q.name: free.get(q.name, q.start) for q in self.model.parameters if q.shared})


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
    problem = _Problem.prepare(
        model, segments, trace(model, _free_names(model), integrator, inputs), initial_states, start or {}
    )
    if tail_dof is not None and (noise == "full" or noise_covariance is not None or tail_dof <= 0):
        raise InputError(
            "tail_dof must be greater than zero, and goes with a diagonal noise covariance to be estimated"
        )
    known = None if noise_covariance is None else _known_covariance(noise_covariance, model)
    likelihood = _Likelihood(problem, noise, known, tail_dof)
    point = likelihood.at(problem.start)
    if not np.isfinite(point.cost):
        raise InputError(_where_it_left(problem))
    point, iterations, why_stopped = _climb(likelihood, point, max_iterations)
    return _report(likelihood, point, iterations, why_stopped)


def _free_names(model: Model) -> tuple[str, ...]:
    return tuple(q.name for q in model.parameters if q.free)


def _known_covariance(given: ArrayLike, model: Model) -> Array:
    R = np.asarray(given, dtype=float)
    R = np.diag(R) if R.ndim == 1 else R
    m = len(model.outputs)
    if R.shape != (m, m) or not np.allclose(R, R.T) or np.linalg.eigvalsh(R)[0] <= 0:
        raise InputError(f"noise_covariance must be a positive definite ({m}, {m}) matrix, or {m} variances")
    return R


@dataclass(frozen=True)
class _Problem:
    """The free numbers of all segments in one vector, and how each segment uses them."""

    model: Model
    simulator: Simulator
    segments: tuple[Segment, ...]
    U: list[Array]
    Z: list[Array]
    names: tuple[str, ...]
    units: tuple[str, ...]
    start: Array
    lower: Array
    upper: Array
    prior_mean: Array
    prior_information: Array  # diagonal
    columns: list[NDArray[np.intp]]  # per segment: place of each of its numbers
    free_states: NDArray[np.intp]
    x0: list[Array]

    @classmethod
    def prepare(
        cls,
        model: Model,
        segments: tuple[Segment, ...],
        simulator: Simulator,
        initial_states: Literal["free", "given"] | tuple[str, ...],
        start: Mapping[str, float],
    ) -> "_Problem":
        if not segments:
            raise InputError(f"model {model.name}: there is no segment to fit")
        for name, count in Counter(segment.name for segment in segments).items():
            if count > 1:
                raise InputError(f"two segments are named {name!r}")
        choice = (
            {"free": model.states, "given": ()}.get(initial_states)
            if isinstance(initial_states, str)
            else initial_states
        )
        if choice is None or not set(choice) <= set(model.states):
            raise InputError(f"initial_states = {initial_states!r}: 'free', 'given', or some of {model.states}")
        free_states = np.array([i for i, s in enumerate(model.states) if s in choice], dtype=np.intp)

        place: dict[str, int] = {}
        rows: list[tuple[str, float, float, float, float, float]] = []

        def number(name: str, *row: object) -> int:
            if name not in place:
                place[name] = len(rows)
                rows.append(row)  # type: ignore[arg-type]
            return place[name]

        columns, x0 = [], []
        for segment in segments:
            x0.append(_initial_state(model, segment))
            used = []
            for q in model.parameters:
                if q.free:
                    name = q.name if q.shared else f"{q.name}[{segment.name}]"
                    value = float(np.clip(start.get(name, start.get(q.name, q.start)), q.lower, q.upper))
                    used.append(number(name, q.unit, value, q.lower, q.upper, q.prior_center, q.prior_sigma**-2.0))
            for i in free_states:
                name = f"{model.states[i]}(0)[{segment.name}]"
                used.append(number(name, "", start.get(name, x0[-1][i]), -np.inf, np.inf, 0.0, 0.0))
            columns.append(np.array(used, dtype=np.intp))
        known = set(place) | {q.name for q in model.parameters if q.free}
        for name in start:
            if name not in known:
                raise InputError(f"start: {name!r} is none of the free numbers {', '.join(place)}")
        if not rows:
            raise InputError(f"model {model.name}: nothing is free to be estimated")
        units, values, lower, upper, mean, information = zip(*rows, strict=True)
        return cls(
            model, simulator, segments,
            [inputs_of(model, s) for s in segments], [measurements_of(model, s) for s in segments],
            tuple(place), units, np.array(values), np.array(lower), np.array(upper), np.array(mean),
            np.array(information), columns, free_states, x0,
        )  # fmt: skip

    def respond(self, theta: Array, i: int) -> Response:
        """Segment i's response, its sensitivities reduced to the segment's own numbers."""
        model, count = self.model, len(self.simulator.free)
        own = theta[self.columns[i]]
        p = np.array([q.start for q in model.parameters], dtype=float)
        p[[q.free for q in model.parameters]] = own[:count]
        x0 = self.x0[i].copy()
        x0[self.free_states] = own[count:]
        x, y, S = self.simulator.run(x0, self.U[i], p, self.segments[i].step_s)
        return Response(x, y, S[:, :, np.concatenate([np.arange(count), count + self.free_states])])


def _initial_state(model: Model, segment: Segment) -> Array:
    guess = dict(model.initial_state(segment)) if model.initial_state else {}
    guess.update(segment.x0)
    for state in model.states:
        if state not in guess:
            measured = segment.z.get(state, np.array([]))
            measured = measured[np.isfinite(measured)]
            if not len(measured):
                raise InputError(f"segment {segment.name}: no starting value for state {state}; give it in x0")
            guess[state] = measured[0]
    return np.array([guess[state] for state in model.states], dtype=float)


class _Point(NamedTuple):
    theta: Array
    cost: float  # negative log-likelihood, priors included; inf where the response is not finite
    pieces: tuple[Piece, ...]
    R: Array
    gradient: Array  # downhill, priors included
    information: Array  # of the data


@dataclass(frozen=True)
class _Likelihood:
    problem: _Problem
    noise: noise_model.Kind
    known: Array | None
    tail_dof: float | None

    def at(self, theta: Array) -> _Point:
        problem, m = self.problem, len(theta)
        with np.errstate(over="ignore", invalid="ignore"):
            responses = [problem.respond(theta, i) for i in range(len(problem.segments))]
            residuals = [z - response.y for z, response in zip(problem.Z, responses, strict=True)]
        if not all(np.isfinite(r.y).all() and np.isfinite(r.S).all() for r in responses):
            return _Point(theta, np.inf, (), np.zeros((0, 0)), np.zeros(m), np.zeros((m, m)))
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
        return _Point(theta, cost, tuple(pieces), R, g, noise_model.information_factor(self.tail_dof) * H)

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


def _where_it_left(problem: _Problem) -> str:
    for i, segment in enumerate(problem.segments):
        with np.errstate(over="ignore", invalid="ignore"):
            response = problem.respond(problem.start, i)
        finite = np.isfinite(response.y).all(axis=1) & np.isfinite(response.S).all(axis=(1, 2))
        if not finite.all():
            at = segment.t_s[int(np.argmin(finite))]
            break
    return (
        f"model {problem.model.name}, segment {segment.name}: with the starting values the response is not finite from"
        f" t = {at:g} s on; give better starting values, or, if the model is unstable, cut the segment (data.split)"
    )


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


def _climb(likelihood: _Likelihood, point: _Point, max_iterations: int) -> tuple[_Point, int, str]:
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
        if new is None:
            newton = spectrum.step(point.gradient[move], 0.0)
            if point.gradient[move] @ newton < STEP_TOLERANCE:  # half of it is what could still be gained
                return point, iteration, ""
            return point, iteration, "no step, however short, improves the likelihood any more"
        step = new.theta - point.theta
        length = np.sqrt(max(float(step @ H @ step), 0.0))
        change = abs(np.linalg.slogdet(new.R)[1] - np.linalg.slogdet(point.R)[1])
        point = new
        if damping == 0 and length < STEP_TOLERANCE and change < LNDET_TOLERANCE:
            return point, iteration, ""
    return point, max_iterations, f"{max_iterations} iterations were not enough"


def _improve(
    likelihood: _Likelihood, point: _Point, spectrum: _Spectrum, move: NDArray[np.intp], damping: float
) -> tuple[_Point | None, float]:
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


def _report(likelihood: _Likelihood, point: _Point, iterations: int, why_stopped: str) -> Fit:
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
    )


def _judge(problem: _Problem, point: _Point, spectrum: _Spectrum, iterations: int, why_stopped: str) -> Verdict:
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
