"""Maximum likelihood by filter error: output error for motion that is disturbed, by turbulence say.

White process noise drives some of the states, x' = f(x, u, p) + w. An extended Kalman filter (`innovations`) follows
the record; the likelihood is that of its innovations, each against its own predicted variance. Parameters, initial
states, intensities of the process noise and standard deviations of the outputs are numbers alike: Gauss-Newton with
exact derivatives of the whole filter, and the information of the likelihood as its metric, moves them all at once.
Without process noise the filter's covariance stays zero, and what remains is output error.

Turbulence is coloured: give the model a gust as a state of its own with first-order dynamics, and let the noise drive
that (`models.level_run` shows how).
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.estimation.data import Segment
from analysis.estimation.fit import Fit, Piece, Status, Verdict
from analysis.estimation.innovations import Filter, Innovations, trace_filter
from analysis.estimation.intervals import NORMAL_95
from analysis.estimation.model import Model
from analysis.estimation.noise import Whitened
from analysis.estimation.optimizer import Point, climb, report
from analysis.estimation.problem import Number, Problem, free_names
from analysis.estimation.simulation import InputRule, Integrator, Response
from flight.errors import InputError

Array = NDArray[np.float64]

REACH = math.log(1e3)  # how far an intensity may go from its start before it counts as none, or as out of hand
# Of a standard error: where noises are among the numbers, each step gains a factor of three or four, no more.
STEP_TOLERANCE = 1e-3
SMALLEST_PART = 1e-9  # of an output's rms: noise below it is rounding


@dataclass(frozen=True, kw_only=True)
class ProcessNoise:
    """White noise that drives one state.

    start : intensity [the state's unit per sqrt(s)]: its variance grows by start^2 in a second. Held there unless
    `free`; zero only when held. Free, it should be right within a factor of a thousand.
    acted_s : how long it has acted when a segment begins, whose first value of the state then has the variance
    intensity^2 acted_s and is no number to be estimated: half the time constant of a gust, 0 for the aircraft's own.
    prior_sigma : of a normal prior of ln intensity about ln start
    """

    state: str
    start: float
    free: bool = True
    acted_s: float = 0.0
    prior_sigma: float = math.inf

    def __post_init__(self) -> None:
        if not (math.isfinite(self.start) and self.start >= 0 and (self.start > 0 or not self.free)):
            raise InputError(f"process noise of {self.state}: start must be greater than zero, is {self.start}")
        if not (math.isfinite(self.acted_s) and self.acted_s >= 0):
            raise InputError(f"process noise of {self.state}: acted_s must not be negative, is {self.acted_s}")
        if not self.prior_sigma > 0:
            raise InputError(f"process noise of {self.state}: prior_sigma must be greater than zero")


class Intensity(NamedTuple):
    """An intensity of process noise [the state's unit per sqrt(s)], its 95 % interval, and whether there is any.

    p_value : how often a likelihood ratio as large would come from data without this noise (Self & Liang 1987, J. Am.
    Stat. Assoc. 82, 605, case 5: half the time the best intensity is then zero); NaN for one that was held.
    """

    value: float
    lo: float
    hi: float
    p_value: float

    @property
    def significant(self) -> bool:
        return self.p_value < 0.05


@dataclass(frozen=True, kw_only=True)
class FilterFit(Fit):
    """The outcome of `estimate`.

    `names` ends with "ln w(state)" for intensities and "ln v(output)" for standard deviations of noise; residuals are
    innovations, responses what the filter predicts one sample ahead (y) and knows after it (x).
    process_noise : by state
    """

    process_noise: dict[str, Intensity]


def estimate(
    model: Model,
    segments: Segment | Sequence[Segment],
    process_noise: ProcessNoise | Sequence[ProcessNoise],
    *,
    integrator: Integrator = "rk4",
    inputs: InputRule = "linear",
    initial_states: Literal["free", "given"] | tuple[str, ...] = "free",
    noise_sigma: Mapping[str, float] | None = None,
    start: Mapping[str, float] | None = None,
    max_iterations: int = 50,
    tested: bool = True,
) -> FilterFit:
    """Fit a model with process noise to one or several segments at once.

    noise_sigma : standard deviations of the outputs' noise by output, where they are known; the others are estimated
    tested : whether each free intensity is compared with none at all, which takes one more fit each
    The rest as in `output_error.estimate`.

    The verdict also says which process noise is not significant: then output error does as well. Raises InputError as
    output error does, and for process noise of a state that the model does not have.
    """
    segments = (segments,) if isinstance(segments, Segment) else tuple(segments)
    noises = (process_noise,) if isinstance(process_noise, ProcessNoise) else tuple(process_noise)
    _check(model, noises, noise_sigma or {})
    begin_random = {noise.state for noise in noises if noise.acted_s > 0}
    if initial_states == "free":
        initial_states = tuple(state for state in model.states if state not in begin_random)
    elif begin_random & set(initial_states):
        raise InputError(f"initial_states: {sorted(begin_random)[0]} begins as its process noise left it (acted_s)")
    traced = trace_filter(model, free_names(model), tuple(noise.state for noise in noises), integrator, inputs)

    held = {f"ln w({noise.state})": _log(noise.start) for noise in noises if not noise.free}
    held |= {f"ln v({output})": _log(sigma) for output, sigma in (noise_sigma or {}).items()}
    further = _noise_numbers(model, segments, noises)
    known = {number.name for number in further} & set(held)
    problem = Problem.prepare(
        model, segments, initial_states, start or {}, [number for number in further if number.name not in known]
    )
    likelihood = _Likelihood(problem, traced, noises, held)
    point = likelihood.at(problem.start)
    if not np.isfinite(point.cost):
        raise InputError(_where_it_left(likelihood))
    point, iterations, why_stopped = climb(likelihood, point, max_iterations, STEP_TOLERANCE)
    none = [name for name in likelihood.intensities if point.theta[likelihood.place(name)] <= likelihood.lowest(name)]
    if none and not why_stopped:
        likelihood, first = likelihood.without(none, point.theta)
        point, more, why_stopped = climb(likelihood, likelihood.at(first), max_iterations, STEP_TOLERANCE)
        iterations += more
    fit = report(likelihood, point, iterations, why_stopped)
    found = {noise.state: _intensity(fit, noise, set(none)) for noise in noises}
    if tested and fit.verdict.status in (Status.CONVERGED, Status.AT_BOUND):
        for name in likelihood.intensities:
            bare, first = likelihood.without([name], point.theta)
            without, _, failed = climb(bare, bare.at(first), max_iterations, STEP_TOLERANCE)
            ratio = math.nan if failed else max(0.0, 2 * (without.cost - point.cost))
            state = name.removeprefix("ln w(").removesuffix(")")
            found[state] = found[state]._replace(p_value=math.erfc(math.sqrt(ratio / 2)) / 2)
    return FilterFit(**(vars(fit) | {"verdict": _verdict(fit, found)}), process_noise=found)


def _check(model: Model, noises: tuple[ProcessNoise, ...], noise_sigma: Mapping[str, float]) -> None:
    for state, count in Counter(noise.state for noise in noises).items():
        if state not in model.states:
            raise InputError(
                f"process noise: model {model.name} has no state {state!r}; it has {', '.join(model.states) or 'none'}"
            )
        if count > 1:
            raise InputError(f"process noise: two are given for {state}")
    for output, sigma in noise_sigma.items():
        if output not in model.outputs:
            raise InputError(f"noise_sigma: model {model.name} has no output {output!r}")
        if not (math.isfinite(sigma) and sigma > 0):
            raise InputError(f"noise_sigma: {output} must be greater than zero, is {sigma}")


def _log(value: float) -> float:
    return math.log(value) if value > 0 else -math.inf


def _noise_numbers(model: Model, segments: tuple[Segment, ...], noises: tuple[ProcessNoise, ...]) -> list[Number]:
    numbers = [
        Number(f"ln w({n.state})", "", _log(n.start), _log(n.start) - REACH, _log(n.start) + REACH, _log(n.start),
               n.prior_sigma**-2.0)
        for n in noises
    ]  # fmt: skip
    for output in model.outputs:
        signals = [segment.z[output] for segment in segments if output in segment.z]
        scale = math.sqrt(np.nanmean(np.square(np.concatenate(signals)))) if _any_finite(signals) else 0.0
        lowest = SMALLEST_PART * (scale or 1.0)
        # What a straight line between its neighbours does not explain of a sample is noise, with 3/2 of its variance.
        bends = np.concatenate([z[1:-1] - (z[:-2] + z[2:]) / 2 for z in signals] or [np.array([])])
        bends = bends[np.isfinite(bends)]
        sigma = math.sqrt(np.mean(bends**2) / 1.5) if len(bends) else 0.01 * scale
        numbers.append(Number(f"ln v({output})", "", _log(max(sigma, 2 * lowest)), _log(lowest)))
    return numbers


def _any_finite(signals: list[Array]) -> bool:
    return any(np.isfinite(z).any() for z in signals)


@dataclass(frozen=True)
class _Likelihood:
    """Of the innovations. held : ln w and ln v that are no free numbers, by name."""

    problem: Problem
    filter: Filter
    noises: tuple[ProcessNoise, ...]
    held: dict[str, float]

    @property
    def intensities(self) -> list[str]:
        """Names of those that are free."""
        return [name for name in self.problem.names if name.startswith("ln w(")]

    def place(self, name: str) -> int:
        return self.problem.names.index(name)

    def lowest(self, name: str) -> float:
        return float(self.problem.lower[self.place(name)])

    def without(self, gone: Sequence[str], theta: Array) -> tuple["_Likelihood", Array]:
        """The likelihood with these intensities held at zero, and theta without them."""
        problem = self.problem
        keep = np.array([name not in gone for name in problem.names])
        new_place = np.cumsum(keep) - 1
        smaller = replace(
            problem,
            names=tuple(name for name in problem.names if name not in gone),
            units=tuple(unit for unit, stays in zip(problem.units, keep, strict=True) if stays),
            start=problem.start[keep],
            lower=problem.lower[keep],
            upper=problem.upper[keep],
            prior_mean=problem.prior_mean[keep],
            prior_information=problem.prior_information[keep],
            columns=[new_place[columns[keep[columns]]] for columns in problem.columns],
        )
        return replace(self, problem=smaller, held=self.held | dict.fromkeys(gone, -math.inf)), theta[keep]

    def filtered(self, theta: Array, i: int) -> tuple[Innovations, Array]:
        """Segment i through the filter, derivatives reduced to the segment's own numbers; and ln v."""
        problem = self.problem
        p, x0, further = problem.of_segment(theta, i)
        all_names = [f"ln w({noise.state})" for noise in self.noises]
        all_names += [f"ln v({output})" for output in problem.model.outputs]
        free = [k for k, name in enumerate(all_names) if name not in self.held]
        ln_noise = np.array([self.held.get(name, np.nan) for name in all_names])
        ln_noise[free] = further
        ln_w, ln_v = np.split(ln_noise, [len(self.noises)])
        acted_s = np.array([noise.acted_s for noise in self.noises])
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            found = self.filter.run(x0, problem.U[i], problem.Z[i], p, ln_w, ln_v, acted_s, problem.segments[i].step_s)
        count = len(self.filter.free)
        own = np.concatenate(
            [np.arange(count), count + len(all_names) + problem.free_states, count + np.array(free, dtype=int)]
        )
        return found._replace(d_e=found.d_e[:, :, own], d_ln_s=found.d_ln_s[:, :, own]), ln_v

    def at(self, theta: Array) -> Point:
        problem, m = self.problem, len(theta)
        g, H, spread, cost = np.zeros(m), np.zeros((m, m)), np.zeros((m, m)), 0.0
        pieces = []
        for i, segment in enumerate(problem.segments):
            found, ln_v = self.filtered(theta, i)
            present = np.isfinite(problem.Z[i])
            if not (_finite(found, present) and np.isfinite(found.x).all()):
                return Point(theta, np.inf, (), np.zeros((0, 0)), np.zeros(m), np.zeros((m, m)))
            own, there = problem.columns[i], present[:, :, None]
            sigma = np.where(present, np.exp(found.ln_s / 2), 1.0)
            e = np.where(present, found.e / sigma, 0.0)
            S = np.where(there, -found.d_e / sigma[:, :, None], 0.0)
            d_ln_s = np.where(there, found.d_ln_s, 0.0).reshape(-1, len(own))
            flat = S.reshape(-1, len(own))
            cost += float(np.sum(e**2) + np.sum(found.ln_s[present])) / 2
            g[own] += flat.T @ e.ravel() + d_ln_s.T @ (e.ravel() ** 2 - 1) / 2
            sizes = d_ln_s.T @ d_ln_s / 2
            H[np.ix_(own, own)] += flat.T @ flat + sizes
            spread[np.ix_(own, own)] += sizes
            residuals = np.where(present, found.e, np.nan)
            white = Whitened(e, np.ones_like(e), S, present)
            pieces.append(Piece(segment, Response(found.x, found.y, -found.d_e), residuals, white, own))
        away = theta - problem.prior_mean
        cost += float(problem.prior_information @ away**2) / 2
        g -= problem.prior_information * away
        return Point(theta, cost, tuple(pieces), np.diag(np.exp(2 * ln_v)), g, H, spread)


def _finite(found: Innovations, present: NDArray[np.bool_]) -> bool:
    return all(np.isfinite(values[present]).all() for values in (found.e, found.ln_s, found.d_e, found.d_ln_s))


def _where_it_left(likelihood: _Likelihood) -> str:
    problem = likelihood.problem
    for i, segment in enumerate(problem.segments):
        x = likelihood.filtered(problem.start, i)[0].x
        finite = np.isfinite(x).all(axis=1)
        if not finite.all():
            return (
                f"model {problem.model.name}, segment {segment.name}: with the starting values the filter is not finite"
                f" from t = {segment.t_s[int(np.argmin(finite))]:g} s on; give better starting values"
            )
    return f"model {problem.model.name}: with the starting values the likelihood is not finite"


def _intensity(fit: Fit, noise: ProcessNoise, none: set[str]) -> Intensity:
    name = f"ln w({noise.state})"
    if name in none:
        return Intensity(0.0, 0.0, 0.0, 0.5)
    if name not in fit.names:
        return Intensity(noise.start, noise.start, noise.start, np.nan)
    ln_w, error = fit.parameters[name].value, fit.parameters[name].standard_error
    lo, hi = np.exp([ln_w - NORMAL_95 * error, ln_w + NORMAL_95 * error])
    return Intensity(math.exp(ln_w), float(lo), float(hi), np.nan)


def _verdict(fit: Fit, found: dict[str, Intensity]) -> Verdict:
    idle = [state for state, intensity in found.items() if intensity.p_value >= 0.05]
    if not idle or fit.verdict.status is Status.NOT_CONVERGED:
        return fit.verdict
    return Verdict(fit.verdict.status, f"{fit.verdict.text}; process noise of {', '.join(idle)} is not significant")
