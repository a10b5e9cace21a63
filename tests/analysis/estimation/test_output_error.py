"""Tests output error on models with known parameters: a short period, and small systems with exact solutions."""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.analysis.estimation.data import Segment, split
from flightpower.analysis.estimation.fit import FitStatus
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.output_error import MeasurementNoise, fit_output_error
from flightpower.analysis.estimation.problem import FitOptions

TRUTH = {"Zal": -1.5, "Mal": -20.0, "Mq": -3.0, "Mde": -25.0}
SIGMA = {"alpha": 0.004, "q": 0.01}
STEP_S = 0.04

SHORT_PERIOD = Model(
    name="short period",
    states=("alpha", "q"),
    inputs=("de",),
    outputs=("alpha", "q"),
    parameters=tuple(Parameter(name=name, start=value) for name, value in TRUTH.items()),
    dynamics=lambda x, u, p: (p.Zal * x.alpha + x.q, p.Mal * x.alpha + p.Mq * x.q + p.Mde * u.de),
    output_function=lambda x, u, p: (x.alpha, x.q),
)


def exact_response(truth, de, step_s, x0=(0.0, 0.0)):
    """Return the solution by matrix exponential, without an integrator, for an input that is linear between samples."""
    from scipy.linalg import expm

    A = np.array([[truth["Zal"], 1.0], [truth["Mal"], truth["Mq"]]])
    B = np.array([0.0, truth["Mde"]])
    M = np.zeros((4, 4))
    M[:2, :2], M[:2, 2], M[2, 3] = A * step_s, B * step_s, 1.0
    Phi = expm(M)
    x = np.zeros((len(de), 2))
    x[0] = x0
    for k in range(len(de) - 1):
        x[k + 1] = Phi[:2, :2] @ x[k] + Phi[:2, 2] * de[k] + Phi[:2, 3] * (de[k + 1] - de[k])
    return {"alpha": x[:, 0], "q": x[:, 1]}


def doublets(n=150):
    t = np.arange(n) * STEP_S
    switch = np.select([(t > 0.5) & (t < 1.1), (t >= 1.1) & (t < 1.5), (t > 2.5) & (t < 2.9)], [1.0, -1.0, 0.7])
    return t, np.deg2rad(3) * switch


T_S, DE = doublets()
CLEAN = exact_response(TRUTH, DE, STEP_S)


def noisy(seed, name="run", sigma=SIGMA):
    rng = np.random.default_rng(seed)
    z = {output: values + sigma[output] * rng.standard_normal(len(values)) for output, values in CLEAN.items()}
    return Segment(name=name, t_s=T_S, u={"de": DE}, z=z)


@pytest.mark.thorough
def test_estimates_are_unbiased_and_scatter_as_the_cramer_rao_bound():
    """With 500 seeds, the scatter is known to 1/sqrt(1000) = 3 %, and the mean to 1/sqrt(500) of the scatter."""
    seeds = 500
    fits = [fit_output_error(SHORT_PERIOD, noisy(seed)) for seed in range(seeds)]
    assert all(fit.verdict.ok for fit in fits)
    errors = np.array([fit.values for fit in fits]) - np.array([*TRUTH.values(), 0.0, 0.0])
    scatter = errors.std(axis=0, ddof=1)
    bound = np.sqrt(np.mean([np.diag(fit.covariance) for fit in fits], axis=0))
    assert np.all(np.abs(errors.mean(axis=0)) < 4 * scatter / np.sqrt(seeds))
    assert scatter / bound == pytest.approx(np.ones(6), abs=0.10)


def test_without_noise_the_error_is_that_of_the_integrator():
    """RK4's error over a step of a 4.8 rad/s mode is (w h)^5/120 = 2e-6 of the motion, 1e-4 over the record."""
    fit = fit_output_error(SHORT_PERIOD, Segment(name="run", t_s=T_S, u={"de": DE}, z=CLEAN))
    for name, value in TRUTH.items():
        assert fit.parameters[name].value == pytest.approx(value, rel=1e-3)


def test_integrators_converge_with_their_order():
    """With a smooth input, halving the step divides Euler's error by 2, Heun's by 4 and RK4's by 16."""
    from flightpower.analysis.estimation.simulation import build_simulator

    p = np.array(list(TRUTH.values()))
    ratio = {}
    for integrator in ("euler", "heun", "rk4"):
        error = []
        for n in (100, 200):
            t = np.linspace(0, 2, n + 1)
            de = 0.05 * t  # a ramp, which linear interpolation reproduces exactly
            exact = exact_response(TRUTH, de, t[1])
            y = build_simulator(SHORT_PERIOD, (), integrator).run(np.zeros(2), de[:, None], p, t[1]).y
            error.append(abs(y[-1, 0] - exact["alpha"][-1]))
        ratio[integrator] = error[0] / error[1]
    assert ratio == pytest.approx({"euler": 2, "heun": 4, "rk4": 16}, rel=0.15)


