"""Maximum likelihood by filter error: for motion with process noise, such as flight in turbulence.

White process noise w drives some of the states, xdot = f(x, u, p) + w. An extended Kalman filter (`kalman_filter`)
computes the innovations and their variances, from which the likelihood follows. The unknowns are the parameters, the
initial states, and the logarithms of the intensities of process noise ("ln w(state)") and of the standard deviations
of measurement noise ("ln v(output)"). Gauss-Newton with the exact derivatives of the filter and the Fisher information
estimates them together. Without process noise the filter's covariance stays zero and the method is output error.

For colored process noise, add a state with first-order dynamics to the model and let white noise drive it.

References: Jategaonkar, Flight Vehicle System Identification, 2nd ed., ch. 5; Maine & Iliff, NASA RP-1138, sec. 8.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.estimation.data import Segment
from analysis.estimation.fit import Fit, FitStatus, SegmentFit, Verdict
from analysis.estimation.intervals import NORMAL_95
from analysis.estimation.kalman_filter import Innovations, KalmanFilter, build_filter
from analysis.estimation.model import Model
from analysis.estimation.noise import SMALLEST_NOISE, Whitened
from analysis.estimation.optimizer import Evaluation, make_fit, maximize
from analysis.estimation.problem import Problem, Unknown, free_names
from analysis.estimation.simulation import InputRule, Integrator, Response
from flight.errors import InputError

Array = NDArray[np.float64]

LN_INTENSITY_RANGE = math.log(1e3)  # bounds of ln w about its start; an intensity at the lower bound counts as zero
# In standard errors. With noise parameters among the unknowns convergence is linear: a factor of 3 to 4 per step.
STEP_TOLERANCE = 1e-3
SIGNIFICANCE_LEVEL = 0.05  # of the test for process noise


@dataclass(frozen=True, kw_only=True)
class ProcessNoise:
    """White noise that drives one state.

    start : starting value of the intensity [unit of the state per sqrt(s)]; in one second the noise adds intensity^2 to
    the variance of the state. Fixed unless `free`; a fixed intensity may be zero. The starting value may be 1000 times
    too small. From 10 times too large on, the fit may end at a local optimum where process noise explains everything
    and "ln v" is at its lower bound; the verdict then says so. In doubt start with a small value.
    active_before_s : time for which the noise has acted before a segment begins. If positive, the initial state is not
    estimated and has the variance intensity^2 active_before_s. For a stationary first-order state with time constant T
    this is T/2.
    prior_sigma : standard deviation of a normal prior of ln intensity with mean ln start

    Raises InputError for a start that is negative or zero, a negative `active_before_s`, or a `prior_sigma` <= 0.
    """

    state: str
    start: float
    free: bool = True
    active_before_s: float = 0.0
    prior_sigma: float = math.inf

    def __post_init__(self) -> None:
        if not (math.isfinite(self.start) and self.start >= 0 and (self.start > 0 or not self.free)):
            raise InputError(f"process noise of {self.state}: start must be greater than zero, is {self.start}")
        if not (math.isfinite(self.active_before_s) and self.active_before_s >= 0):
            raise InputError(
                f"process noise of {self.state}: active_before_s must not be negative, is {self.active_before_s}"
            )
        if not self.prior_sigma > 0:
            raise InputError(
                f"process noise of {self.state}: prior_sigma must be greater than zero, is {self.prior_sigma}"
            )


class Intensity(NamedTuple):
    """An intensity of process noise [unit of the state per sqrt(s)], its 95 % interval, and its significance.

    p_value : of the likelihood-ratio test against zero intensity. Zero is at the boundary of the parameter space, so
    that the estimate is zero in half of all records without this noise (Self & Liang 1987, J. Am. Stat. Assoc. 82,
    605, case 5). NaN if not tested or fixed.
    """

    value: float
    lo: float
    hi: float
    p_value: float

    @property
    def significant(self) -> bool:
        return self.p_value < SIGNIFICANCE_LEVEL


@dataclass(frozen=True, kw_only=True)
class FilterFit(Fit):
    """The result of `estimate`.

    `names` ends with the noise parameters "ln w(state)" and "ln v(output)". Residuals are innovations. Responses are
    the outputs y predicted from the samples before, and the states x updated with the sample.
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
    test_significance: bool = True,
) -> FilterFit:
    """Fit a model with process noise to one or several segments together.

    noise_sigma : known standard deviations of measurement noise by output; the others are estimated
    test_significance : test each free intensity against zero, at the cost of one more fit each
    For the other arguments see `output_error.estimate`.

    The verdict names process noise that is not significant; output error is then sufficient. Raises InputError like
    output error, and for process noise of an unknown state or two of the same state.
    """
    segments = (segments,) if isinstance(segments, Segment) else tuple(segments)
    noises = (process_noise,) if isinstance(process_noise, ProcessNoise) else tuple(process_noise)
    _check(model, noises, noise_sigma or {})
    random_start = {noise.state for noise in noises if noise.active_before_s > 0}
    if initial_states == "free":
        initial_states = tuple(state for state in model.states if state not in random_start)
    elif random_start & set(initial_states):
        raise InputError(
            f"initial_states: {sorted(random_start)[0]} has process noise with active_before_s > 0, so that its initial"
            " value is not estimated; leave it out"
        )
    kalman_filter = build_filter(model, free_names(model), tuple(noise.state for noise in noises), integrator, inputs)

    fixed = {f"ln w({noise.state})": _log(noise.start) for noise in noises if not noise.free}
    fixed |= {f"ln v({output})": _log(sigma) for output, sigma in (noise_sigma or {}).items()}
    free_noise = [unknown for unknown in _noise_unknowns(model, segments, noises) if unknown.name not in fixed]
    problem = Problem.assemble(model, segments, initial_states, start or {}, free_noise)
    likelihood = _InnovationsLikelihood(problem, kalman_filter, noises, fixed)
    point = likelihood.evaluate(problem.start)
    if not np.isfinite(point.cost):
        raise InputError(_not_finite(likelihood))
    point, iterations, why_stopped = maximize(likelihood, point, max_iterations, STEP_TOLERANCE)
    zero = [name for name in likelihood.intensities if point.theta[likelihood.index(name)] <= likelihood.lowest(name)]
    if zero and not why_stopped:
        likelihood, theta = likelihood.without(zero, point.theta)
        point, more, why_stopped = maximize(likelihood, likelihood.evaluate(theta), max_iterations, STEP_TOLERANCE)
        iterations += more
    fit = replace(make_fit(likelihood, point, iterations, why_stopped), integrator=integrator, inputs=inputs)
    intensities = {noise.state: _intensity(fit, noise, set(zero)) for noise in noises}
    if test_significance and fit.verdict.status in (FitStatus.CONVERGED, FitStatus.AT_BOUND):
        for name in likelihood.intensities:
            smaller, theta = likelihood.without([name], point.theta)
            without, _, failed = maximize(smaller, smaller.evaluate(theta), max_iterations, STEP_TOLERANCE)
            ratio = math.nan if failed else max(0.0, 2 * (without.cost - point.cost))
            state = name.removeprefix("ln w(").removesuffix(")")
            intensities[state] = intensities[state]._replace(p_value=math.erfc(math.sqrt(ratio / 2)) / 2)
    return FilterFit(**(vars(fit) | {"verdict": _verdict(fit, intensities)}), process_noise=intensities)


