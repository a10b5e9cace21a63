"""What the estimators find in simulated records, in good ones and in those that must not be used."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "analysis" / "estimation"))
import disturbed
import hard_cases
import twins

from flightpower.analysis.estimation import uncertainty as errors
from flightpower.analysis.estimation.data import band_matrix, split
from flightpower.analysis.estimation.equation_error import fit_equation_error, fit_equation_error_in_band
from flightpower.analysis.estimation.filter_error import fit_filter_error
from flightpower.analysis.estimation.fit import Fit
from flightpower.analysis.estimation.model import Parameter
from flightpower.analysis.estimation.output_error import MeasurementNoise, fit_output_error
from flightpower.analysis.estimation.problem import FitOptions
from flightpower.analysis.estimation.starts import best_of_starts
from flightpower.analysis.estimation.term_selection import orthogonal_functions, stepwise
from flightpower.analysis.estimation.validation import cross_validate, predict
from flightpower.analysis.methods import aircraft_models
from tests.analysis.estimation.models import longitudinal, pitch_and_height
from tests.analysis.methods.test_aircraft_models import (
    ALL_MODELS,
    BENCH_NOISE,
    NEXSTAR,
    fly,
    hold_height,
    measured,
    three_two_one_one,
)

Contents = dict[str, Any]
BAND_HZ = (0.15, 2.5)
LATE = replace(
    disturbed.LINEAR,
    parameters=(*disturbed.LINEAR.parameters, Parameter(name="tau", start=0.02, unit="s", lower=0.0, upper=0.5)),
    delays=(("de", "tau"),),
)


def of_fit(fit: Fit) -> Contents:
    return {
        "summary": fit.summary(),
        "costs": fit.costs,
        "information": fit.information,
        "prior": fit.prior_information,
        "variances": fit.variance_information,
        "residuals": list(fit.residuals.values()),
        "intensities": getattr(fit, "process_noise", {}),
    }


def hard() -> Contents:
    """The hard cases without the unstable one, whose iterations depend on rounding."""
    return {name: of_fit(case.fit(1)) for name, case in hard_cases.CASES.items() if name != "an unstable aircraft"}


def fits() -> Contents:
    """Fits by every method, to records of which two have turbulence."""
    still, rough = disturbed.linear_record(1, 0.0), disturbed.linear_record(2)
    start = {name: value * 1.3 for name, value in disturbed.LINEAR_TRUTH.items()}
    unbiased = disturbed.LINEAR.changed(Z0={"free": False}, M0={"free": False})
    plain = fit_output_error(disturbed.LINEAR, still, start=start)
    tailed = fit_output_error(disturbed.LINEAR, still, noise=MeasurementNoise(tail_dof=4.0))
    filtered = fit_filter_error(disturbed.LINEAR, rough, disturbed.LINEAR_NOISE)
    spring = fit_filter_error(disturbed.NONLINEAR, disturbed.nonlinear_record(3), disturbed.NONLINEAR_NOISE)
    parts = [disturbed.linear_record(seed, 0.0, f"run {seed}") for seed in (4, 5, 6)]
    from_start = lambda start: fit_output_error(disturbed.LINEAR, still, start=start)  # noqa: E731
    contents: Contents = {
        "output error": of_fit(plain),
        "with tails": of_fit(tailed),
        "in a band": of_fit(fit_output_error(unbiased, still, band_Hz=BAND_HZ)),
        "filter error": of_fit(filtered),
        "a hardening spring": of_fit(spring),
        **{
            f"by {rule}": of_fit(fit_output_error(disturbed.LINEAR, still, options=FitOptions(integrator=rule)))
            for rule in ("euler", "heun", "trapezoidal")
        },
        "with a delay": of_fit(fit_output_error(LATE, still)),
        "from equation error": of_fit(
            fit_filter_error(
                twins.TURBULENCE, twins.in_turbulence(1), twins.TURBULENCE_NOISE, start="equation error"
            )
        ),
        "several starts": of_fit(best_of_starts(from_start, disturbed.LINEAR, starts=3)),
        "equation error": of_fit(fit_equation_error(disturbed.LINEAR, still, smoothing_s=0.2)),
        "equation error in a band": of_fit(fit_equation_error_in_band(unbiased, still, band_Hz=BAND_HZ)),
        "predicted": [
            {"response": prediction.y, "residuals": prediction.residuals, "agreement": prediction.agreement}
            for prediction in (predict(plain, parts[0]), predict(plain, rough))
        ],
        "cross-validation": {
            name: item.agreement
            for name, item in cross_validate(parts, lambda some: fit_output_error(disturbed.LINEAR, some)).items()
        },
        "halves": [len(half) for half in split(still, 3)],
    }  # fmt: skip
    for name, fit in (("plain", plain), ("rough", fit_output_error(disturbed.LINEAR, rough))):
        corrected = errors.morelli_klein(fit)
        derived = errors.delta_method(corrected, lambda p: np.sqrt(-p.Mal - p.Mq * p.Zal))
        contents[f"errors, {name}"] = {
            "corrected": corrected.covariance,
            "raw": errors.morelli_klein(fit, "raw").covariance,
            "bootstrap": errors.block_bootstrap(fit, block_s=1.0, draws=40).covariance,
            "derived": [derived.value, derived.standard_error],
            "tests": errors.t_tests(corrected),
            "white": errors.whiteness(fit),
        }
    return contents


def signals() -> Contents:
    """Inputs, transforms, and structure selection."""
    rng = np.random.default_rng(3)
    candidates = {f"x{i}": rng.standard_normal(200) for i in range(8)}
    z = 1.0 + 2 * candidates["x1"] - 0.5 * candidates["x4"] + 0.1 * candidates["x6"] + 0.4 * rng.standard_normal(200)
    chosen = [stepwise(candidates, z), orthogonal_functions(candidates, z)]
    return {
        "band": band_matrix(BAND_HZ, 100, 0.04),
        "chosen": [item._asdict() for item in chosen],
    }


def aircraft() -> Contents:
    """The models of an aircraft, fitted to two runs with bench noise and an elevator input."""
    noise = BENCH_NOISE | {"q": 0.0}
    truths = {
        "acceleration": fly(12, lambda V, t: 14 * min(1, 0.4 + t / 2) * (1 - V / 40), hold_height, 20, stop_at=23),
        "deceleration": fly(24, lambda V, t: 4 * max(0, 1 - t / 2) * (1 - V / 40), hold_height, 20, stop_at=12),
    }
    runs = [measured(name, truth, noise, i) for i, (name, truth) in enumerate(truths.items())]
    input_made = measured("3-2-1-1", fly(18, lambda V, t: 5.0, three_two_one_one, 8), BENCH_NOISE, 3)
    start = aircraft_models.starting_values(NEXSTAR, runs)
    rng = np.random.default_rng(1)
    contents: Contents = {
        "start": start,
        "level": [aircraft_models.level_flight_state(run) for run in runs],
        "priors": aircraft_models.Priors(),
        "two states": of_fit(fit_output_error(aircraft_models.two_state(NEXSTAR), runs, start=start)),
        "height": of_fit(fit_output_error(pitch_and_height(NEXSTAR), runs, start=start)),
        "elevator": of_fit(fit_output_error(longitudinal(NEXSTAR), input_made)),
    }
    for name, model in ALL_MODELS.items():
        if name == "level_run":
            rng.uniform(size=(7, 9))  # the stored values had one more model, of seven inputs, before this one
        x, u = (rng.uniform(0.05, 0.4, (len(names), 9)) for names in (model.states, model.inputs))
        for values, names in ((x, model.states), (u, model.inputs)):
            for i, item in enumerate(names):
                values[i] += {"V": 15.0, "V_ref": 17.0, "rho": 1.0, "thrust": 6.0}.get(item, 0.0)
        p = [q.start + 0.1 for q in model.parameters]
        rates = model.evaluate_dynamics(x, u, p) if model.states else ()
        contents[name] = {
            "rates": [np.broadcast_to(np.asarray(rate, dtype=float), 9) for rate in rates],
            "outputs": [
                np.broadcast_to(np.asarray(evaluate_output, dtype=float), 9)
                for evaluate_output in model.evaluate_outputs(x, u, p)
            ],
            "parameters": {q.name: [q.start, q.prior_sigma, q.lower, q.upper] for q in model.parameters},
        }
    return contents


CASES: dict[str, Callable[[], Contents]] = {
    "hard-fits": hard,
    "fits": fits,
    "signals": signals,
    "aircraft-models": aircraft,
}