def test_a_hundred_starts_off_by_a_factor_of_two():
    rng = np.random.default_rng(0)
    segment = noisy(1)
    best = fit_output_error(SHORT_PERIOD, segment)
    reached = 0
    for _ in range(100):
        start = {name: value * 2.0 ** rng.choice([-1, 1]) for name, value in TRUTH.items()}
        fit = fit_output_error(SHORT_PERIOD, segment, start=start)
        at_best = abs(fit.negative_log_likelihood - best.negative_log_likelihood) < 1e-3
        assert at_best or not fit.verdict.ok, "a fit must not claim an optimum that it missed"
        reached += at_best
    assert reached >= 95


def test_missing_samples_cost_information_and_nothing_else():
    segment = noisy(2)
    z = {name: values.copy() for name, values in segment.z.items()}
    z["alpha"][40:90] = np.nan
    z["q"][::7] = np.nan
    gappy = fit_output_error(SHORT_PERIOD, Segment(name="run", t_s=T_S, u={"de": DE}, z=z))
    full = fit_output_error(SHORT_PERIOD, segment)
    assert gappy.verdict.ok
    assert np.isnan(gappy.residuals["run"][40:90, 0]).all()
    for name, value in TRUTH.items():
        estimate = gappy.parameters[name]
        assert abs(estimate.value - value) < 4 * estimate.standard_error
        assert estimate.standard_error > 0.9 * full.parameters[name].standard_error


def test_correlated_outputs_are_weighted_by_the_full_covariance():
    """Noise that both outputs share cancels in their difference, which a full R can use and a diagonal one cannot."""
    rng = np.random.default_rng(3)
    both = rng.standard_normal(len(T_S))
    own = rng.standard_normal((2, len(T_S))) * 0.2
    z = {name: CLEAN[name] + SIGMA[name] * (both + own[i]) for i, name in enumerate(("alpha", "q"))}
    segment = Segment(name="run", t_s=T_S, u={"de": DE}, z=z)
    full = fit_output_error(SHORT_PERIOD, segment, noise=MeasurementNoise(structure="full"))
    diagonal = fit_output_error(SHORT_PERIOD, segment)
    R = full.noise_covariance
    assert R[0, 1] / np.sqrt(R[0, 0] * R[1, 1]) == pytest.approx(1 / 1.04, abs=0.02)
    assert full.negative_log_likelihood < diagonal.negative_log_likelihood - 50
    assert full.parameters["Mal"].standard_error < diagonal.parameters["Mal"].standard_error
    assert all(abs(full.parameters[n].value - v) < 4 * full.parameters[n].standard_error for n, v in TRUTH.items())