def _check(model: Model, noises: tuple[ProcessNoise, ...], noise_sigma: Mapping[str, float]) -> None:
    for state, count in Counter(noise.state for noise in noises).items():
        if state not in model.states:
            raise InputError(
                f"process noise: model {model.name} has no state {state!r}; it has {', '.join(model.states) or 'none'}"
            )
        if count > 1:
            raise InputError(f"process noise: two are given for {state}; give one")
    for output, sigma in noise_sigma.items():
        if output not in model.outputs:
            raise InputError(
                f"noise_sigma: model {model.name} has no output {output!r}; it has {', '.join(model.outputs)}"
            )
        if not (math.isfinite(sigma) and sigma > 0):
            raise InputError(f"noise_sigma: {output} must be greater than zero, is {sigma}")


def _log(value: float) -> float:
    return math.log(value) if value > 0 else -math.inf


def _noise_unknowns(model: Model, segments: tuple[Segment, ...], noises: tuple[ProcessNoise, ...]) -> list[Unknown]:
    """ln w and ln v with starting values: ln v from the second differences of the outputs."""
    unknowns = []
    for noise in noises:
        ln_w = _log(noise.start)
        lower, upper = ln_w - LN_INTENSITY_RANGE, ln_w + LN_INTENSITY_RANGE
        unknowns.append(Unknown(f"ln w({noise.state})", "", ln_w, lower, upper, ln_w, noise.prior_sigma**-2.0))
    for output in model.outputs:
        signals = [segment.z[output] for segment in segments if output in segment.z]
        scale = math.sqrt(np.nanmean(np.square(np.concatenate(signals)))) if _any_finite(signals) else 0.0
        lowest = SMALLEST_NOISE * (scale or 1.0)
        # A sample minus the mean of its neighbors has 3/2 of the variance of white noise.
        differences = np.concatenate([z[1:-1] - (z[:-2] + z[2:]) / 2 for z in signals] or [np.array([])])
        differences = differences[np.isfinite(differences)]
        sigma = math.sqrt(np.mean(differences**2) / 1.5) if len(differences) else 0.01 * scale
        unknowns.append(Unknown(f"ln v({output})", "", _log(max(sigma, 2 * lowest)), _log(lowest)))
    return unknowns


