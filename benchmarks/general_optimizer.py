"""A fit by a general optimizer on the same likelihood, to compare processor times with."""

import sys
import time
from pathlib import Path

import numpy as np
from scipy import optimize

from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.simulation import build_simulator
from flightpower.analysis.methods import aircraft_models

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "analysis" / "estimation"))
from test_starts_of_an_aircraft import MODEL, NEXSTAR, STEP_S, N


def processor_time_s(work, repeats):
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return best


def general_optimizer(run):
    """scipy's trust-constr with finite differences on the same likelihood.

    Its processor time [s], how many evaluations it took, and by how much its cost ends above ours.
    """
    start = aircraft_models.starting_values(NEXSTAR, run)
    fit = fit_output_error(MODEL, run, start=start)
    free = tuple(q for q in MODEL.parameters if q.free)
    plain = build_simulator(MODEL, ())  # without sensitivities, as a general optimizer would have it
    U = np.column_stack([run.u[name] for name in MODEL.inputs])
    Z = np.column_stack([run.z[name] for name in MODEL.outputs])
    at = [i for i, q in enumerate(MODEL.parameters) if q.free]
    scale = np.sqrt(np.diag(fit.covariance))  # the best scaling there is

    def cost(scaled):
        theta = scaled * scale
        p = np.array([q.start for q in MODEL.parameters])
        p[at] = theta[: len(free)]
        residuals = Z - plain.run(theta[len(free) :], U, p, STEP_S).y
        prior = sum((t - q.prior_mean_or_start) ** 2 / q.prior_sigma**2 for t, q in zip(theta, free, strict=False))
        return N / 2 * np.log((residuals**2).mean(axis=0)).sum() + prior / 2

    theta0 = [start.get(q.name, q.start) for q in free] + [run.z["V"][0], run.z["alpha"][0]]
    began = time.process_time()
    best = optimize.minimize(
        cost, np.array(theta0) / scale, method="trust-constr", jac="2-point", hess=optimize.BFGS(),
        options={"maxiter": 3000, "gtol": 1e-4, "xtol": 1e-6},
    )  # fmt: skip
    return time.process_time() - began, best.nfev, best.fun - cost(fit.values / scale)
