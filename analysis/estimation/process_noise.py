"""Process and measurement noise of filter error: what the user gives, the unknowns, and their starting values."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.fit import Fit, Intensity
from flightpower.analysis.estimation.integration import INPUT_RULES, InputRule, rk4
from flightpower.analysis.estimation.model import Model, UnknownKey, UnknownKind
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.estimation.problem import Unknown, inputs_of, measurements_of
from flightpower.analysis.estimation.settings import FILTER_ERROR
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError


@dataclass(frozen=True, kw_only=True)
class ProcessNoise:
    """White noise that drives one state.

    start : starting value of the intensity [unit of the state per sqrt(s)]; in one second the noise adds intensity^2 to
    the variance of the state. It is fixed unless `free`; a fixed intensity may be zero. The starting value may be 1000
    times too small. If it is so large that process noise explains everything, the fit is repeated with 1 % of it.
    active_before_s : time for which the noise has acted before a segment begins. If positive, the initial state is not
    estimated and has the variance intensity^2 active_before_s. For a stationary first-order state with time constant T
    this is T/2.
    prior_sigma : standard deviation of a normal prior of ln intensity with mean ln start

    Raises InputError for a negative start, a free start of zero, a negative `active_before_s`, or `prior_sigma` <= 0.
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


def check_noise(model: Model, noises: tuple[ProcessNoise, ...], noise_sigma: Mapping[str, float]) -> None:
    for noise in noises:
        if not isinstance(noise, ProcessNoise):
            raise InputError(f"process_noise: give ProcessNoise(state=..., start=...), not {noise!r}")
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


def logarithm(value: float) -> float:
    return math.log(value) if value > 0 else -math.inf


def intensity_key(state: str) -> UnknownKey:
    """Key of ln w for this state."""
    return UnknownKey(UnknownKind.PROCESS_NOISE, state)


def noise_key(output: str) -> UnknownKey:
    """Key of ln v for this output."""
    return UnknownKey(UnknownKind.MEASUREMENT_NOISE, output)


def noise_unknowns(model: Model, segments: tuple[Segment, ...], noises: tuple[ProcessNoise, ...]) -> list[Unknown]:
    """ln w and ln v with starting values: ln v from the second differences of the outputs."""
    unknowns = []
    for noise in noises:
        ln_w = logarithm(noise.start)
        lower, upper = ln_w - math.log(FILTER_ERROR.intensity_range), ln_w + math.log(FILTER_ERROR.intensity_range)
        prior = noise.prior_sigma**-2.0
        unknowns.append(
            Unknown(intensity_key(noise.state), "", ln_w, lower, upper, ln_w, prior, FILTER_ERROR.largest_step)
        )
    for output in model.outputs:
        signals = [segment.z[output] for segment in segments if output in segment.z]
        scale = math.sqrt(np.nanmean(np.square(np.concatenate(signals)))) if _any_finite(signals) else 0.0
        least, largest = FILTER_ERROR.noise_range
        lowest = least * (scale or 1.0)
        # In white noise, a sample minus the mean of its neighbors has 3/2 of the variance of a sample.
        differences = np.concatenate([z[1:-1] - (z[:-2] + z[2:]) / 2 for z in signals] or [np.array([])])
        differences = differences[np.isfinite(differences)]
        sigma = math.sqrt(np.mean(differences**2) / 1.5) if len(differences) else 0.01 * scale
        upper = logarithm(largest * max(scale, sigma, 2 * lowest))
        first = logarithm(max(sigma, 2 * lowest))
        unknowns.append(
            Unknown(noise_key(output), "", first, logarithm(lowest), upper, largest_step=FILTER_ERROR.largest_step)
        )
    return unknowns


def _any_finite(signals: list[Array]) -> bool:
    return any(np.isfinite(z).any() for z in signals)


