"""Measures how time and memory of output error grow, and the ratio to other optimizers.

    python benchmarks/estimation_scaling.py growth
    python benchmarks/estimation_scaling.py ratios

`aeroid` takes part where it is installed (`pip install aeroid`).
"""

import importlib.util
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import typer
from rich.console import Console
from rich.table import Table
from scipy import optimize

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.simulation import build_simulator

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "analysis" / "estimation"))
import disturbed
from general_optimizer import general_optimizer, processor_time_s

STEP_S = 0.02
TRUTH = {
    "Z0": -0.009, "Zal": -0.48, "Zq": 0.1, "Zde": 0.3, "M0": 0.2, "Mal": -4.9, "Mq": -2.0, "Mde": -7.2, "bias": 0.1,
    "scale": 1.1,
}  # fmt: skip
# Ten parameters and four outputs; with bias_ax seven outputs and eleven parameters.
TEN = Model(
    name="short period, ten parameters",
    states=("alpha", "q"),
    inputs=("de",),
    outputs=("vane", "q", "az", "qdot"),
    parameters=tuple(Parameter(name=name, start=value) for name, value in TRUTH.items()),
    dynamics=lambda x, u, p: (_alpha_dot(x, u, p), _q_dot(x, u, p)),
    output_function=lambda x, u, p: _four(x, u, p),
)
ELEVEN = Model(
    name="short period, seven outputs",
    states=TEN.states,
    inputs=TEN.inputs,
    outputs=(*TEN.outputs, "az_tail", "alpha_dot", "ax"),
    parameters=(*TEN.parameters, Parameter(name="bias_ax", start=0.05)),
    dynamics=TEN.dynamics,
    output_function=lambda x, u, p: (
        *_four(x, u, p),
        50 * _alpha_dot(x, u, p) + 4 * _q_dot(x, u, p),
        _alpha_dot(x, u, p),
        9.81 * x.alpha + p.bias_ax,
    ),
)
# Four states and outputs, twelve parameters: speed V and pitch angle theta too.
TWELVE_TRUTH = {
    "Xv": -0.04, "Xal": -4.0, "Zv": -0.003, "Zal": -1.5, "Zq": 0.02, "Zde": -0.1, "Mv": 0.01, "Mal": -12.0, "Mq": -2.5,
    "Mde": -15.0, "bias": 0.01, "theta_bias": 0.02,
}  # fmt: skip
TWELVE = Model(
    name="longitudinal, twelve parameters",
    states=("V", "alpha", "q", "theta"),
    inputs=("de",),
    outputs=("V", "vane", "q", "theta"),
    parameters=tuple(Parameter(name=name, start=value) for name, value in TWELVE_TRUTH.items()),
    dynamics=lambda x, u, p: (
        p.Xv * x.V + p.Xal * x.alpha - 9.81 * x.theta,
        p.Zv * x.V + p.Zal * x.alpha + (1 + p.Zq) * x.q + p.Zde * u.de,
        p.Mv * x.V + p.Mal * x.alpha + p.Mq * x.q + p.Mde * u.de,
        x.q,
    ),
    output_function=lambda x, u, p: (x.V, x.alpha + p.bias, x.q, x.theta + p.theta_bias),
)
MODELS = {"TEN": TEN, "ELEVEN": ELEVEN, "TWELVE": TWELVE}
SIGMA = {
    "V": 0.1, "theta": 0.003, "vane": 0.003, "q": 0.005, "az": 0.1, "qdot": 0.05, "az_tail": 0.2, "alpha_dot": 0.02,
    "ax": 0.05,
}  # fmt: skip
CONSOLE = Console(width=140)
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


def _alpha_dot(x, u, p):
    return p.Z0 + p.Zal * x.alpha + (1 + p.Zq) * x.q + p.Zde * u.de


def _q_dot(x, u, p):
    return p.M0 + p.Mal * x.alpha + p.Mq * x.q + p.Mde * u.de


def _four(x, u, p):
    return p.scale * x.alpha + p.bias, x.q, 50 * (_alpha_dot(x, u, p) - x.q), _q_dot(x, u, p)


def record(model, samples, seed=0):
    rng, t = np.random.default_rng(seed), np.arange(samples) * STEP_S
    de = 0.03 + 0.05 * np.sign(np.sin(1.3 * t + seed)) * (np.sin(0.31 * t + seed) > 0)
    p = np.array([q.start for q in model.parameters])
    initial = {"alpha": 0.05} | {name: 0.0 for name in model.states if name != "alpha"}
    x0 = np.array([initial[name] for name in model.states])
    y = build_simulator(model, ()).run(x0, de[:, None], p, STEP_S).y
    z = {name: y[:, i] + SIGMA[name] * rng.standard_normal(samples) for i, name in enumerate(model.outputs)}
    return Segment(name=f"run {seed}", t_s=t, u={"de": de}, z=z, x0=initial)


def fitted(model, segments):
    return fit_output_error(model, segments, start={q.name: 1.3 * q.start for q in model.parameters})


