"""Tests time delays as parameters, and the implicit trapezoidal rule."""

from dataclasses import replace

import numpy as np
import pytest
from disturbed import LINEAR, LINEAR_NOISE, LINEAR_TRUTH, SIGMA, X0, linear_record
from scipy.integrate import solve_ivp

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.equation_error import fit_equation_error
from flightpower.analysis.estimation.filter_error import fit_filter_error
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.simulation import build_simulator
from flightpower.flight.errors import InputError

DELAY_S = 0.13
LATE = replace(
    LINEAR,
    parameters=(*LINEAR.parameters, Parameter(name="tau", start=0.02, unit="s", lower=0.0, upper=0.5)),
    delays=(("de", "tau"),),
)
T_S = np.arange(250) * 0.04


def smooth(t):
    return 0.03 + 0.05 * np.sin(1.5 * t) * np.exp(-((t - 4) ** 2) / 6)


@pytest.fixture(scope="module")
def segment():
    """Return a record with a late elevator, integrated by SciPy and not by the estimator."""
    p = list(LINEAR_TRUTH.values())

    def rates(t, x):
        return LINEAR.evaluate_dynamics(x, [smooth(max(t - DELAY_S, 0.0))], p)

    x = solve_ivp(rates, (0, T_S[-1]), X0, t_eval=T_S, rtol=1e-9, atol=1e-10).y.T
    z = x + SIGMA * np.random.default_rng(0).standard_normal(x.shape)
    return Segment(name="run", t_s=T_S, u={"de": smooth(T_S)}, z={"alpha": z[:, 0], "q": z[:, 1]})


def test_a_delay_is_estimated_with_the_other_parameters(segment):
    fit = fit_output_error(LATE, segment)
    assert fit.verdict.ok and not fit.verdict.hints
    tau = fit.parameters["tau"]
    assert tau.standard_error < 0.02
    for name, truth in {**LINEAR_TRUTH, "tau": DELAY_S}.items():
        assert abs(fit.parameters[name].value - truth) < 4 * fit.parameters[name].standard_error, name


def test_the_sensitivity_to_a_delay_is_that_of_differences(segment):
    simulator, U = build_simulator(LATE, ("tau",)), segment.u["de"][:, None]

    def y(tau):
        return simulator.run(X0, U, np.array([*LINEAR_TRUTH.values(), tau]), 0.04)

    by_difference = (y(DELAY_S + 1e-5).y - y(DELAY_S - 1e-5).y) / 2e-5
    assert y(DELAY_S).S[:, :, 0] == pytest.approx(by_difference, abs=1e-3 * np.abs(by_difference).max())


def test_equation_error_estimates_it_too(segment):
    tau = fit_equation_error(LATE, segment, smoothing_s=0.1).parameters["tau"]
    assert tau.value == pytest.approx(DELAY_S, abs=0.05)


def test_filter_error_and_unknown_names_are_refused():
    with pytest.raises(InputError, match="filter error has no delays"):
        fit_filter_error(LATE, linear_record(0), LINEAR_NOISE)
    with pytest.raises(InputError, match="delays: 'da' must be an input and 'tau' a shared parameter"):
        replace(LATE, delays=(("da", "tau"),))


def test_the_implicit_rule_of_a_linear_model_is_its_closed_form():
    """(1 - hA/2) x' = (1 + hA/2) x is stable with steps far longer than the time constant."""
    model = Model(
        name="fast mode",
        states=("x",),
        outputs=("x",),
        parameters=(Parameter(name="k", start=1.0),),
        dynamics=lambda x, u, p: (-p.k * x.x,),
        output_function=lambda x, u, p: (x.x,),
    )
    k, h = 1000.0, 0.04
    result = build_simulator(model, ("k",), "trapezoidal").run(np.ones(1), np.zeros((5, 0)), np.array([k]), h)
    ratio = (1 - h * k / 2) / (1 + h * k / 2)
    assert result.x[:, 0] == pytest.approx(ratio ** np.arange(5), rel=1e-12)
    slope = -h / (1 + h * k / 2) ** 2
    assert result.S[2, 0, 0] == pytest.approx(2 * ratio * slope, rel=1e-9)
    explicit = build_simulator(model, ("k",), "heun").run(np.ones(1), np.zeros((5, 0)), np.array([k]), h)
    assert np.abs(explicit.x[-1]) > 1e6


def test_the_implicit_rule_of_a_nonlinear_model_is_solved():
    model = Model(
        name="cubic decay",
        states=("x",),
        outputs=("x",),
        parameters=(Parameter(name="k", start=2.0),),
        dynamics=lambda x, u, p: (-p.k * x.x**3,),
        output_function=lambda x, u, p: (x.x,),
    )
    x = build_simulator(model, ("k",), "trapezoidal").run(np.ones(1), np.zeros((4, 0)), np.array([2.0]), 0.1).x[:, 0]
    assert np.diff(x) == pytest.approx(0.1 * (-(x[:-1] ** 3) - x[1:] ** 3), abs=1e-9)


def test_two_late_inputs_have_each_its_own_delay():
    """In x' = -x + a(t - ta) + 2 b(t - tb), a change of either delay shifts the effect of its own input only."""
    model = Model(
        name="two late inputs", states=("x",), inputs=("a", "b"), outputs=("x",),
        parameters=(Parameter(name="ta", start=0.1, upper=0.5), Parameter(name="tb", start=0.1, upper=0.5)),
        dynamics=lambda x, u, p: (-x.x + u.a + 2 * u.b,), output_function=lambda x, u, p: (x.x,),
        delays=(("a", "ta"), ("b", "tb")),
    )  # fmt: skip
    U = np.stack([np.sin(T_S), np.cos(1.7 * T_S)], axis=1)
    simulator = build_simulator(model, ("ta", "tb"))
    result = simulator.run(np.zeros(1), U, np.array([0.1, 0.2]), 0.04)
    expected = solve_ivp(
        lambda t, x: -x + np.sin(t - 0.1) + 2 * np.cos(1.7 * (t - 0.2)), (0, T_S[-1]), [0.0], t_eval=T_S, rtol=1e-8
    ).y[0]
    assert result.y[25:, 0] - expected[25:] == pytest.approx(
        (result.y[25, 0] - expected[25]) * np.exp(-(T_S[25:] - T_S[25])), abs=2e-3
    )
    for i, (ta, tb) in enumerate(((1e-5, 0.0), (0.0, 1e-5))):
        more, less = (simulator.run(np.zeros(1), U, np.array([0.1 + s * ta, 0.2 + s * tb]), 0.04).y for s in (1, -1))
        by_difference = (more - less) / 2e-5
        assert result.S[:, :, i] == pytest.approx(by_difference, abs=1e-3 * np.abs(by_difference).max())