def intensity_of(fit: Fit, noise: ProcessNoise, negligible: Mapping[UnknownKey, float]) -> Intensity:
    """The intensity in a fit. negligible : logarithms of noises that were dropped from the unknowns."""
    key = intensity_key(noise.state)
    if key in negligible:
        value = math.exp(negligible[key])
        return Intensity(value, 0.0, value, 0.5 if value == 0 else math.nan)
    if key not in fit.keys:
        return Intensity(noise.start, noise.start, noise.start, np.nan)
    estimate = fit.parameters[str(key)]
    ln_w, error = estimate.value, estimate.standard_error
    lo, hi = np.exp([ln_w - NORMAL_95 * error, ln_w + NORMAL_95 * error])
    return Intensity(math.exp(ln_w), float(lo), float(hi), np.nan)


def noise_from_predictions(
    model: Model,
    segments: Sequence[Segment],
    noises: Sequence[ProcessNoise],
    values: Mapping[str, float],
    inputs: InputRule,
) -> dict[UnknownKey, float]:
    """Starting values of ln w and ln v; every state must be measured. values : parameters by name.

    From sample k the model predicts sample k + 1. The error d of this prediction has the covariance
    V + Phi V Phi' + Q h, and two successive errors have the covariance -V Phi', where V is the covariance of the
    states' measurement noise, Phi the transition matrix and Q h the covariance of process noise over the step. Together
    they give V and Q. An output that is not a state gets the noise that the noise of the states does not explain.
    Variances smaller than their own standard errors start at those standard errors.
    """
    p = [values.get(q.name, q.start) for q in model.parameters]
    positions = [model.outputs.index(state) for state in model.states]
    others = [i for i in range(len(model.outputs)) if i not in positions]
    errors, after, Phi, C, rest = [], [], [], [], []
    for segment in segments:
        U, Z = inputs_of(model, segment).T, measurements_of(model, segment).T
        X = Z[positions]

        def predicted(x: Array, U: Array = U, h: float = segment.step_s) -> Array:
            u = INPUT_RULES[inputs](U[:, :-1], U[:, 1:])
            return np.asarray(rk4(lambda x, u: _rows(model.evaluate_dynamics(x, u, p), x), x, u, h))

        def observed(x: Array, U: Array = U) -> Array:
            return _rows(model.evaluate_outputs(x, U, p), x)

        now, y = predicted(X[:, :-1]), observed(X)
        d = X[:, 1:] - now
        errors.append(d**2)
        after.append(d[:, 1:] * d[:, :-1])
        rest.append((Z - y)[others] ** 2)
        share = 1e-4  # of a state's rms, for its effect on prediction and outputs
        size = share * (np.sqrt(np.nanmean(X**2, axis=1)) + share)
        moved = [X + np.where(np.arange(len(X)) == j, size, 0.0)[:, None] for j in range(len(X))]
        Phi.append([np.nanmean(predicted(x[:, :-1]) - now, axis=1) / size[j] for j, x in enumerate(moved)])
        C.append([np.nanmean((observed(x) - y) ** 2, axis=1)[others] / size[j] ** 2 for j, x in enumerate(moved)])
    c0, c1, r = (np.nanmean(np.concatenate(parts, axis=1), axis=1) for parts in (errors, after, rest))
    n = sum(part.shape[1] for part in errors)
    F, C_squared = np.mean(Phi, axis=0).T, np.mean(C, axis=0).T
    smallest = math.sqrt(2 / n)
    V = np.clip(-c1 / np.diag(F), smallest / 2 * c0, c0)
    Q = np.maximum(c0 - V - F**2 @ V, smallest * c0) / segments[0].step_s
    R = np.maximum(r - C_squared @ V, smallest * r)
    ln_w = {intensity_key(noise.state): float(np.log(Q[model.states.index(noise.state)]) / 2) for noise in noises}
    ln_v = {noise_key(state): float(np.log(v) / 2) for state, v in zip(model.states, V, strict=True)}
    return ln_w | ln_v | {noise_key(model.outputs[i]): float(np.log(v) / 2) for i, v in zip(others, R, strict=True)}


def _rows(values: Sequence[Array], like: Array) -> Array:
    return np.array([np.broadcast_to(value, like.shape[1]) for value in values])