@app.command()
def growth() -> None:
    """Processor time and peak memory of fits over samples and maneuvers; each fit in its own process."""
    table = Table(
        "samples", "maneuvers", "states", "outputs", "parameters", "s", "ms per 1000 samples", "MB", "wanted", box=None
    )
    for model, samples, maneuvers, wanted in (
        ("TWELVE", 500, 1, "20 ms"), ("TEN", 500, 1, ""), ("ELEVEN", 601, 1, "50 ms"), ("TEN", 2000, 1, ""),
        ("TEN", 10_000, 1, ""), ("TEN", 50_000, 1, "3 s, 300 MB"), ("TEN", 200_000, 1, ""), ("TEN", 500, 10, ""),
        ("TEN", 500, 100, ""),
    ):  # fmt: skip
        command = [sys.executable, __file__, "one", model, str(samples), str(maneuvers)]
        ran = subprocess.run(command, capture_output=True, text=True, check=True)
        seconds, megabytes = (float(word) for word in ran.stdout.split())
        chosen = MODELS[model]
        states, outputs, parameters = (len(part) for part in (chosen.states, chosen.outputs, chosen.parameters))
        per_1000 = 1e6 * seconds / (samples * maneuvers)
        table.add_row(
            str(samples), str(maneuvers), str(states), str(outputs), str(parameters), f"{seconds:.3f}",
            f"{per_1000:.0f}", f"{megabytes:.0f}", wanted,
        )  # fmt: skip
    CONSOLE.print(table)


@app.command(hidden=True)
def one(model: str, samples: int, maneuvers: int) -> None:
    """Processor time [s] of one fit after the model is compiled, and peak memory of the process [MB]."""
    chosen = MODELS[model]
    segments = [record(chosen, samples, seed) for seed in range(maneuvers)]
    fitted(chosen, record(chosen, 100))
    seconds = processor_time_s(lambda: fitted(chosen, segments), 1 if samples * maneuvers > 5000 else 10)
    print(seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


@app.command()
def ratios() -> None:
    """Processor time of other optimizers with finite differences, relative to output error's, on the same record."""
    model, segment = disturbed.LINEAR, disturbed.linear_record(1000, strength=0.0)
    truth = disturbed.LINEAR_TRUTH
    start = {name: 1.3 * value for name, value in truth.items()}
    fit = fit_output_error(model, segment, start=start)
    ours = processor_time_s(lambda: fit_output_error(model, segment, start=start), 10)
    simulator, U = build_simulator(model, ()), segment.u["de"][:, None]
    Z = np.column_stack([segment.z[name] for name in model.outputs])
    sigma = np.sqrt(np.diag(fit.noise_covariance))  # known to it
    theta0 = np.array([*start.values(), *(segment.z[name][0] for name in model.states)])

    def residuals(theta):
        return ((Z - simulator.run(theta[7:], U, theta[:7], segment.step_s).y) / sigma).ravel()

    table = Table("", "processor time", "ratio", "largest difference, standard errors", box=None)
    table.add_row("output error, 250 samples, 9 unknowns", f"{ours:.3f} s", "1", "")

    def row(name, seconds, values):
        difference = np.abs(values - fit.values[: len(values)]) / np.sqrt(np.diag(fit.covariance))[: len(values)]
        table.add_row(name, f"{seconds:.2f} s", f"{seconds / ours:.0f}", f"{difference.max():.2g}")

    solution = optimize.least_squares(residuals, theta0, x_scale=np.abs(theta0) + 0.01)
    row("scipy least_squares", processor_time_s(lambda: optimize.least_squares(residuals, theta0), 1), solution.x)
    if importlib.util.find_spec("aeroid") is None:
        table.add_row("aeroid", "not installed", "", "")
    else:
        aeroid = importlib.import_module("aeroid")  # no dependency of this project
        theirs = aeroid.Model(
            states=list(model.states), controls=["de"], parameters=dict(start),
            dynamics=lambda t, x, u, p: np.array(model.evaluate_dynamics(x, u, [p[name] for name in truth])),
        )  # fmt: skip
        data = aeroid.FlightData(segment.t_s, {**segment.z, **segment.u})
        weights = dict(zip(model.outputs, (1 / sigma).tolist(), strict=True))
        results = []
        x0 = dict(zip(model.states, fit.values[7:].tolist(), strict=True))  # it does not estimate them
        seconds = processor_time_s(
            lambda: results.append(aeroid.identify(theirs, data, list(truth), weights=weights, x0=x0)), 1
        )
        row("aeroid", seconds, np.array([results[0].parameters[name] for name in truth]))
    from test_starts_of_an_aircraft import MODEL, NEXSTAR, made_by_the_model

    from flightpower.analysis.methods import aircraft_models

    run = made_by_the_model("run", 1)
    first = aircraft_models.starting_values(NEXSTAR, run)
    ours = processor_time_s(lambda: fit_output_error(MODEL, run, start=first), 10)
    table.add_row("output error, 500 samples, 14 unknowns", f"{ours:.3f} s", "1", "")
    seconds, _, above = general_optimizer(run)
    table.add_row("scipy trust-constr", f"{seconds:.2f} s", f"{seconds / ours:.0f}", f"cost {above:+.3f}")
    CONSOLE.print(table)


if __name__ == "__main__":
    app()
