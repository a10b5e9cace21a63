"""Output error from several starting values: whether another optimum is better than the one first found."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from analysis.estimation import equation_error, output_error
from analysis.estimation.data import Segment
from analysis.estimation.fit import Fit, FitStatus
from analysis.estimation.model import Model
from analysis.estimation.simulation import InputRule, Integrator
from flight.errors import InputError

SMOOTHING_SAMPLES = 1.5
SAME_OPTIMUM = 0.01  # difference in log-likelihood below which two fits are the same; 2 is significant at 5 %


def from_equation_error(
    model: Model,
    segments: Segment | Sequence[Segment],
    *,
    smoothing_s: float | None = None,
    inputs: InputRule = "linear",
) -> dict[str, float]:
    """Starting values of the shared free parameters, by equation error. See `equation_error.estimate` for errors.

    smoothing_s : of its low-pass filter; default: 1.5 samples, which is enough where the noise is light
    """
    if smoothing_s is None:
        first = segments if isinstance(segments, Segment) else segments[0]
        smoothing_s = SMOOTHING_SAMPLES * first.step_s
    return _shared_values(equation_error.estimate(model, segments, smoothing_s=smoothing_s, inputs=inputs), model)


def from_output_error(
    model: Model, segments: Segment | Sequence[Segment], *, integrator: Integrator = "rk4", inputs: InputRule = "linear"
) -> dict[str, float]:
    """Starting values of the shared free parameters, by output error. See `output_error.estimate` for errors."""
    return _shared_values(output_error.estimate(model, segments, integrator=integrator, inputs=inputs), model)


def _shared_values(fit: Fit, model: Model) -> dict[str, float]:
    return {q.name: fit.parameters[q.name].value for q in model.parameters if q.free and q.shared}


def estimate(
    model: Model,
    segments: Segment | Sequence[Segment],
    *,
    starts: int = 8,
    factor: float = 2.0,
    seed: int = 0,
    smoothing_s: float | None = None,
    **options: Any,
) -> Fit:
    """The best of several output-error fits.

    The first starts from the model's values, or from `options["start"]`; the others from these, each free parameter
    multiplied by `factor` to a random power between -1 and 1, within its bounds. One that starts at zero stays.
    smoothing_s : if given, one more start from equation error with this low-pass filter
    options : of `output_error.estimate`

    The verdict says from how many starts the best fit was reached. Raises InputError like `output_error.estimate` if
    no start gives a finite response.
    """
    rng = np.random.default_rng(seed)
    given = dict(options.pop("start", None) or {})
    free = {q.name: given.get(q.name, q.start) for q in model.parameters if q.free}
    tried = [given]
    tried += [
        given | {name: value * factor ** rng.uniform(-1, 1) for name, value in free.items()} for _ in range(starts - 1)
    ]
    if smoothing_s is not None:
        inputs = options.get("inputs", "linear")
        tried.append(given | from_equation_error(model, segments, smoothing_s=smoothing_s, inputs=inputs))
    fits, failure = [], None
    for start in tried:
        try:
            fits.append(output_error.estimate(model, segments, start=start, **options))
        except InputError as error:
            failure = error
    if not fits and failure is not None:
        raise failure
    usable = [fit for fit in fits if fit.verdict.status is not FitStatus.NOT_CONVERGED] or fits
    best = min(usable, key=lambda fit: fit.negative_log_likelihood)
    costs = np.array([fit.negative_log_likelihood for fit in usable])
    reached = int((costs < best.negative_log_likelihood + SAME_OPTIMUM).sum())
    text = f"{best.verdict.text}; reached from {reached} of {len(tried)} starts"
    others = len(usable) - reached
    if others:
        text += f", {others} ended at worse optima"
    if len(usable) < len(tried):
        text += f", {len(tried) - len(usable)} did not converge"
    return replace(best, verdict=best.verdict._replace(text=text))
