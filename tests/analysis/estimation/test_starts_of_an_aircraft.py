"""Tests convergence from starting values that are wrong by a factor of two."""

import numpy as np
import pytest

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.simulation import build_simulator
from flightpower.analysis.methods import aircraft_models
from flightpower.flight.aircraft import load_aircraft

pytestmark = pytest.mark.thorough

NEXSTAR = load_aircraft("nexstar")
STEP_S, N = 0.04, 500
# The model has two states, four outputs and twelve parameters.
MODEL = aircraft_models.two_state(NEXSTAR).changed(CLde={"free": False}, thrust_slope={"free": False})
TRUTH = {"CL0": 0.3, "CLa": 4.6, "A0": 0.0465, "A1": -0.0195, "A2": 0.065}
SIGMA = {"V": 0.29, "alpha": 0.008, "ax": 0.058, "az": 0.058}


def made_by_the_model(name, seed, V0=13.0):
    """Return an acceleration with a slowly falling pitch angle, simulated by the model itself, with noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(N) * STEP_S
    thrust = 9 * (1 - 0.6 * np.exp(-t)) + 0.3 * np.sin(1.7 * t + seed)
    theta = 0.16 - 0.12 * (1 - np.exp(-t / 8)) + 0.02 * np.sin(0.9 * t + seed)
    q = np.gradient(theta, STEP_S)
    zero = np.zeros(N)
    u = {"thrust": thrust, "J": 0.5 + zero, "elevator": -0.03 + zero, "q": q, "theta": theta, "rho": 1.2 + zero}
    u |= {name: zero for name in ("phi", "p", "r", "beta")}
    p = np.array([TRUTH.get(parameter.name, parameter.start) for parameter in MODEL.parameters])
    U = np.column_stack([u[name] for name in MODEL.inputs])
    y = build_simulator(MODEL, ()).run(np.array([V0, 0.16]), U, p, STEP_S).y
    z = {o: y[:, i] + SIGMA[o] * rng.standard_normal(N) for i, o in enumerate(MODEL.outputs)}
    return Segment(name=name, t_s=t, u=u, z=z)


def test_starts_off_by_a_factor_of_two_on_the_aircraft():
    run = made_by_the_model("run", 2)
    best = fit_output_error(MODEL, run, start=TRUTH)
    rng = np.random.default_rng(0)
    reached = 0
    for _ in range(100):
        start = {name: value * 2.0 ** rng.choice([-1, 1]) for name, value in TRUTH.items()}
        fit = fit_output_error(MODEL, run, start=start)
        at_best = abs(fit.negative_log_likelihood - best.negative_log_likelihood) < 1e-2
        assert at_best or not fit.verdict.ok, "a fit must not claim an optimum that it missed"
        reached += at_best
    assert reached >= 95
