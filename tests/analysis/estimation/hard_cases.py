"""Makes twelve fits that must not be used as they are, with the finding of the verdict that says so."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import twins
from disturbed import DE, LINEAR, LINEAR_TRUTH, SIGMA, T_S, X0, linear_record

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.fit import Finding, Fit
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.problem import FitOptions
from flightpower.analysis.estimation.simulation import build_simulator


class Case(NamedTuple):
    """fit : makes the fit for a seed     finding : must be in its verdict"""

    fit: Callable[[int], Fit]
    finding: Finding


def _record(seed, model=LINEAR, noise=None, delay=0, **inputs):
    """Return the response of the true model to the elevator, `delay` samples late, with noise SIGMA."""
    u = {"de": DE, **inputs}
    U = np.column_stack([np.concatenate([np.full(delay, u[n][0]), u[n]])[: len(DE)] for n in model.inputs])
    p = np.array([LINEAR_TRUTH.get(q.name, q.start) for q in model.parameters])
    y = build_simulator(model, ()).run(X0, U, p, T_S[1]).y
    if noise is None:
        noise = np.random.default_rng(seed).standard_normal(y.shape)
    z = y + SIGMA * noise
    return Segment(name="run", t_s=T_S, u=u, z={"alpha": z[:, 0], "q": z[:, 1]})


def _with(*parameters, added=lambda x, u, p: 0.0, inputs=("de",)):
    """Return the model with an additional term in the pitch acceleration."""

    def dynamics(x, u, p):
        alpha_dot, q_dot = LINEAR.dynamics(x, u, p)
        return alpha_dot, q_dot + added(x, u, p)

    return replace(LINEAR, inputs=inputs, parameters=(*LINEAR.parameters, *parameters), dynamics=dynamics)


FLAP = _with(Parameter(name="Mflap", start=-1.0), added=lambda x, u, p: p.Mflap * u.flap, inputs=("de", "flap"))
SCALED = _with(
    Parameter(name="Mfin", start=2.0), Parameter(name="scale", start=1.0), added=lambda x, u, p: p.Mfin * p.scale * x.q
).changed(Mq={"free": False})
CUBIC = _with(Parameter(name="Mq3", start=-400.0), added=lambda x, u, p: p.Mq3 * x.q**3)
OSCILLATION = Model(
    name="oscillation",
    inputs=("t",),
    outputs=("y",),
    parameters=(Parameter(name="omega", start=3.0, lower=0.1), Parameter(name="size", start=1.0)),
    output_function=lambda x, u, p: (p.size * np.sin(p.omega * u.t),),
)


def _collinear(seed):
    flap = DE * (1 + 1e-4 * np.random.default_rng(seed + 1).standard_normal(DE.size))
    return fit_output_error(FLAP, _record(seed, FLAP, flap=flap))


def _at_rest(seed):
    return fit_output_error(FLAP, _record(seed, FLAP, flap=0 * DE))


def _too_short(seed):
    record = _record(seed)
    z = {name: values[:4] for name, values in record.z.items()}
    return fit_output_error(LINEAR, Segment(name="run", t_s=T_S[:4], u={"de": DE[:4]}, z=z))


def _colored_noise(seed):
    white, noise = np.random.default_rng(seed).standard_normal((DE.size, 2)), np.zeros((DE.size, 2))
    for k in range(1, len(noise)):
        noise[k] = 0.9 * noise[k - 1] + white[k]
    return fit_output_error(LINEAR, _record(seed, noise=noise))


def _outliers(seed):
    noise = np.random.default_rng(seed).standard_normal((DE.size, 2))
    noise[[40, 120, 200], 0] = 40.0
    return fit_output_error(LINEAR, _record(seed, noise=noise))


def _false_optimum(seed):
    t = np.arange(0, 10, 0.05)
    y = np.sin(4.4 * t) + 0.05 * np.random.default_rng(seed).standard_normal(t.size)
    return fit_output_error(OSCILLATION, Segment(name="sine", t_s=t, u={"t": t}, z={"y": y}))


def _unstable(seed):
    start = {name: value * 1.05 for name, value in twins.UNSTABLE_TRUTH.items()}
    return fit_output_error(twins.UNSTABLE, twins.unstable(seed), options=FitOptions(inputs="held"), start=start)


CASES = {
    "two inputs alike to 1e-4": Case(_collinear, Finding.COLLINEAR),
    "an input at rest": Case(_at_rest, Finding.UNDETERMINED),
    "a product of two parameters": Case(
        lambda seed: fit_output_error(SCALED, _record(seed, SCALED)), Finding.UNDETERMINED
    ),
    "a record that is too short": Case(_too_short, Finding.TOO_FEW_VALUES),
    "a bound that excludes the truth": Case(
        lambda seed: fit_output_error(LINEAR.changed(Mq={"start": -3.0, "upper": -2.5}), _record(seed)),
        Finding.AT_BOUND,
    ),
    "cubic damping that the model lacks": Case(
        lambda seed: fit_output_error(LINEAR, _record(seed, CUBIC)), Finding.NOT_WHITE
    ),
    "a lag of the control of 0.12 s": Case(
        lambda seed: fit_output_error(LINEAR, _record(seed, delay=3)), Finding.NOT_WHITE
    ),
    "colored measurement noise": Case(_colored_noise, Finding.NOT_WHITE),
    "turbulence, by output error": Case(lambda seed: fit_output_error(LINEAR, linear_record(seed)), Finding.NOT_WHITE),
    "a false optimum": Case(_false_optimum, Finding.NOT_WHITE),
    "an unstable aircraft": Case(_unstable, Finding.UNSTABLE),
    "outliers": Case(_outliers, Finding.OUTLIERS),
}
