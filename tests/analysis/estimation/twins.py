"""Simulates twins of two published cases: an aircraft in turbulence, and an unstable aircraft in light noise."""

import numpy as np

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.filter_error import ProcessNoise
from flightpower.analysis.estimation.model import Model, Parameter

STEP_S = 0.05


def steps(t, start_s, unit_s, widths, size):
    """Return a multistep input (n,) that starts positive, with ramps of one sample."""
    edges = start_s + unit_s * np.cumsum([0, *widths])
    times, values = [0.0], [0.0]
    for i, edge in enumerate(edges):
        times += [edge, edge + STEP_S]
        values += [values[-1], size * (-1) ** i if i < len(widths) else 0.0]
    return np.interp(t, times, values)


# Roll and yaw of a utility aircraft, with signs and sizes like those of a DHC-2, and turbulence in both rates.
TURBULENCE_TRUTH = {
    "Lp": -5.8, "Lr": 1.8, "Lda": -16.4, "Ldr": 0.43, "Lv": -0.10,
    "Np": -0.66, "Nr": -0.53, "Nda": 0.43, "Ndr": -2.8, "Nv": 0.010,
    "Yp": -0.10, "Yr": 0.8, "Yda": -0.4, "Ydr": 4.6, "Yv": -0.25,
}  # fmt: skip
TURBULENCE = Model(
    name="roll and yaw in turbulence",
    states=("p", "r"),
    inputs=("da", "dr", "v"),
    outputs=("pdot", "rdot", "ay", "p", "r"),
    parameters=tuple(Parameter(name=name, start=value) for name, value in TURBULENCE_TRUTH.items()),
    dynamics=lambda x, u, p: (_roll(x, u, p), _yaw(x, u, p)),
    output_function=lambda x, u, p: (
        _roll(x, u, p),
        _yaw(x, u, p),
        p.Yp * x.p + p.Yr * x.r + p.Yda * u.da + p.Ydr * u.dr + p.Yv * u.v,
        x.p,
        x.r,
    ),
)
TURBULENCE_INTENSITY = {"p": 0.04, "r": 0.02}  # rad/s per sqrt(s)
TURBULENCE_NOISE = tuple(ProcessNoise(state=state, start=0.01) for state in TURBULENCE_INTENSITY)
TURBULENCE_SIGMA = {"pdot": 0.01, "rdot": 0.005, "ay": 0.02, "p": 0.002, "r": 0.002}


def _roll(x, u, p):
    return p.Lp * x.p + p.Lr * x.r + p.Lda * u.da + p.Ldr * u.dr + p.Lv * u.v


def _yaw(x, u, p):
    return p.Np * x.p + p.Nr * x.r + p.Nda * u.da + p.Ndr * u.dr + p.Nv * u.v


def in_turbulence(seed, sigma=TURBULENCE_SIGMA):
    """Return 16 s with aileron, then rudder inputs; process noise acts once per step, as in the filter."""
    rng = np.random.default_rng(seed)
    t = np.arange(321) * STEP_S
    u = {"da": steps(t, 1.0, 0.6, (1, 1), 0.08), "dr": steps(t, 7.0, 0.7, (3, 2, 1, 1), 0.10)}
    u["v"] = np.cumsum(0.25 * rng.standard_normal(t.size)) * np.exp(-t / 40)  # m/s, measured
    w = np.array([*TURBULENCE_INTENSITY.values()]) * np.sqrt(STEP_S) * rng.standard_normal((t.size, 2))
    return _simulated(TURBULENCE, TURBULENCE_TRUTH, sigma, t, u, w, rng)


# A fighter that is unstable in pitch and held by feedback.
UNSTABLE_TRUTH = {"Zal": -1.4, "Zde": -0.15, "Mal": 6.0, "Mq": -0.75, "Mde": -12.0}
UNSTABLE = Model(
    name="unstable short period",
    states=("alpha", "q"),
    inputs=("de",),
    outputs=("az", "alpha", "q"),
    parameters=tuple(Parameter(name=name, start=value) for name, value in UNSTABLE_TRUTH.items()),
    dynamics=lambda x, u, p: (p.Zal * x.alpha + x.q + p.Zde * u.de, p.Mal * x.alpha + p.Mq * x.q + p.Mde * u.de),
    output_function=lambda x, u, p: (100.0 * (p.Zal * x.alpha + p.Zde * u.de), x.alpha, x.q),
)
UNSTABLE_SIGMA = {"az": 0.02, "alpha": 0.0005, "q": 0.0005}
UNSTABLE_NOISE = (ProcessNoise(state="alpha", start=0.003), ProcessNoise(state="q", start=0.003))


def unstable(seed, sigma=UNSTABLE_SIGMA):
    """Return 15 s of a multistep on top of feedback of alpha and pitch rate; an error doubles in half a second."""
    rng = np.random.default_rng(seed)
    t = np.arange(301) * STEP_S
    wanted = {"de": steps(t, 1.0, 1.0, (3, 2, 1, 1), 0.05)}
    feedback = {"de": {"alpha": 0.9, "q": 0.5}}
    return _simulated(UNSTABLE, UNSTABLE_TRUTH, sigma, t, wanted, np.zeros((t.size, 2)), rng, feedback)


def _simulated(model, truth, sigma, t, u, w, rng, feedback=None):
    """Simulate by RK4 in thirds of a step; inputs are linear between samples, or held over a step with feedback."""
    p, parts = [truth[q.name] for q in model.parameters], 3
    U, x = np.column_stack([u[name] for name in model.inputs]), np.zeros((t.size, len(model.states)))
    h = STEP_S / parts
    for k in range(t.size):
        for name, gains in (feedback or {}).items():
            U[k, model.inputs.index(name)] += sum(g * x[k, model.states.index(s)] for s, g in gains.items())
        if k == t.size - 1:
            break
        now, slope = x[k].copy(), 0.0 if feedback else (U[k + 1] - U[k]) / STEP_S
        for i in range(parts):
            u0, u1, u2 = (U[k] + slope * (i + s) * h for s in (0, 0.5, 1))
            k1 = np.array(model.evaluate_dynamics(now, u0, p))
            k2 = np.array(model.evaluate_dynamics(now + h / 2 * k1, u1, p))
            k3 = np.array(model.evaluate_dynamics(now + h / 2 * k2, u1, p))
            k4 = np.array(model.evaluate_dynamics(now + h * k3, u2, p))
            now = now + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        x[k + 1] = now + w[k]
    y = np.array(model.evaluate_outputs(x.T, U.T, p)).T
    z = {name: y[:, i] + sigma[name] * rng.standard_normal(t.size) for i, name in enumerate(model.outputs)}
    return Segment(name="run", t_s=t, u=dict(zip(model.inputs, U.T, strict=True)), z=z)
