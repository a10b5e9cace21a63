"""Measures processor time of `analysis.estimation` against limits and other optimizers, and how it grows.

`python benchmarks/bench.py fits`, `optimizers`, `growth`, `trajectory`. `aeroid` takes part where it is installed
(`pip install aeroid`).
"""

import importlib.util
import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import flights
import numpy as np
from records import Record, ratio, significant
from scipy import optimize

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.filter_error import fit_filter_error
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.simulation import build_simulator
from flightpower.analysis.methods import aircraft_models
from flightpower.analysis.trajectory.reconstruction import reconstruct
from flightpower.flight.aircraft import load_aircraft
from flightpower.sim.sensors import load_budget

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "analysis" / "estimation"))
import disturbed
import test_starts_of_an_aircraft as timed

ROOT = Path(__file__).parents[1]
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
# Four states and outputs, which include speed V and pitch angle theta, and twelve parameters.
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


def fit_records() -> list[Record]:
    """Return processor times of fits, import and model build, as ratios to their limits."""
    run_s = [timed.made_by_the_model(f"run {i}", i) for i in range(20)]
    start = aircraft_models.starting_values(timed.NEXSTAR, run_s[0])

    def fit(segments):
        return fit_output_error(timed.MODEL, segments, start=start)

    fit(run_s[0])
    segment = disturbed.linear_record(0)
    filter_error_s = processor_time_s(
        lambda: fit_filter_error(disturbed.LINEAR, segment, disturbed.LINEAR_NOISE, test_significance=False), 5
    )
    samples = "500 samples, 2 states, 4 outputs, 12 parameters"
    return [
        ratio("import and model build", _import_s(), 0.5, "s", at_most=1.0),
        ratio(samples, 1e3 * processor_time_s(lambda: fit(run_s[0]), 10), 20.0, "ms", at_most=1.0),
        ratio("20 such runs jointly", processor_time_s(lambda: fit(run_s), 2), 2.0, "s", at_most=1.0),
        {
            "what": "filter error, 250 samples, 2 states, 12 unknowns",
            "unit": "ms",
            "measured": significant(1e3 * filter_error_s),
        },
    ]


def _import_s() -> float:
    """Return the processor time of a new Python process that imports package and NumPy and compiles a model."""
    program = (
        "import time;"
        "from flightpower.analysis.methods import aircraft_models;"
        "from flightpower.analysis.estimation import output_error;"
        "from flightpower.analysis.estimation.simulation import build_simulator;"
        "from flightpower.flight.aircraft import load_aircraft;"
        "m = aircraft_models.level_run(load_aircraft('nexstar'));"
        "build_simulator(m, tuple(q.name for q in m.parameters if q.free)); print(time.process_time())"
    )
    ran = [
        subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT)
        for _ in range(3)
    ]
    return min(float(result.stdout) for result in ran)


def trajectory_records() -> list[Record]:
    """Return the processor time of trajectory reconstruction for 20 minutes of flight; it grows with the length."""
    aircraft, probe = load_aircraft("nexstar"), flights.tunnel_probe()
    rows = []
    for turbulence_kt in (0.0, 3.0, 15.0):
        errors = flights.draw_errors(load_budget("study"), 0)
        flown = flights.flown(aircraft, errors, "full-test-flight", 0, turbulence_kt)
        air, still, _ = flights.air_of(flown.table, aircraft, probe)
        whole_s = processor_time_s(lambda: reconstruct(air, still), 2)  # noqa: B023 -- called at once
        what = f"20 minutes in W20 = {turbulence_kt:g} kt"
        rows.append(ratio(what, whole_s * 1200 / float(air.index[-1]), 2.0, "s", at_most=1.0))
    return rows


# Model, samples, maneuvers, and limits for processor time [ms] and memory [MB].
GROWTH: tuple[tuple[str, int, int, float | None, float | None], ...] = (
    ("TWELVE", 500, 1, 20.0, None), ("TEN", 500, 1, None, None), ("ELEVEN", 601, 1, 50.0, None),
    ("TEN", 2000, 1, None, None), ("TEN", 10_000, 1, None, None), ("TEN", 50_000, 1, 3000.0, 300.0),
    ("TEN", 200_000, 1, None, None), ("TEN", 500, 10, None, None), ("TEN", 500, 100, None, None),
)  # fmt: skip


def growth_records() -> list[Record]:
    """Return processor time and peak memory of fits for growing samples and maneuvers, each in its own process."""
    rows = []
    for name, samples, maneuvers, wanted_ms, wanted_MB in GROWTH:
        code = f"import sys; sys.path.insert(0, {str(ROOT / 'benchmarks')!r}); import estimation_speed as e; e.one_fit"
        command = [sys.executable, "-c", f"{code}({name!r}, {samples}, {maneuvers})"]
        took_s, MB = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
        model = MODELS[name]
        row: Record = {"samples": samples, "maneuvers": maneuvers, "states": len(model.states)}
        row |= {"outputs": len(model.outputs), "parameters": len(model.parameters), "ms": significant(1e3 * took_s)}
        row |= {"ms per 1000 samples": significant(1e6 * took_s / (samples * maneuvers)), "MB": significant(MB)}
        shares = [1e3 * took_s / wanted_ms] if wanted_ms else []
        shares += [MB / wanted_MB] if wanted_MB else []
        rows.append(row | ({"ratio": significant(max(shares)), "at most": 1.0} if shares else {}))
    return rows


