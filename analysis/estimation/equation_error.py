"""Equation error: the same model functions as a regression on measured states and their derivatives.

No integration, so no starting values to speak of and no divergence: good for a first look, and for a start of output
error. Errors of the regressors are what this method suffers from: noise in a measured state pulls its coefficient
towards zero. They are taken care of by passing every signal, inputs included, through the same narrow low-pass, so that
a linear model's equation holds exactly between the filtered signals while most of the noise is gone.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.estimation import output_error
from analysis.estimation.data import Segment
from analysis.estimation.model import Model, Named
from analysis.estimation.problem import inputs_of, measurements_of
from flight.errors import InputError

Array = NDArray[np.float64]

REACH = 4.0  # half length of the kernel in its standard deviations; beyond it are 6e-5 of the area


def estimate(model: Model, segments: Segment | Sequence[Segment], *, smoothing_s: float) -> output_error.Fit:
    """Fit xdot = dynamics(x, u, p), and the outputs that are no states, at every sample, to filtered signals.

    Every state must be an output of that name. smoothing_s : standard deviation in time of the Gaussian low-pass; its
    cut-off (-3 dB), 0.13/smoothing_s Hz, should lie just above the motion's own frequencies.
    The fit is one of `regression_of(model)`; its standard errors take the filtered noise for white, and are too small.

    Raises InputError for a state that is not measured, or a segment shorter than the filter.
    """
    segments = (segments,) if isinstance(segments, Segment) else tuple(segments)
    return output_error.estimate(regression_of(model), [_filtered(model, s, smoothing_s) for s in segments])


def regression_of(model: Model) -> Model:
    """The static model whose inputs are those of `model` and its states, its outputs the states' derivatives too."""
    missing = [state for state in model.states if state not in model.outputs]
    if missing:
        raise InputError(f"model {model.name}: equation error needs every state measured; {missing[0]} is no output")
    others = [i for i, output in enumerate(model.outputs) if output not in model.states]

    def outputs(x: Named, u: Named, p: Named) -> tuple[Any, ...]:
        state, inputs = [u[name] for name in model.states], [u[name] for name in model.inputs]
        values = [p[q.name] for q in model.parameters]
        y = model.evaluate_outputs(state, inputs, values)
        return (*model.evaluate_dynamics(state, inputs, values), *(y[i] for i in others))

    return replace(
        model,
        name=f"{model.name} (equation error)",
        states=(),
        inputs=(*model.states, *model.inputs),
        outputs=(*(f"{state}dot" for state in model.states), *(model.outputs[i] for i in others)),
        dynamics=None,
        output_function=outputs,
        initial_state=None,
    )


def _filtered(model: Model, segment: Segment, smoothing_s: float) -> Segment:
    h = segment.step_s
    reach = int(np.ceil(REACH * smoothing_s / h))
    if smoothing_s <= 0 or len(segment) <= 2 * reach + 1:
        raise InputError(
            f"segment {segment.name}: {len(segment)} samples are too few for smoothing over {smoothing_s:g} s;"
            f" more than {2 * reach + 1} are needed"
        )
    t = h * np.arange(-reach, reach + 1)
    smooth: Array = np.exp(-((t / smoothing_s) ** 2) / 2)
    smooth /= smooth.sum()
    slope: Array = -t * smooth
    slope /= -(slope @ t)  # exact on a straight line

    def low_pass(signal: Array, kernel: Array) -> Array:
        return np.convolve(signal, kernel, mode="valid")

    u = {name: low_pass(signal, smooth) for name, signal in zip(model.inputs, inputs_of(model, segment).T, strict=True)}
    z: dict[str, Array] = {}
    for name, signal in zip(model.outputs, measurements_of(model, segment).T, strict=True):
        if name in model.states:
            z[f"{name}dot"] = low_pass(signal, slope)
            u[name] = low_pass(signal, smooth)
        else:
            z[name] = low_pass(signal, smooth)
    # A missing sample is missing from everything its kernel reaches, and an equation needs all its regressors.
    lost = np.any([~np.isfinite(signal) for signal in u.values()], axis=0)
    return Segment(
        name=segment.name,
        t_s=segment.t_s[reach:-reach],
        u={name: np.where(lost, 0.0, signal) for name, signal in u.items()},
        z={name: np.where(lost, np.nan, signal) for name, signal in z.items()},
    )
