"""Validation: how well a fit predicts data that it was not fitted to, with all parameters held.

References: Jategaonkar, Flight Vehicle System Identification, 2nd ed., ch. 11; Theil, Economic Forecasts and Policy,
1961, sec. 2.5.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.fit import Fit
from flightpower.analysis.estimation.output_error import MeasurementNoise, fit_output_error
from flightpower.analysis.estimation.problem import FitOptions, initial_state_of, inputs_of, measurements_of
from flightpower.analysis.estimation.simulation import build_simulator
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError


class Agreement(NamedTuple):
    """Agreement of a predicted output with the measured one.

    rms : of the difference, in the unit of the output
    R2 : 1 - (sum of squared differences)/(sum of squared deviations of the measurement from its mean); below zero the
    mean is the better prediction
    theil : Theil's inequality coefficient, 0 (equal) to 1; below 0.3 the agreement is usually called good
    bias, variance, covariance : fractions of the mean squared difference, 1 in total: due to different means, due to
    different standard deviations, and the rest. For a good model the rest is largest.
    """

    rms: float
    R2: float
    theil: float
    bias: float
    variance: float
    covariance: float


@dataclass(frozen=True)
class Prediction:
    """y : (n, outputs) predicted     residuals : (n, outputs) z - y, NaN where missing     agreement : by output."""

    segment: Segment
    y: Array
    residuals: Array
    agreement: dict[str, Agreement]


def predict(fit: Fit, segment: Segment) -> Prediction:
    """The response of the fitted model to the segment's inputs, compared with its outputs.

    The parameters are held. The initial state is `Segment.x0` if it names all states, otherwise it is estimated from
    the segment: a wrong initial state would be taken for an error of the model. Process noise in the fit does not
    enter the response.

    Raises InputError for a parameter with `shared=False`, which has no value in another segment, and like
    `fit_output_error` for data that cannot be used.
    """
    own = [q.name for q in fit.model.parameters if q.free and not q.shared]
    if own:
        raise InputError(f"segment {segment.name}: {own[0]} has a value in each segment only (shared=False); fix it")
    fixed_model = fit.model.changed(
        **{q.name: {"start": fit.parameters[q.name].value, "free": False} for q in fit.model.parameters}
    )
    if set(fixed_model.states) <= set(segment.x0):
        p = np.array([q.start for q in fixed_model.parameters])
        simulator = build_simulator(fixed_model, (), fit.integrator, fit.inputs)
        y = simulator.run(initial_state_of(fixed_model, segment), inputs_of(fixed_model, segment), p, segment.step_s).y
    else:
        noise = MeasurementNoise(covariance=fit.noise_covariance)
        options = FitOptions(integrator=fit.integrator, inputs=fit.inputs)
        y = fit_output_error(fixed_model, segment, noise=noise, options=options).responses[segment.name].y
    z = measurements_of(fixed_model, segment)
    return Prediction(
        segment, y, z - y, {name: agreement(z[:, i], y[:, i]) for i, name in enumerate(fixed_model.outputs)}
    )


def agreement(measured: Array, predicted: Array) -> Agreement:
    """Agreement of two signals (n,) without missing samples (NaN); NaN if nothing was measured."""
    present = np.isfinite(measured)
    if not present.any():
        return Agreement(*[float("nan")] * 6)
    z, y = measured[present], predicted[present]
    mse = float(np.mean((z - y) ** 2))
    size = float(np.sqrt(np.mean(z**2)) + np.sqrt(np.mean(y**2)))
    of_means, of_deviations = float((z.mean() - y.mean()) ** 2), float((z.std() - y.std()) ** 2)
    variance = float(z.var())
    return Agreement(
        rms=float(np.sqrt(mse)),
        R2=1 - mse / variance if variance else float("nan"),
        theil=float(np.sqrt(mse)) / size if size else 0.0,
        bias=of_means / mse if mse else 0.0,
        variance=of_deviations / mse if mse else 0.0,
        covariance=1 - (of_means + of_deviations) / mse if mse else 0.0,
    )


def cross_validate(segments: Sequence[Segment], estimate: Callable[[Sequence[Segment]], Fit]) -> dict[str, Prediction]:
    """Each segment predicted by the fit to all others, by name.

    estimate : makes the fit, for example `lambda rest: fit_output_error(model, rest)`

    Raises InputError for fewer than two segments.
    """
    if len(segments) < 2:
        raise InputError(f"cross-validation needs at least two segments, there are {len(segments)}")
    return {
        left_out.name: predict(estimate([s for s in segments if s is not left_out]), left_out) for left_out in segments
    }
