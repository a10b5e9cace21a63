"""Simulates motion in turbulence, independently of the estimator, as data for tests of filter error."""

import numpy as np
from scipy.linalg import expm

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.filter_error import ProcessNoise
from flightpower.analysis.estimation.model import Model, Parameter

STEP_S, N = 0.04, 250
T_S = np.arange(N) * STEP_S
# Two doublets, with ramps of two samples that begin and end on samples.
DE = 0.03 + np.deg2rad(3) * np.interp(
    T_S,
    STEP_S * np.array([25, 27, 55, 57, 75, 77, 125, 127, 150, 152, 175, 177]),
    [0, 1, 1, -1, -1, 0, 0, 1, 1, -1, -1, 0],
)

# The model is the short period of a small jet, as in ATTAS test case 11; turbulence drives the angle of attack.
LINEAR_TRUTH = {"Z0": -0.009, "Zal": -0.48, "Zde": 0.3, "M0": 0.2, "Mal": -4.9, "Mq": -2.0, "Mde": -7.2}
LINEAR = Model(
    name="short period in turbulence",
    states=("alpha", "q"),
    inputs=("de",),
    outputs=("alpha", "q"),
    parameters=tuple(Parameter(name=name, start=value) for name, value in LINEAR_TRUTH.items()),
    dynamics=lambda x, u, p: (
        p.Z0 + p.Zal * x.alpha + x.q + p.Zde * u.de,
        p.M0 + p.Mal * x.alpha + p.Mq * x.q + p.Mde * u.de,
    ),
    output_function=lambda x, u, p: (x.alpha, x.q),
)
LINEAR_NOISE = ProcessNoise(state="alpha", start=0.01)
X0 = np.array([0.05, 0.0])
INTENSITY = 0.02  # rad per sqrt(s); gives alpha a standard deviation of 1.2 deg
SIGMA = np.array([0.003, 0.005])

# The model is a wing on a spring that stiffens with deflection; turbulence drives the pitch rate.
NONLINEAR_TRUTH = {"stiffness": 30.0, "hardening": 400.0, "damping": 1.5, "flap_effect": -12.0}
NONLINEAR = Model(
    name="wing on a hardening spring",
    states=("theta", "q"),
    inputs=("de",),
    outputs=("theta", "q"),
    parameters=tuple(Parameter(name=name, start=value) for name, value in NONLINEAR_TRUTH.items()),
    dynamics=lambda x, u, p: (
        x.q,
        -p.stiffness * x.theta - p.hardening * x.theta**3 - p.damping * x.q + p.flap_effect * u.de,
    ),
    output_function=lambda x, u, p: (x.theta, x.q),
)
NONLINEAR_NOISE = ProcessNoise(state="q", start=0.1)
KICKS = 0.15  # rad/s per sqrt(s); in one step as large as the gyro's noise
NONLINEAR_SIGMA = np.array([0.003, 0.03])
SUBSTEPS = 20


def _transition():
    """Return [Phi, input, slope of the input, constant] of a step, and its noise covariance (Van Loan 1978)."""
    p = LINEAR_TRUTH
    A = np.array([[p["Zal"], 1.0], [p["Mal"], p["Mq"]]])
    B, b = np.array([p["Zde"], p["Mde"]]), np.array([p["Z0"], p["M0"]])
    M = np.zeros((5, 5))
    M[:2, :2], M[:2, 2], M[2, 3], M[:2, 4] = A * STEP_S, B * STEP_S, 1.0, b * STEP_S
    V = np.zeros((4, 4))
    V[:2, :2], V[:2, 2:], V[2:, 2:] = -A, np.diag([INTENSITY**2, 0.0]), A.T
    E = expm(V * STEP_S)
    return expm(M)[:2], E[2:, 2:].T @ E[:2, 2:]


TRANSITION, STEP_NOISE = _transition()


def linear_record(seed, strength=1.0, name="run"):
    """Return the exact disturbed motion in turbulence of `strength` times INTENSITY, with sensor noise SIGMA."""
    rng = np.random.default_rng(seed)
    root = strength * np.linalg.cholesky(STEP_NOISE + 1e-20 * np.eye(2))
    x = np.empty((N, 2))
    x[0] = X0
    for k in range(N - 1):
        predictors = np.array([*x[k], DE[k], DE[k + 1] - DE[k], 1.0])
        x[k + 1] = TRANSITION @ predictors + root @ rng.standard_normal(2)
    z = x + SIGMA * rng.standard_normal((N, 2))
    return Segment(name=name, t_s=T_S, u={"de": DE}, z={"alpha": z[:, 0], "q": z[:, 1]})


def nonlinear_record(seed, name="run"):
    """Return the nonlinear motion by Euler-Maruyama in steps of 2 ms, with sensor noise NONLINEAR_SIGMA."""
    rng = np.random.default_rng(seed)
    p, h = NONLINEAR_TRUTH, STEP_S / SUBSTEPS
    de = 4 * (np.interp(np.arange(N * SUBSTEPS) * h, T_S, DE) - 0.03)
    kicks = KICKS * np.sqrt(h) * rng.standard_normal(N * SUBSTEPS)
    theta, q = 0.1, 0.0
    x = np.empty((N, 2))
    for i in range(N * SUBSTEPS):
        if i % SUBSTEPS == 0:
            x[i // SUBSTEPS] = theta, q
        moment = -p["stiffness"] * theta - p["hardening"] * theta**3 - p["damping"] * q + p["flap_effect"] * de[i]
        q_next = q + h * moment + kicks[i]
        theta, q = theta + h * (q + q_next) / 2, q_next
    z = x + NONLINEAR_SIGMA * rng.standard_normal((N, 2))
    return Segment(name=name, t_s=T_S, u={"de": 4 * (DE - 0.03)}, z={"theta": z[:, 0], "q": z[:, 1]})
