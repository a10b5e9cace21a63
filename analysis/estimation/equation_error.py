"""Equation error: the model's equations as a regression on measured states and their time derivatives.

There is no integration: poor starting values do no harm and nothing diverges. Use it for a first look and for starting
values of output error. Its weakness is noise in the regressors, which biases the coefficients towards zero. All
signals, inputs included, therefore pass the same narrow low-pass filter: a linear model's equation holds exactly
between the filtered signals, and most of the noise is removed.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from flightpower.analysis.estimation.data import Band, Segment
from flightpower.analysis.estimation.fit import Fit
from flightpower.analysis.estimation.integration import InputRule
from flightpower.analysis.estimation.model import Model, NamedValues
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.problem import as_segments, inputs_of, measurements_of
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError


def fit_equation_error(
    model: Model, segments: Segment | Sequence[Segment], *, smoothing_s: float, inputs: InputRule = "linear"
) -> Fit:
    """Fit xdot = dynamics(x, u, p), and the outputs that are not states, at every sample of the filtered signals.

    Every state must be an output of the same name. The model of the fit is `regression_of(model)`. Its standard errors
    assume white noise; filtered noise is not white, so they are too small.

    smoothing_s : standard deviation of the Gaussian low-pass kernel [s]; its cut-off (-3 dB), 0.13/smoothing_s Hz,
    should be just above the frequencies of the motion
    inputs : between samples, see `simulation.build_simulator`. A "held" input jumps at the samples: the derivative at a
    sample is paired with the mean of the input's values before and after it, other outputs with the value after it

    Raises InputError for a state that is not measured, or a segment shorter than the filter.
    """
    segments = as_segments(segments)
    derived = [_filtered(model, segment, smoothing_s) for segment in segments]
    return fit_output_error(regression_of(model, _acting(model, inputs)), derived)


def fit_equation_error_in_band(model: Model, segments: Segment | Sequence[Segment], *, band_Hz: Band) -> Fit:
    """Fit xdot = dynamics(x, u, p), and the outputs that are not states, in the frequency domain.

    The time derivatives are those of cubic splines through the samples; the noise that differentiation amplifies lies
    above the band. All terms of the equations are evaluated in time, so that the model need not be linear. Parameters
    without effect in the band, such as a constant moment, must be fixed.

    band_Hz : lowest and highest frequency

    Raises InputError for a state that is not measured, a missing sample, or a band that the record does not resolve.
    """
    from scipy.interpolate import CubicSpline  # takes 0.2 s to import

    segments = as_segments(segments)
    derived = []
    for segment in segments:
        states, u = measurements_of(model, segment), dict(segment.u)
        z: dict[str, Array] = {}
        for name, signal in zip(model.outputs, states.T, strict=True):
            if not np.isfinite(signal).all():
                raise InputError(
                    f"segment {segment.name}: output {name} has missing samples; the frequency domain needs all of them"
                )
            if name in model.states:
                z[derivative_name(model, name)], u[name] = CubicSpline(segment.t_s, signal)(segment.t_s, 1), signal
            else:
                z[name] = signal
        derived.append(Segment(name=segment.name, t_s=segment.t_s, u=u, z=z))
    return fit_output_error(regression_of(model), derived, band_Hz=band_Hz)


def regression_of(model: Model, acting: tuple[str, ...] | None = None) -> Model:
    """The static model with the states of `model` as further inputs and their time derivatives as outputs.

    Outputs of `model` that are not states stay outputs. acting : names of the inputs in the dynamics, in the model's
    order; default: all inputs. Raises InputError for a state that is not an output.
    """
    acting = acting or model.inputs
    missing = [state for state in model.states if state not in model.outputs]
    if missing:
        raise InputError(
            f"model {model.name}: equation error needs every state measured, but {missing[0]} is not an output"
        )
    others = [i for i, output in enumerate(model.outputs) if output not in model.states]

    def outputs(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        state, values = [u[name] for name in model.states], [p[q.name] for q in model.parameters]
        y = model.evaluate_outputs(state, [u[name] for name in model.inputs], values)
        return (*model.evaluate_dynamics(state, [u[name] for name in acting], values), *(y[i] for i in others))

    return replace(
        model,
        name=f"{model.name} (equation error)",
        states=(),
        inputs=(*model.states, *dict.fromkeys((*model.inputs, *acting))),
        outputs=(*(derivative_name(model, state) for state in model.states), *(model.outputs[i] for i in others)),
        dynamics=None,
        output_function=outputs,
        initial_state=None,
    )


def derivative_name(model: Model, state: str) -> str:
    """The name of a state's time derivative in `regression_of(model)`: "pdot", unless the model has that output."""
    name = f"{state}dot"
    return f"d{state}/dt" if name in model.outputs else name


def _acting(model: Model, inputs: InputRule) -> tuple[str, ...]:
    """Names of the inputs that the regression pairs with the derivatives. Delayed inputs are interpolated, not held."""
    return tuple(map(_mean_name, model.inputs)) if inputs == "held" and not model.delays else model.inputs


def _mean_name(name: str) -> str:
    """The name of the mean of an input's values before and after the sample."""
    return f"{name} (mean)"


def _filtered(model: Model, segment: Segment, smoothing_s: float) -> Segment:
    """A segment of `regression_of(model)`; it loses half the kernel's length at each end."""
    h = segment.step_s
    half = int(np.ceil(4 * smoothing_s / h))  # 6e-5 of the Gaussian kernel's area is beyond
    if smoothing_s <= 0 or len(segment) <= 2 * half + 1:
        raise InputError(
            f"segment {segment.name}: {len(segment)} samples are too few for smoothing over {smoothing_s:g} s;"
            f" more than {2 * half + 1} are needed"
        )
    t = h * np.arange(-half, half + 1)
    smooth: Array = np.exp(-((t / smoothing_s) ** 2) / 2)
    smooth /= smooth.sum()
    slope: Array = -t * smooth
    slope /= -(slope @ t)  # exact derivative of a straight line

    def low_pass(signal: Array, kernel: Array) -> Array:
        return np.convolve(signal, kernel, mode="valid")

    u = {}
    for name, signal in zip(model.inputs, inputs_of(model, segment).T, strict=True):
        u[name] = low_pass(signal, smooth)
        u[_mean_name(name)] = low_pass((np.r_[signal[:1], signal[:-1]] + signal) / 2, smooth)
    z: dict[str, Array] = {}
    for name, signal in zip(model.outputs, measurements_of(model, segment).T, strict=True):
        if name in model.states:
            z[derivative_name(model, name)] = low_pass(signal, slope)
            u[name] = low_pass(signal, smooth)
        else:
            z[name] = low_pass(signal, smooth)
    # A missing sample affects all outputs of the kernel that include it, and an equation needs all its regressors.
    lost = np.any([~np.isfinite(signal) for signal in u.values()], axis=0)
    return Segment(
        name=segment.name,
        t_s=segment.t_s[half:-half],
        u={name: np.where(lost, 0.0, signal) for name, signal in u.items()},
        z={name: np.where(lost, np.nan, signal) for name, signal in z.items()},
    )
