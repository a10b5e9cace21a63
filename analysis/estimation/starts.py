"""Starting values from the data, and the best of fits from several starts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.equation_error import fit_equation_error
from flightpower.analysis.estimation.fit import Finding, Fit, FitStatus, Remark
from flightpower.analysis.estimation.integration import InputRule
from flightpower.analysis.estimation.model import Model
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.problem import FitOptions, as_segments
from flightpower.analysis.estimation.settings import VERDICT
from flightpower.flight.errors import InputError


def starting_values_by_equation_error(
    model: Model,
    segments: Segment | Sequence[Segment],
    *,
    smoothing_s: float | None = None,
    inputs: InputRule = "linear",
) -> dict[str, float]:
    """Starting values of the shared free parameters, by equation error. See `fit_equation_error` for errors.

    smoothing_s : width of its low-pass filter; default: 1.5 samples, which is enough where the noise is light
    """
    segments = as_segments(segments)
    if smoothing_s is None:
        smoothing_s = 1.5 * segments[0].step_s
    return _shared_values(fit_equation_error(model, segments, smoothing_s=smoothing_s, inputs=inputs), model)


def starting_values_by_output_error(
    model: Model, segments: Segment | Sequence[Segment], *, options: FitOptions = FitOptions()
) -> dict[str, float]:
    """Starting values of the shared free parameters, by output error. See `fit_output_error` for errors."""
    options = FitOptions(integrator=options.integrator, inputs=options.inputs)
    return _shared_values(fit_output_error(model, segments, options=options), model)


def _shared_values(fit: Fit, model: Model) -> dict[str, float]:
    return {q.name: fit.parameters[q.name].value for q in model.parameters if q.free and q.shared}


def best_of_starts(
    fit: Callable[[Mapping[str, float]], Fit],
    model: Model,
    *,
    starts: int = 8,
    factor: float = 2.0,
    seed: int = 0,
    more_starts: Sequence[Mapping[str, float]] = (),
) -> Fit:
    """The best of several fits of a model from different starting values.

    fit : makes a fit from starting values: `lambda start: fit_output_error(model, run, start=start)`
    starts : number of starts. The first has the model's values; in the others each free parameter is multiplied by
    `factor` to a random power between -1 and 1, within its bounds. A value that starts at zero stays there.
    more_starts : further starting points, such as from `starting_values_by_equation_error`

    The verdict says from how many starts the best fit was reached. Raises the InputError of `fit` if no start gives a
    finite response.
    """
    rng = np.random.default_rng(seed)
    free = {q.name: q.start for q in model.parameters if q.free}
    tried: list[Mapping[str, float]] = [{}]
    tried += [{name: value * factor ** rng.uniform(-1, 1) for name, value in free.items()} for _ in range(starts - 1)]
    tried += more_starts
    fits, failures = [], []
    for start in tried:
        try:
            fits.append(fit(start))
        except InputError as error:
            failures.append(error)
    if not fits:
        raise failures[-1]
    usable = [fit for fit in fits if fit.verdict.status is not FitStatus.NOT_CONVERGED] or fits
    best = min(usable, key=lambda fit: fit.negative_log_likelihood)
    costs = np.array([fit.negative_log_likelihood for fit in usable])
    reached = int((costs < best.negative_log_likelihood + VERDICT.same_optimum).sum())
    remarks = [Remark(Finding.REACHED_FROM_STARTS, f"reached from {reached} of {len(tried)} starts")]
    if len(usable) > reached:
        remarks.append(Remark(Finding.WORSE_OPTIMA, f"{len(usable) - reached} ended at worse optima"))
    if len(tried) > len(usable):
        remarks.append(Remark(Finding.STARTS_NOT_CONVERGED, f"{len(tried) - len(usable)} did not converge"))
    return replace(best, verdict=best.verdict.with_remarks(*remarks))