def _any_finite(signals: list[Array]) -> bool:
    return any(np.isfinite(z).any() for z in signals)


@dataclass(frozen=True)
class _InnovationsLikelihood:
    """Of the innovations. fixed : ln w and ln v that are not among the unknowns, by name."""

    problem: Problem
    filter: KalmanFilter
    noises: tuple[ProcessNoise, ...]
    fixed: dict[str, float]

    @property
    def intensities(self) -> list[str]:
        """Names of the free intensities."""
        return [name for name in self.problem.names if name.startswith("ln w(")]

    def index(self, name: str) -> int:
        return self.problem.names.index(name)

    def lowest(self, name: str) -> float:
        return float(self.problem.lower[self.index(name)])

    def without(self, removed: Sequence[str], theta: Array) -> tuple["_InnovationsLikelihood", Array]:
        """The likelihood with these intensities fixed at zero, and theta without them."""
        problem = self.problem
        keep = np.array([name not in removed for name in problem.names])
        new_index = np.cumsum(keep) - 1
        smaller = replace(
            problem,
            names=tuple(name for name in problem.names if name not in removed),
            units=tuple(unit for unit, kept in zip(problem.units, keep, strict=True) if kept),
            start=problem.start[keep],
            lower=problem.lower[keep],
            upper=problem.upper[keep],
            prior_mean=problem.prior_mean[keep],
            prior_information=problem.prior_information[keep],
            columns=[new_index[columns[keep[columns]]] for columns in problem.columns],
        )
        return replace(self, problem=smaller, fixed=self.fixed | dict.fromkeys(removed, -math.inf)), theta[keep]

    def filtered(self, theta: Array, i: int) -> tuple[Innovations, Array]:
        """Segment i's innovations, with derivatives to the unknowns of this segment only; and ln v (outputs,)."""
        problem = self.problem
        p, x0, free_noise = problem.unpack(theta, i)
        all_names = [f"ln w({noise.state})" for noise in self.noises]
        all_names += [f"ln v({output})" for output in problem.model.outputs]
        free = [k for k, name in enumerate(all_names) if name not in self.fixed]
        ln_noise = np.array([self.fixed.get(name, np.nan) for name in all_names])
        ln_noise[free] = free_noise
        ln_w, ln_v = np.split(ln_noise, [len(self.noises)])
        active_before_s = np.array([noise.active_before_s for noise in self.noises])
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            innovations = self.filter.run(
                x0, problem.U[i], problem.Z[i], p, ln_w, ln_v, active_before_s, problem.segments[i].step_s
            )
        count = len(self.filter.free)
        own = np.concatenate(
            [np.arange(count), count + len(all_names) + problem.free_states, count + np.array(free, dtype=int)]
        )
        return innovations._replace(d_e=innovations.d_e[:, :, own], d_ln_s=innovations.d_ln_s[:, :, own]), ln_v

    def curvature(self, point: Evaluation) -> Array:
        return point.information

    def evaluate(self, theta: Array) -> Evaluation:
        problem, m = self.problem, len(theta)
        g, H, of_variances, cost = np.zeros(m), np.zeros((m, m)), np.zeros((m, m)), 0.0
        segment_fits = []
        for i, segment in enumerate(problem.segments):
            innovations, ln_v = self.filtered(theta, i)
            present = np.isfinite(problem.Z[i])
            if not (_finite(innovations, present) and np.isfinite(innovations.x).all()):
                return Evaluation(theta, np.inf, (), np.zeros((0, 0)), np.zeros(m), np.zeros((m, m)))
            own = problem.columns[i]
            sigma = np.where(present, np.exp(innovations.ln_s / 2), 1.0)
            e = np.where(present, innovations.e / sigma, 0.0)
            S = np.where(present[:, :, None], -innovations.d_e / sigma[:, :, None], 0.0)
            d_ln_s = np.where(present[:, :, None], innovations.d_ln_s, 0.0).reshape(-1, len(own))
            flat = S.reshape(-1, len(own))
            cost += float(np.sum(e**2) + np.sum(innovations.ln_s[present])) / 2
            g[own] += flat.T @ e.ravel() + d_ln_s.T @ (e.ravel() ** 2 - 1) / 2
            # A normal variable with mean mu and variance s has the information mu'^2/s + (ln s)'^2/2.
            variance_part = d_ln_s.T @ d_ln_s / 2
            H[np.ix_(own, own)] += flat.T @ flat + variance_part
            of_variances[np.ix_(own, own)] += variance_part
            residuals = np.where(present, innovations.e, np.nan)
            white = Whitened(e, np.ones_like(e), S, present)
            response = Response(innovations.x, innovations.y, -innovations.d_e)
            segment_fits.append(SegmentFit(segment, response, residuals, white, own))
        from_prior = theta - problem.prior_mean
        cost += float(problem.prior_information @ from_prior**2) / 2
        g -= problem.prior_information * from_prior
        return Evaluation(theta, cost, tuple(segment_fits), np.diag(np.exp(2 * ln_v)), g, H, of_variances)


