"""Equation error on a short period is exact without noise, and gives good starting values with noise."""

import numpy as np
import pytest

from flightpower.analysis.estimation import equation_error
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.equation_error import fit_equation_error
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.simulation import build_simulator
from flightpower.flight.errors import InputError

TRUE = {"Zal": -1.5, "Mal": -20.0, "Mq": -3.0, "Mde": -25.0}
STEP_S, N = 0.02, 500
T_S = np.arange(N) * STEP_S
DE = 0.05 * np.sin(3 * T_S + 0.3 * T_S**2)  # a sweep from 0.5 to 1.4 Hz
MODEL = Model(
    name="short period",
    states=("alpha", "q"),
    inputs=("de",),
    outputs=("alpha", "q", "az"),
    parameters=tuple(Parameter(name=name, start=0.0) for name in TRUE),
    dynamics=lambda x, u, p: (p.Zal * x.alpha + x.q, p.Mal * x.alpha + p.Mq * x.q + p.Mde * u.de),
    output_function=lambda x, u, p: (x.alpha, x.q, 20 * p.Zal * x.alpha),
)
CLEAN = build_simulator(MODEL, ()).run(np.zeros(2), DE[:, None], np.array(list(TRUE.values())), STEP_S).y


def segment(sigma=0.0, seed=0):
    z = CLEAN + sigma * CLEAN.std(axis=0) * np.random.default_rng(seed).standard_normal(CLEAN.shape)
    return Segment(name="sweep", t_s=T_S, u={"de": DE}, z=dict(zip(MODEL.outputs, z.T, strict=True)))


def test_without_noise_the_filtered_signals_satisfy_the_equation():
    """Starting values are zero. The remaining error comes from sampling and truncation of the kernel."""
    p = fit_equation_error(MODEL, segment(), smoothing_s=0.06).shared()
    for name, value in TRUE.items():
        assert getattr(p, name) == pytest.approx(value, rel=2e-3), name


def test_an_input_that_is_held_acts_half_a_step_late_on_the_derivatives_and_at_once_on_other_outputs():
    """The record is the exact response to an input that is held for 0.1 s, measured every 0.1 s. Estimates are right
    to 1 %; with the input taken at the samples, Mal and Mde would be 8 % too small."""
    step_s, true = 0.1, {"Mal": -6.0, "Mq": -1.5, "Mde": -9.0, "Zde": -3.0}
    model = Model(
        name="held", states=("alpha", "q"), inputs=("de",), outputs=("alpha", "q", "az"),
        parameters=tuple(Parameter(name=name, start=0.0) for name in true),
        dynamics=lambda x, u, p: (x.q, p.Mal * x.alpha + p.Mq * x.q + p.Mde * u.de),
        output_function=lambda x, u, p: (x.alpha, x.q, p.Zde * u.de),
    )  # fmt: skip
    t = np.arange(300) * step_s
    de = 0.05 * np.sin(0.8 * t + 0.02 * t**2)
    y = build_simulator(model, (), inputs="held").run(np.zeros(2), de[:, None], np.array([*true.values()]), step_s).y
    record = Segment(name="held", t_s=t, u={"de": de}, z=dict(zip(model.outputs, y.T, strict=True)))
    right, wrong = (
        fit_equation_error(model, record, smoothing_s=0.15, inputs=inputs).shared() for inputs in ("held", "linear")
    )
    for name, value in true.items():
        assert getattr(right, name) == pytest.approx(value, rel=1e-2), name
    assert right.Zde == pytest.approx(true["Zde"], rel=1e-9), "an output must use the input at its sample"
    assert abs(wrong.Mal / true["Mal"] - 1) > 0.05 and abs(wrong.Mde / true["Mde"] - 1) > 0.05


def test_smoothing_removes_the_bias_from_noise_in_the_regressors():
    """30 % noise in a regressor shrinks its coefficient by 0.3^2/(1 + 0.3^2) = 8 %. A low-pass three samples wide
    leaves 1/(2 sqrt(pi) 3) = 9 % of the noise's variance, so less than 1 % of shrinkage remains."""
    off = {}
    for smoothing_s in (0.01, 0.06):
        p = [fit_equation_error(MODEL, segment(0.3, s), smoothing_s=smoothing_s).shared() for s in range(20)]
        off[smoothing_s] = max(abs(np.mean([getattr(x, n) for x in p]) / v - 1) for n, v in TRUE.items())
    assert off[0.06] < 0.03  # 1 %, and scatter of the mean of 20 records
    assert off[0.01] > 0.05


def test_it_gives_starting_values_for_output_error():
    noisy = segment(0.05, 1)
    first = fit_equation_error(MODEL, noisy, smoothing_s=0.06).shared()
    fit = fit_output_error(MODEL, noisy, start={name: getattr(first, name) for name in TRUE})
    assert fit.verdict.ok and fit.iterations <= 8
    for name, value in TRUE.items():
        assert abs(fit.parameters[name].value - value) < 4 * fit.parameters[name].standard_error


def test_a_gap_removes_only_samples_within_the_kernel():
    holed = segment()
    holed.z["q"][200:205] = np.nan
    fit = fit_equation_error(MODEL, holed, smoothing_s=0.06)
    full = fit_equation_error(MODEL, segment(), smoothing_s=0.06)
    kernel = 2 * 12 + 1
    assert full.samples - fit.samples == 3 * (5 + kernel - 1)
    assert fit.shared().Mq == pytest.approx(TRUE["Mq"], rel=2e-3)


def test_unusable_data_and_models_are_refused():
    with pytest.raises(InputError, match=r"sweep: 500 samples .* over 2 s; more than 801 are needed"):
        fit_equation_error(MODEL, segment(), smoothing_s=2.0)
    with pytest.raises(InputError, match="more than 501 are needed"):  # four standard deviations on either side
        fit_equation_error(MODEL, segment(), smoothing_s=1.25)
    hidden = Model(
        name="hidden",
        states=("x",),
        outputs=("y",),
        parameters=(Parameter(name="k", start=1.0),),
        dynamics=lambda x, u, p: (-p.k * x.x,),
        output_function=lambda x, u, p: (2 * x.x,),
    )
    with pytest.raises(InputError, match="hidden: equation error needs every state measured, but x is not an output"):
        equation_error.regression_of(hidden)


@pytest.mark.parametrize("smoothing_s", [0.1, 0.2])
def test_the_low_pass_has_the_width_it_is_given(smoothing_s):
    """A Gaussian kernel of standard deviation s scales a sine of frequency w by exp(-(w s)^2/2): 3 dB at 0.13/s Hz."""
    t = np.arange(1000) * STEP_S
    w = 2 * np.pi * 0.13 / smoothing_s
    integrator = Model(
        name="integrator",
        states=("x",),
        inputs=("u",),
        outputs=("x",),
        parameters=(Parameter(name="k", start=1.0),),
        dynamics=lambda x, u, p: (p.k * u.u,),
        output_function=lambda x, u, p: (x.x,),
    )
    rate, integral = np.sin(w * t), (1 - np.cos(w * t)) / w
    segment = Segment(name="sine", t_s=t, u={"u": rate}, z={"x": integral})
    filtered = fit_equation_error(integrator, segment, smoothing_s=smoothing_s).segment_fits[0].segment
    expected = np.exp(-((w * smoothing_s) ** 2) / 2) * np.sin(w * filtered.t_s)
    assert expected.max() == pytest.approx(np.sqrt(0.5), abs=0.02)
    assert filtered.u["u"] == pytest.approx(expected, abs=1e-3)
    assert filtered.z["xdot"] == pytest.approx(expected, abs=1e-2)
