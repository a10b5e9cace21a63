"""Maximum likelihood by filter error: for motion with process noise, such as flight in turbulence.

White process noise w drives some of the states, xdot = f(x, u, p) + w. An extended Kalman filter (`kalman_filter`)
computes the innovations and their variances, from which the likelihood follows. The unknowns are the parameters, the
initial states, and the logarithms of the intensities of process noise ("ln w(state)") and of the standard deviations
of measurement noise ("ln v(output)"). Gauss-Newton with the exact derivatives of the filter and the Fisher information
estimates them together. Without process noise the filter's covariance stays zero and the method is output error.

Noise that turns out to be negligible is dropped from the unknowns on the way, so that its logarithm does not run to
minus infinity. An intensity that is not significant near the optimum is tried at its lower bound. A fit that does not
end at an optimum is repeated from equation error or output error.

For colored process noise, add a state with first-order dynamics to the model and let white noise drive it.

References: Jategaonkar, Flight Vehicle System Identification, 2nd ed., ch. 5; Maine & Iliff, NASA RP-1138, sec. 8.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.fit import Finding, Fit, FitStatus, Intensity, Remark, Verdict
from flightpower.analysis.estimation.hints import innovation_hints
from flightpower.analysis.estimation.innovations import InnovationsLikelihood, not_finite
from flightpower.analysis.estimation.kalman_filter import build_filter
from flightpower.analysis.estimation.model import Model, UnknownKey, UnknownKind
from flightpower.analysis.estimation.optimizer import Evaluation, Stop, make_fit, maximize
from flightpower.analysis.estimation.problem import FitOptions, Problem, as_segments, free_names
from flightpower.analysis.estimation.process_noise import ProcessNoise as ProcessNoise
from flightpower.analysis.estimation.process_noise import (
    check_noise,
    intensity_key,
    intensity_of,
    logarithm,
    noise_from_predictions,
    noise_key,
    noise_unknowns,
)
from flightpower.analysis.estimation.settings import FILTER_ERROR, TESTS
from flightpower.analysis.estimation.starts import starting_values_by_equation_error, starting_values_by_output_error
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError

Source = Literal["equation error", "output error"]
SOURCES: tuple[Source, ...] = ("equation error", "output error")


def fit_filter_error(
    model: Model,
    segments: Segment | Sequence[Segment],
    process_noise: ProcessNoise | Sequence[ProcessNoise],
    *,
    start: Mapping[str, float] | Source | None = None,
    noise_sigma: Mapping[str, float] | None = None,
    test_significance: bool = True,
    options: FitOptions = FitOptions(),
) -> Fit:
    """Fit a model with process noise to one or several segments together.

    start : starting values as for `fit_output_error`, or the method that gives them: "equation error", for which
    every state must be measured, and which starts the noises from the errors of predictions over one step (except
    intensities with a prior), or "output error". If the fit from given values does not end at an optimum, if process
    noise explains everything there, or if innovations are not white (unless `options.second_start` is false), the two
    methods are tried in turn, with intensities 100 times smaller, until a fit has none of these faults. The best fit is
    returned.
    noise_sigma : known standard deviations of measurement noise by output; the others are estimated
    test_significance : test each free intensity against zero, at the cost of one more fit each

    The unknowns end with the noise parameters "ln w(state)" and "ln v(output)". Residuals are innovations. Responses
    are the outputs y predicted from the samples before, and the states x updated with the sample.

    The verdict names noise that is negligible, and process noise that is not significant; output error is then
    sufficient. Raises InputError like output error, and for process noise of an unknown state or two of the same state.
    """
    segments = as_segments(segments)
    noises = (process_noise,) if isinstance(process_noise, ProcessNoise) else tuple(process_noise)
    check_noise(model, noises, noise_sigma or {})
    random_start = {noise.state for noise in noises if noise.active_before_s > 0}
    initial_states = options.initial_states
    if initial_states == "free":
        initial_states = tuple(state for state in model.states if state not in random_start)
    elif random_start & set(initial_states):
        raise InputError(
            f"initial_states: {sorted(random_start)[0]} has process noise with active_before_s > 0, so that its initial"
            " value is not estimated; leave it out"
        )
    kalman_filter = build_filter(model, free_names(model), tuple(noise.state for noise in noises), options)
    fixed = {intensity_key(noise.state): logarithm(noise.start) for noise in noises if not noise.free}
    fixed |= {noise_key(output): logarithm(sigma) for output, sigma in (noise_sigma or {}).items()}
    free_noise = [unknown for unknown in noise_unknowns(model, segments, noises) if unknown.key not in fixed]

    def fitted(values: Mapping[str, float]) -> _Optimum:
        problem = Problem.assemble(model, segments, initial_states, values, free_noise)
        likelihood = InnovationsLikelihood(problem, kalman_filter, noises, fixed)
        return _optimum(likelihood, problem.start, options.max_iterations)

    def values_by(source: Source) -> dict[str, float]:
        if source == "equation error":
            return starting_values_by_equation_error(model, segments, inputs=options.inputs)
        return starting_values_by_output_error(model, segments, options=options)

    if isinstance(start, str):
        if start not in SOURCES:
            raise InputError(f"start = {start!r}: choose one of {', '.join(SOURCES)}, or give values by name")
        values = values_by(start)
        if start == "equation error":
            guess = noise_from_predictions(model, segments, noises, values, options.inputs)
            values |= {n.name: guess[n.key] for n in free_noise if n.prior_information == 0}
        optimum = fitted(values)
    else:
        small = {str(intensity_key(noise.state)): logarithm(0.01 * noise.start) for noise in noises if noise.free}
        optimum = _best(fitted, start or {}, values_by, small, second_start=options.second_start)
    fit = make_fit(optimum.likelihood, optimum.point, optimum.iterations, optimum.stop)
    fit = replace(fit, integrator=options.integrator, inputs=options.inputs)
    intensities = {noise.state: intensity_of(fit, noise, optimum.negligible) for noise in noises}
    if test_significance and fit.verdict.status in (FitStatus.CONVERGED, FitStatus.AT_BOUND):
        for key in optimum.likelihood.intensities:
            smaller, theta = optimum.likelihood.holding({key: -math.inf}, optimum.point.theta)
            without, _, stop = maximize(
                smaller, smaller.evaluate(theta), options.max_iterations, step_tolerance=FILTER_ERROR.step_tolerance
            )
            ratio = math.nan if stop.failed else max(0.0, 2 * (without.cost - optimum.point.cost))
            intensities[key.name] = intensities[key.name]._replace(p_value=math.erfc(math.sqrt(ratio / 2)) / 2)
    verdict = _verdict(fit, intensities, optimum.negligible)
    return replace(fit, verdict=verdict, process_noise=intensities)


@dataclass(frozen=True)
class _Optimum:
    """The end of a maximization. negligible : ln w and ln v that were dropped from the unknowns, with their values."""

    likelihood: InnovationsLikelihood
    point: Evaluation
    iterations: int
    stop: Stop
    negligible: dict[UnknownKey, float]


def _optimum(likelihood: InnovationsLikelihood, theta: Array, max_iterations: int) -> _Optimum:
    """Maximize from theta. Negligible noise is dropped on the way. Raises InputError if the start is not finite."""
    point = likelihood.evaluate(theta)
    if not np.isfinite(point.cost):
        raise InputError(not_finite(likelihood))
    iterations, negligible, tried = 0, dict[UnknownKey, float](), dict[UnknownKey, float]()
    lowest = dict(zip(likelihood.problem.keys, likelihood.problem.lower.tolist(), strict=True))
    while True:
        point, more, stop = maximize(
            likelihood,
            point,
            max_iterations,
            step_tolerance=FILTER_ERROR.step_tolerance,
            stop=lambda best: bool(likelihood.negligible(best) or likelihood.doubtful(best, tried)),  # noqa: B023
            secant=True,
        )
        iterations += more
        dropped = likelihood.negligible(point)
        doubtful = [] if dropped or stop.failed else likelihood.doubtful(point, tried)
        if doubtful:
            tried[doubtful[0]] = float(point.information[(likelihood.index(doubtful[0]),) * 2])
            least = _with_the_least(likelihood, point, doubtful[0])
            iterations += 1
            if least is None:
                continue
            point = least
            dropped = [*doubtful[:1], *(key for key in likelihood.negligible(point) if key != doubtful[0])]
        if not dropped or stop.failed:
            return _Optimum(likelihood, point, iterations, stop, negligible)
        fixed = {key: float(point.theta[likelihood.index(key)]) for key in dropped}
        zero = fixed | {key: -math.inf for key in dropped if key.kind is UnknownKind.PROCESS_NOISE}
        smaller, without = _holding(likelihood, zero, point)
        if not without.cost <= point.cost + FILTER_ERROR.zero_cost:
            zero = fixed
            smaller, without = _holding(likelihood, fixed, point)
        # The filter may need a minimum of noise in one state. Only a step shows for which state the data are likeliest.
        without_noise = {
            key: value for key, value in (negligible | zero).items() if key.kind is UnknownKind.PROCESS_NOISE
        }
        if any(value > -math.inf for value in without_noise.values()) and len(without_noise) > 1:
            ends = [(zero, smaller, _after_a_step(smaller, without))]
            for key in without_noise:
                only = dict.fromkeys(without_noise, -math.inf) | {key: lowest[key]}
                if only != without_noise:
                    other, start = _holding(likelihood, only, point)
                    ends.append((zero | only, other, _after_a_step(other, start)))
            zero, smaller, without = min(ends, key=lambda end: end[2].cost)
            iterations += 1
        likelihood, point, negligible = smaller, without, negligible | zero
        tried = {}  # a noise hidden by another one may show once the other is gone


def _after_a_step(likelihood: InnovationsLikelihood, point: Evaluation) -> Evaluation:
    return maximize(likelihood, point, 1, step_tolerance=FILTER_ERROR.step_tolerance)[0]


def _holding(
    likelihood: InnovationsLikelihood, values: Mapping[UnknownKey, float], point: Evaluation
) -> tuple[InnovationsLikelihood, Evaluation]:
    """The likelihood with these ln w and ln v fixed, evaluated with the other unknowns unchanged."""
    smaller, theta = likelihood.holding(values, point.theta)
    return smaller, smaller.evaluate(theta)._replace(costs=point.costs, steps=point.steps)


def _with_the_least(likelihood: InnovationsLikelihood, point: Evaluation, noise: UnknownKey) -> Evaluation | None:
    """The point with this noise at its lower bound, after one step of parameters and initial states.

    None if the likelihood there is not higher than a step with the noise is expected to reach.
    """
    keys, theta = likelihood.problem.keys, point.theta.copy()
    theta[likelihood.index(noise)] = likelihood.problem.lower[likelihood.index(noise)]
    noises = {key: float(value) for key, value in zip(keys, theta, strict=True) if key.is_noise}
    without_noises, start = likelihood.holding(noises, theta)
    moved = _after_a_step(without_noises, without_noises.evaluate(start))
    if not moved.cost < point.cost - likelihood.expected_gain(point):
        return None
    theta[[key not in noises for key in keys]] = moved.theta
    steps = (*point.steps, *(moved.steps or (0.0,)))
    return likelihood.evaluate(theta)._replace(costs=(*point.costs, point.cost), steps=steps)


def _best(
    fitted: Callable[[Mapping[str, float]], _Optimum],
    start: Mapping[str, float],
    values_by: Callable[[Source], dict[str, float]],
    small: Mapping[str, float],
    *,
    second_start: bool,
) -> _Optimum:
    """The fit from given values; if it is not convincing, the best of it and of fits started by other methods.

    small : by name, starting values of ln w for fits started by other methods
    """

    def colored(optimum: _Optimum) -> bool:
        return bool(innovation_hints(make_fit(optimum.likelihood, optimum.point, optimum.iterations, optimum.stop)))

    optima, failures = [], []
    for source in (None, *SOURCES):
        try:
            optima.append(fitted(start if source is None else {**start, **small, **values_by(source)}))
        except InputError as error:
            failures.append(error)
            continue
        explained_by_process_noise = any(key.kind is UnknownKind.MEASUREMENT_NOISE for key in optima[-1].negligible)
        if not optima[-1].stop.failed and not explained_by_process_noise and not (second_start and colored(optima[-1])):
            break
    if not optima:
        raise failures[0]
    return min(optima, key=lambda optimum: (optimum.stop.failed, optimum.point.cost))


def _verdict(fit: Fit, intensities: dict[str, Intensity], negligible: Mapping[UnknownKey, float]) -> Verdict:
    """The verdict of the fit, with remarks on noise that could be left out."""
    if fit.verdict.status is FitStatus.NOT_CONVERGED:
        return fit.verdict
    quiet = [key.name for key in negligible if key.kind is UnknownKind.MEASUREMENT_NOISE]
    stabilizing = [state for state in intensities if negligible.get(intensity_key(state), -math.inf) > -math.inf]
    level = TESTS.false_alarms
    insignificant = [state for state, intensity in intensities.items() if intensity.p_value >= level]
    remarks = (
        (Finding.NEGLIGIBLE_MEASUREMENT_NOISE, quiet,
            "measurement noise of {} is negligible compared with the"
            " process noise"),
        (Finding.NEGLIGIBLE_BUT_STABILIZING, stabilizing,
         "process noise of {} is negligible, but the filter needs it: the model is unstable"),
        (Finding.PROCESS_NOISE_NOT_SIGNIFICANT, insignificant, "process noise of {} is not significant"),
    )  # fmt: skip
    verdict = fit.verdict.with_remarks(
        *(Remark(finding, text.format(", ".join(names))) for finding, names, text in remarks if names)
    )
    return verdict._replace(hints=innovation_hints(fit))