def _finite(found: Innovations, present: NDArray[np.bool_]) -> bool:
    return all(np.isfinite(values[present]).all() for values in (found.e, found.ln_s, found.d_e, found.d_ln_s))


def _not_finite(likelihood: _InnovationsLikelihood) -> str:
    """The message that names the segment and time from which the filter is not finite with the starting values."""
    problem = likelihood.problem
    for i, segment in enumerate(problem.segments):
        x = likelihood.filtered(problem.start, i)[0].x
        finite = np.isfinite(x).all(axis=1)
        if not finite.all():
            return (
                f"model {problem.model.name}, segment {segment.name}: with the starting values the filter is not finite"
                f" from t = {segment.t_s[int(np.argmin(finite))]:g} s on; give better starting values"
            )
    return (
        f"model {problem.model.name}: with the starting values the likelihood is not finite;"
        " give better starting values"
    )


def _intensity(fit: Fit, noise: ProcessNoise, zero: set[str]) -> Intensity:
    name = f"ln w({noise.state})"
    if name in zero:
        return Intensity(0.0, 0.0, 0.0, 0.5)
    if name not in fit.names:
        return Intensity(noise.start, noise.start, noise.start, np.nan)
    ln_w, error = fit.parameters[name].value, fit.parameters[name].standard_error
    lo, hi = np.exp([ln_w - NORMAL_95 * error, ln_w + NORMAL_95 * error])
    return Intensity(math.exp(ln_w), float(lo), float(hi), np.nan)


def _verdict(fit: Fit, intensities: dict[str, Intensity]) -> Verdict:
    insignificant = [state for state, intensity in intensities.items() if intensity.p_value >= SIGNIFICANCE_LEVEL]
    if not insignificant or fit.verdict.status is FitStatus.NOT_CONVERGED:
        return fit.verdict
    text = f"{fit.verdict.text}; process noise of {', '.join(insignificant)} is not significant"
    return Verdict(fit.verdict.status, text)