def one_fit(name: str, samples: int, maneuvers: int) -> None:
    """Print the processor time [s] of one fit after the model is compiled, and peak memory of the process [MB]."""
    model = MODELS[name]
    segments = [record(model, samples, seed) for seed in range(maneuvers)]
    fitted(model, record(model, 100))
    took_s = processor_time_s(lambda: fitted(model, segments), 1 if samples * maneuvers > 5000 else 10)
    print(json.dumps([took_s, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]))


def optimizer_records() -> list[Record]:
    """Return other optimizers' processor time, with finite differences, over output error's on the same record."""
    model, segment = disturbed.LINEAR, disturbed.linear_record(1000, strength=0.0)
    truth = disturbed.LINEAR_TRUTH
    start = {name: 1.3 * value for name, value in truth.items()}
    fit = fit_output_error(model, segment, start=start)
    ours = processor_time_s(lambda: fit_output_error(model, segment, start=start), 10)
    simulator, U = build_simulator(model, ()), segment.u["de"][:, None]
    Z = np.column_stack([segment.z[name] for name in model.outputs])
    sigma = np.sqrt(np.diag(fit.noise_covariance))  # the noise is given to it
    theta0 = np.array([*start.values(), *(segment.z[name][0] for name in model.states)])

    def residuals(theta):
        return ((Z - simulator.run(theta[7:], U, theta[:7], segment.step_s).y) / sigma).ravel()

    def row(name, took_s, values):
        difference = np.abs(values - fit.values[: len(values)]) / np.sqrt(np.diag(fit.covariance))[: len(values)]
        what = f"{name}, 250 samples, 9 unknowns"
        apart = {"largest difference, standard errors": significant(difference.max())}
        return ratio(what, took_s, ours, "s") | apart

    solution = optimize.least_squares(residuals, theta0, x_scale=np.abs(theta0) + 0.01)
    took_s = processor_time_s(lambda: optimize.least_squares(residuals, theta0), 1)
    rows = [row("scipy least_squares", took_s, solution.x)]
    if importlib.util.find_spec("aeroid") is not None:
        aeroid = importlib.import_module("aeroid")  # not a dependency of this project
        aeroid_model = aeroid.Model(
            states=list(model.states), controls=["de"], parameters=dict(start),
            dynamics=lambda t, x, u, p: np.array(model.evaluate_dynamics(x, u, [p[name] for name in truth])),
        )  # fmt: skip
        data = aeroid.FlightData(segment.t_s, {**segment.z, **segment.u})
        weights = dict(zip(model.outputs, (1 / sigma).tolist(), strict=True))
        results = []
        x0 = dict(zip(model.states, fit.values[7:].tolist(), strict=True))  # aeroid does not estimate initial states
        took_s = processor_time_s(
            lambda: results.append(aeroid.identify(aeroid_model, data, list(truth), weights=weights, x0=x0)), 1
        )
        rows.append(row("aeroid", took_s, np.array([results[0].parameters[name] for name in truth])))
    run = timed.made_by_the_model("run", 1)
    first = aircraft_models.starting_values(timed.NEXSTAR, run)
    ours = processor_time_s(lambda: fit_output_error(timed.MODEL, run, start=first), 10)
    took_s, evaluations, above = general_optimizer(run)
    what = f"scipy trust-constr, 500 samples, 14 unknowns, {evaluations} evaluations, cost {above:+.3f}"
    return [*rows, ratio(what, took_s, ours, "s", at_least=100.0)]


def processor_time_s(work, repeats):
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return best


def general_optimizer(run):
    """Run scipy's trust-constr with finite differences on the same likelihood.

    Returns its processor time [s], the number of evaluations, and by how much its final cost is above ours.
    """
    start = aircraft_models.starting_values(timed.NEXSTAR, run)
    fit = fit_output_error(timed.MODEL, run, start=start)
    free = tuple(q for q in timed.MODEL.parameters if q.free)
    plain = build_simulator(timed.MODEL, ())  # without sensitivities, which a general optimizer does not have
    U = np.column_stack([run.u[name] for name in timed.MODEL.inputs])
    Z = np.column_stack([run.z[name] for name in timed.MODEL.outputs])
    free_indices = [i for i, q in enumerate(timed.MODEL.parameters) if q.free]
    scale = np.sqrt(np.diag(fit.covariance))  # the best possible scaling

    def cost(scaled):
        theta = scaled * scale
        p = np.array([q.start for q in timed.MODEL.parameters])
        p[free_indices] = theta[: len(free)]
        residuals = Z - plain.run(theta[len(free) :], U, p, timed.STEP_S).y
        prior = sum((t - q.prior_mean_or_start) ** 2 / q.prior_sigma**2 for t, q in zip(theta, free, strict=False))
        return timed.N / 2 * np.log((residuals**2).mean(axis=0)).sum() + prior / 2

    theta0 = [start.get(q.name, q.start) for q in free] + [run.z["V"][0], run.z["alpha"][0]]
    began = time.process_time()
    best = optimize.minimize(
        cost, np.array(theta0) / scale, method="trust-constr", jac="2-point", hess=optimize.BFGS(),
        options={"maxiter": 3000, "gtol": 1e-4, "xtol": 1e-6},
    )  # fmt: skip
    return time.process_time() - began, best.nfev, best.fun - cost(fit.values / scale)
