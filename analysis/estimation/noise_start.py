"""Starting values of process and measurement noise, from the errors of predictions over one step."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.estimation.data import Segment
from analysis.estimation.model import Model
from analysis.estimation.problem import inputs_of, measurements_of
from analysis.estimation.process_noise import ProcessNoise
from analysis.estimation.simulation import INPUT_RULES, InputRule, rk4

Array = NDArray[np.float64]

DIFFERENCE = 1e-4  # of a state for its effect on prediction and outputs, relative to the state's rms


def noise_from_predictions(
    model: Model,
    segments: Sequence[Segment],
    noises: Sequence[ProcessNoise],
    values: Mapping[str, float],
    inputs: InputRule,
) -> dict[str, float]:
    """Starting values of ln w and ln v; every state must be measured. values : parameters by name.

    From sample k the model predicts sample k + 1. The error d of this prediction has the covariance
    V + Phi V Phi' + Q h, and that of two in succession is -V Phi', where V is the covariance of measurement noise of
    the states, Phi the transition matrix and Q h that of process noise over the step. Both together give V and Q. An
    output that is no state has the measurement noise that the noise of the states does not explain. Variances smaller
    than their own standard errors start at those.
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
            return rk4(lambda x, u: _rows(model.evaluate_dynamics(x, u, p), x), x, u, h)

        def observed(x: Array, U: Array = U) -> Array:
            return _rows(model.evaluate_outputs(x, U, p), x)

        now, y = predicted(X[:, :-1]), observed(X)
        d = X[:, 1:] - now
        errors.append(d**2)
        after.append(d[:, 1:] * d[:, :-1])
        rest.append((Z - y)[others] ** 2)
        size = DIFFERENCE * (np.sqrt(np.nanmean(X**2, axis=1)) + DIFFERENCE)
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
    found = {f"ln w({noise.state})": float(np.log(Q[model.states.index(noise.state)]) / 2) for noise in noises}
    found |= {f"ln v({model.states[i]})": float(np.log(v) / 2) for i, v in enumerate(V)}
    return found | {f"ln v({model.outputs[i]})": float(np.log(v) / 2) for i, v in zip(others, R, strict=True)}


def _rows(values: Sequence[Array], like: Array) -> Array:
    return np.array([np.broadcast_to(value, like.shape[1]) for value in values])