def test_outliers_get_little_weight_with_t_noise():
    """One sample in fifteen is off by 30 sigma, which throws off least squares, but hardly a fit with t noise."""
    off = {"normal": [], "t": []}
    for seed in range(20):
        segment = noisy(seed)
        q = segment.z["q"].copy()
        hit = np.random.default_rng(1000 + seed).choice(len(q), len(q) // 15, replace=False)
        q[hit] += 30 * SIGMA["q"]
        spoilt = Segment(name="run", t_s=T_S, u={"de": DE}, z={"alpha": segment.z["alpha"], "q": q})
        for kind, dof in (("normal", None), ("t", 4.0)):
            fit = fit_output_error(SHORT_PERIOD, spoilt, noise=MeasurementNoise(tail_dof=dof))
            off[kind].append(fit.parameters["Mq"].value - TRUTH["Mq"])
    assert np.std(off["t"]) < np.std(off["normal"]) / 3


def test_a_prior_is_as_good_as_a_measurement():
    """For a normal prior and likelihood, precisions add, and the estimate is the weighted mean (to first order)."""
    segment = noisy(4)
    plain = fit_output_error(SHORT_PERIOD, segment)
    Mq = plain.parameters["Mq"]
    model = SHORT_PERIOD.changed(Mq={"prior_mean": Mq.value + Mq.standard_error, "prior_sigma": Mq.standard_error})
    held = fit_output_error(model, segment).parameters["Mq"]
    assert held.standard_error == pytest.approx(Mq.standard_error / np.sqrt(2), rel=0.02)
    assert held.value == pytest.approx(Mq.value + Mq.standard_error / 2, abs=0.05 * Mq.standard_error)


def test_parameters_of_single_segments_and_shared_ones():
    bias = {"one": 0.01, "two": -0.02}
    segments = []
    for seed, (name, b) in enumerate(bias.items()):
        segment = noisy(seed, name)
        segments.append(
            Segment(name=name, t_s=T_S, u={"de": DE}, z={"alpha": segment.z["alpha"] + b, "q": segment.z["q"]})
        )
    model = Model(
        name="short period, alpha biased",
        states=SHORT_PERIOD.states,
        inputs=SHORT_PERIOD.inputs,
        outputs=SHORT_PERIOD.outputs,
        parameters=(*SHORT_PERIOD.parameters, Parameter(name="b", start=0.0, unit="rad", shared=False)),
        dynamics=SHORT_PERIOD.dynamics,
        output_function=lambda x, u, p: (x.alpha + p.b, x.q),
    )
    fit = fit_output_error(model, segments, options=FitOptions(initial_states="given"), start={"Mq": -2.0})
    assert fit.names == (*TRUTH, "b[one]", "b[two]")
    # The given initial states are the first measured samples, whose noise passes into the estimates. The bound does
    # not contain it, so the tolerance is that noise.
    for name, b in bias.items():
        assert fit.parameters[f"b[{name}]"].value == pytest.approx(b, abs=3 * SIGMA["alpha"])


def test_parameters_that_cannot_be_separated_are_named():
    model = Model(
        name="two gains",
        inputs=("u",),
        outputs=("y",),
        parameters=(
            Parameter(name="a", start=1.0),
            Parameter(name="b", start=1.0),
            Parameter(name="c", start=0.0),
            Parameter(name="idle", start=0.0),
        ),
        output_function=lambda x, u, p: ((p.a + 2 * p.b) * u.u + p.c,),
    )
    t = np.arange(50) * 0.1
    rng = np.random.default_rng(0)
    segment = Segment(name="s", t_s=t, u={"u": np.sin(t)}, z={"y": 5 * np.sin(t) + 1 + 0.1 * rng.standard_normal(50)})
    fit = fit_output_error(model, segment)
    assert fit.verdict.status is FitStatus.NOT_IDENTIFIABLE
    assert fit.verdict.text == "not identifiable: the data do not determine idle; a change by +1 a -0.5 b"
    assert np.isinf(fit.parameters["a"].standard_error) and np.isinf(fit.parameters["idle"].standard_error)
    assert fit.parameters["c"].value == pytest.approx(1, abs=4 * fit.parameters["c"].standard_error)
    total = fit.parameters["a"].value + 2 * fit.parameters["b"].value
    assert total == pytest.approx(5, abs=0.1), "the sum that the data determine is still estimated"


def test_a_bound_is_kept_and_reported():
    model = SHORT_PERIOD.changed(Mq={"start": -3.5, "upper": -3.4})
    fit = fit_output_error(model, noisy(5))
    assert fit.verdict.status is FitStatus.AT_BOUND and "Mq = -3.4" in fit.verdict.text
    assert fit.parameters["Mq"].value == -3.4
    # The others are at their optimum for this Mq, as in a fit with Mq fixed.
    held = fit_output_error(SHORT_PERIOD.changed(Mq={"start": -3.4, "free": False}), noisy(5))
    assert fit.parameters["Mal"].value == pytest.approx(held.parameters["Mal"].value, rel=1e-4)


def test_a_static_model_is_ordinary_least_squares():
    rng = np.random.default_rng(6)
    t = np.arange(80) * 0.1
    X = np.stack([np.ones_like(t), t, t**2], axis=1)
    z = X @ [1.0, -2.0, 0.3] + 0.1 * rng.standard_normal(80)
    model = Model(
        name="parabola",
        inputs=("t",),
        outputs=("z",),
        parameters=tuple(Parameter(name=name, start=0.0) for name in "abc"),
        output_function=lambda x, u, p: (p.a + p.b * u.t + p.c * u.t**2,),
    )
    fit = fit_output_error(model, Segment(name="s", t_s=t, u={"t": t}, z={"z": z}))
    Theta, (square,), *_ = np.linalg.lstsq(X, z, rcond=None)  # by (2.18)
    assert fit.values == pytest.approx(Theta, rel=1e-9)
    assert fit.covariance == pytest.approx(square / 80 * np.linalg.inv(X.T @ X), rel=1e-6)


def unstable():
    """Return a model that diverges to infinity, and a record of 30 s."""
    model = Model(
        name="unstable",
        states=("x",),
        inputs=("u",),
        outputs=("x",),
        parameters=(Parameter(name="a", start=2.0), Parameter(name="b", start=0.5)),
        dynamics=lambda x, u, p: (p.a * x.x**3 + p.b * u.u,),
        output_function=lambda x, u, p: (x.x,),
    )
    t = np.arange(750) * 0.04
    return model, Segment(name="run", t_s=t, u={"u": np.ones(750)}, z={"x": np.zeros(750)})


def test_a_response_that_is_not_finite_is_refused():
    from flightpower.flight.errors import InputError

    model, segment = unstable()
    with pytest.raises(InputError, match=r"unstable, segment run: .* not finite from t = .*data\.split"):
        fit_output_error(model, segment)


def test_an_unstable_aircraft_with_split_segments():
    """Mal is positive, and feedback holds the aircraft. Errors grow by e^13 over the record, by e^1.3 in 1 s."""
    truth = {"Zal": -1.5, "Mal": 12.0, "Mq": -3.0, "Mde": -25.0}
    assert np.linalg.eigvals([[truth["Zal"], 1], [truth["Mal"], truth["Mq"]]]).real.max() > 1
    rng = np.random.default_rng(7)
    t = np.arange(250) * STEP_S
    wanted = 0.08 * np.sign(np.sin(2 * t)) + 0.04 * np.sign(np.sin(5.3 * t))
    de, x = np.zeros(250), np.zeros((250, 2))
    for k in range(249):
        de[k] = 1.2 * x[k, 0] + 0.15 * x[k, 1] + wanted[k]
        # The surface is held over a step, which the "held" rule then reproduces.
        step = exact_response(truth, np.array([de[k], de[k]]), STEP_S, x[k])
        x[k + 1] = step["alpha"][1], step["q"][1]
    de[-1] = de[-2]
    z = {"alpha": x[:, 0] + 0.004 * rng.standard_normal(250), "q": x[:, 1] + 0.01 * rng.standard_normal(250)}
    pieces = split(Segment(name="run", t_s=t, u={"de": de}, z=z), 10)
    assert sum(len(piece) for piece in pieces) == 250
    model = SHORT_PERIOD.changed(Mal={"start": 6.0}, Mq={"start": -1.5})
    fit = fit_output_error(model, pieces, options=FitOptions(inputs="held"))
    assert fit.verdict.ok
    for name, value in truth.items():
        assert abs(fit.parameters[name].value - value) < 4 * fit.parameters[name].standard_error


@pytest.mark.parametrize(
    ("rule", "integral"),
    [
        ("linear", lambda u0, u1: (u0**2 + u0 * u1 + u1**2) / 3),  # mean square of a straight line
        ("mean", lambda u0, u1: ((u0 + u1) / 2) ** 2),
        ("held", lambda u0, u1: u0**2),
    ],
)
def test_inputs_between_samples(rule, integral):
    """RK4 integrates xdot = u^2 exactly, whichever rule gives the input between samples."""
    from flightpower.analysis.estimation.simulation import build_simulator

    model = Model(
        name="square of the input",
        states=("x",),
        inputs=("u",),
        outputs=("x",),
        parameters=(Parameter(name="idle", start=0.0),),
        dynamics=lambda x, u, p: (u.u**2,),
        output_function=lambda x, u, p: (x.x,),
    )
    u = np.array([1.0, 3.0, -2.0, 0.5])
    x = build_simulator(model, (), inputs=rule).run(np.zeros(1), u[:, None], np.zeros(1), 0.1).x[:, 0]
    assert np.diff(x) == pytest.approx(0.1 * integral(u[:-1], u[1:]), rel=1e-12)


def test_a_lower_bound_is_kept_and_the_others_are_at_their_optimum():
    fit = fit_output_error(SHORT_PERIOD.changed(Mq={"start": -2.0, "lower": -2.5}), noisy(5))
    assert fit.verdict.status is FitStatus.AT_BOUND and fit.parameters["Mq"].value == -2.5
    fixed = fit_output_error(SHORT_PERIOD.changed(Mq={"start": -2.5, "free": False}), noisy(5))
    assert fit.parameters["Mal"].value == pytest.approx(fixed.parameters["Mal"].value, rel=1e-4)


def test_an_initial_state_that_is_given_is_not_estimated_and_the_other_is():
    """The record begins with both states away from zero, and only the initial state of q is estimated."""
    x0 = (0.03, 0.1)
    rng = np.random.default_rng(2)
    z = {k: v + SIGMA[k] * rng.standard_normal(len(v)) for k, v in exact_response(TRUTH, DE, STEP_S, x0).items()}
    model = replace(SHORT_PERIOD, initial_state=lambda segment: {"alpha": x0[0], "q": 0.0})
    fit = fit_output_error(
        model, Segment(name="run", t_s=T_S, u={"de": DE}, z=z), options=FitOptions(initial_states=("q",))
    )
    assert fit.verdict.ok and len(fit.names) == len(TRUTH) + 1
    for name, value in TRUTH.items():
        assert abs(fit.parameters[name].value - value) < 4 * fit.parameters[name].standard_error, name
    last, error = fit.values[-1], np.sqrt(fit.covariance[-1, -1])
    assert 0 < error < 0.01 and abs(last - x0[1]) < 4 * error
