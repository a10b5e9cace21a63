"""Tests the coverage of intervals with white and colored noise, and quantities derived from a covariance."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from flightpower.analysis.estimation import uncertainty
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.problem import FitOptions
from flightpower.analysis.estimation.simulation import build_simulator
from flightpower.flight.errors import InputError

STEP_S, N = 0.04, 300
T_S = np.arange(N) * STEP_S
DE = np.deg2rad(3) * np.select([(T_S > 1) & (T_S < 2.2), (T_S >= 2.2) & (T_S < 3), (T_S > 5) & (T_S < 6)], [1, -1, 0.7])
SIGMA = np.array([0.003, 0.005])

SHORT_PERIOD = Model(
    name="short period",
    states=("alpha", "q"),
    inputs=("de",),
    outputs=("alpha", "q"),
    parameters=(
        Parameter(name="Zal", start=-0.5, unit="1/s"),
        Parameter(name="Mal", start=-5.0, unit="1/s^2"),
        Parameter(name="Mq", start=-2.0, unit="1/s"),
        Parameter(name="Mde", start=-7.0, unit="1/s^2"),
    ),
    dynamics=lambda x, u, p: (p.Zal * x.alpha + x.q, p.Mal * x.alpha + p.Mq * x.q + p.Mde * u.de),
    output_function=lambda x, u, p: (x.alpha, x.q),
)
# The truth comes from the model itself, because these tests are about statistics, not about integration.
TRUE = np.array([-0.5, -5.0, -2.0, -7.0, 0.0, 0.0])
CLEAN = build_simulator(SHORT_PERIOD, ()).run(np.zeros(2), DE[:, None], TRUE[:4], STEP_S).y


def first_order(rng, phi=0.9):
    """Return noise with a memory of 0.4 s, similar to the noise of air data."""
    white = rng.standard_normal((N + 200, 2))
    return lfilter([np.sqrt(1 - phi**2)], [1, -phi], white, axis=0)[200:]


def moving_average(rng, length=15):
    return lfilter(np.ones(length) / np.sqrt(length), [1], rng.standard_normal((N + 200, 2)), axis=0)[200:]


def shared_with_a_lag(rng):
    """Return noise whose second output contains the first, five samples later, so they correlate with a lag."""
    e = first_order(rng)
    return np.stack([e[:, 0], 0.8 * np.roll(e[:, 0], 5) + 0.6 * e[:, 1]], axis=1)


def fit_noisy(noise, **options):
    z = CLEAN + SIGMA * noise
    segment = Segment(name="run", t_s=T_S, u={"de": DE}, z={"alpha": z[:, 0], "q": z[:, 1]})
    return fit_output_error(SHORT_PERIOD, segment, **{"options": FitOptions(second_start=False), **options})


@pytest.mark.slow
@pytest.mark.parametrize(
    "color",
    [*(pytest.param(item, marks=pytest.mark.thorough) for item in (first_order, moving_average)), shared_with_a_lag],
)
def test_with_colored_noise_corrected_intervals_cover_and_those_of_the_bound_do_not(color):
    """With 100 seeds of 6 correlated numbers, coverage is known to sqrt(0.95 0.05 / 100) = 2 % or better."""
    inside: dict[str, list] = {"Cramer-Rao": [], "corrected": []}
    for seed in range(100):
        fit = fit_noisy(color(np.random.default_rng(seed)))
        assert fit.verdict.ok
        off = np.abs(fit.values - TRUE)
        for name, what in (("Cramer-Rao", uncertainty.cramer_rao(fit)), ("corrected", uncertainty.morelli_klein(fit))):
            inside[name].append(off < NORMAL_95 * np.sqrt(np.diag(what.covariance)))
    assert np.mean(inside["Cramer-Rao"]) < 0.65
    assert 0.90 <= np.mean(inside["corrected"]) <= 0.97


def test_with_white_noise_the_default_equals_the_bound_and_raw_is_too_small():
    """The test compares mean variances over 40 seeds. The raw autocorrelation lacks the part absorbed by the fit, so
    it is not the default."""
    variances: dict[str, list] = {}
    for seed in range(40):
        fit = fit_noisy(np.random.default_rng(seed).standard_normal((N, 2)))
        for what in (
            uncertainty.cramer_rao(fit),
            uncertainty.morelli_klein(fit),
            uncertainty.morelli_klein(fit, "raw"),
            uncertainty.block_bootstrap(fit, block_s=0.4),
        ):
            variances.setdefault(what.method, []).append(np.diag(what.covariance))
    mean = {method: np.mean(values, axis=0) for method, values in variances.items()}
    bound = mean["Cramer-Rao"]
    assert mean["Morelli-Klein (autoregressive)"] / bound == pytest.approx(np.ones(6), abs=0.12)
    assert mean["block bootstrap"] / bound == pytest.approx(np.ones(6), abs=0.3)
    assert np.all(mean["Morelli-Klein (raw)"] < 0.95 * bound)


def test_raw_morelli_klein_equals_the_double_sum_of_the_paper():
    fit = fit_noisy(first_order(np.random.default_rng(1)))
    R_inv = np.linalg.inv(fit.noise_covariance)
    nu, S = fit.residuals["run"], fit.responses["run"].S
    lagged = [nu[k:].T @ nu[: N - k] / N for k in range(N)]
    total = np.zeros((6, 6))
    for i in range(N):
        for j in range(N):
            Rnu = lagged[i - j] if i >= j else lagged[j - i].T
            total += S[i].T @ R_inv @ Rnu @ R_inv @ S[j]
    D = fit.covariance
    assert uncertainty.morelli_klein(fit, "raw").covariance == pytest.approx(D @ total @ D, rel=1e-6)


def test_gaps_hardly_change_a_corrected_interval():
    noise = first_order(np.random.default_rng(2))
    full = uncertainty.morelli_klein(fit_noisy(noise)).standard_errors
    noise[200:215] = np.nan
    gappy = uncertainty.morelli_klein(fit_noisy(noise)).standard_errors
    assert [gappy[name] / full[name] for name in full] == pytest.approx([1] * 6, abs=0.25)


def test_delta_method_on_a_known_function():
    """The error of the frequency sqrt(-Mal) is calculated by hand, and the covariance of a straight line is exact."""
    what = uncertainty.cramer_rao(fit_noisy(np.random.default_rng(3).standard_normal((N, 2))))
    i, j = what.fit.names.index("Mal"), what.fit.names.index("Mq")
    frequency = uncertainty.delta_method(what, lambda p: np.sqrt(-p.Mal))
    by_hand = np.sqrt(what.covariance[i, i]) / (2 * np.sqrt(-what.fit.parameters["Mal"].value))
    assert frequency.standard_error[0] == pytest.approx(by_hand, rel=1e-5)
    line = uncertainty.delta_method(what, lambda p: p.Mal + p.Mq * np.array([0.0, 1.0, 2.0]))
    G = np.array([[1, 0], [1, 1], [1, 2]])
    assert line.covariance == pytest.approx(G @ what.covariance[np.ix_([i, j], [i, j])] @ G.T, rel=1e-6)


def test_prior_share_of_a_variance():
    """With a prior as good as the data, half of the variance is due to the prior; without priors, none is."""
    noise = np.random.default_rng(4).standard_normal((N, 2))
    plain = fit_noisy(noise)
    assert uncertainty.cramer_rao(plain).prior_share == pytest.approx(np.zeros(6))
    Mq = plain.parameters["Mq"]
    model = SHORT_PERIOD.changed(Mq={"prior_mean": Mq.value, "prior_sigma": Mq.standard_error})
    fit = fit_output_error(model, plain.segment_fits[0].segment)
    share = dict(zip(fit.names, uncertainty.cramer_rao(fit).prior_share, strict=True))
    assert share["Mq"] == pytest.approx(0.5, abs=0.01)
    assert share["alpha(0)[run]"] < 0.1


def test_a_parameter_that_does_nothing_is_significant_in_one_case_of_twenty():
    """An elevator lift term that is truly zero is found at the 5 % level in 5 +- 1.5 % of 200 records."""
    model = Model(
        name="with Zde",
        states=SHORT_PERIOD.states,
        inputs=SHORT_PERIOD.inputs,
        outputs=SHORT_PERIOD.outputs,
        parameters=(*SHORT_PERIOD.parameters, Parameter(name="Zde", start=0.0)),
        dynamics=lambda x, u, p: (p.Zal * x.alpha + x.q + p.Zde * u.de, p.Mal * x.alpha + p.Mq * x.q + p.Mde * u.de),
        output_function=SHORT_PERIOD.output_function,
    )
    significant = 0
    for seed in range(200):
        segment = fit_noisy_segment(np.random.default_rng(seed).standard_normal((N, 2)))
        tests = uncertainty.t_tests(uncertainty.cramer_rao(fit_output_error(model, segment)))
        assert tests["Mde"].significant
        significant += tests["Zde"].significant
    assert 2 <= significant <= 22  # 10 expected, +- 4 sigma of a binomial


def fit_noisy_segment(noise):
    z = CLEAN + SIGMA * noise
    return Segment(name="run", t_s=T_S, u={"de": DE}, z={"alpha": z[:, 0], "q": z[:, 1]})


def test_whiteness_tells_white_from_colored():
    white = [
        uncertainty.whiteness(fit_noisy(np.random.default_rng(s).standard_normal((N, 2))))["q"].p_value
        for s in range(40)
    ]
    assert np.mean(np.array(white) < 0.01) < 0.15
    colored = uncertainty.whiteness(fit_noisy(first_order(np.random.default_rng(0))))
    assert colored["q"].p_value < 1e-6
    assert colored["q"].lag_one == pytest.approx(0.9, abs=0.08)


def test_the_delta_method_refuses_unidentifiable_parameters():
    model = Model(
        name="sum",
        inputs=("u",),
        outputs=("y",),
        parameters=(Parameter(name="a", start=0.0), Parameter(name="b", start=0.0)),
        output_function=lambda x, u, p: ((p.a + p.b) * u.u,),
    )
    rng = np.random.default_rng(0)
    fit = fit_output_error(model, Segment(name="s", t_s=T_S, u={"u": T_S}, z={"y": T_S + rng.standard_normal(N)}))
    with pytest.raises(InputError, match=r"not identifiable: .* a change by \+1 a -1 b"):
        uncertainty.delta_method(uncertainty.morelli_klein(fit), lambda p: p.a)


def mean_of(z):
    model = Model(
        name="mean",
        outputs=("z",),
        parameters=(Parameter(name="a", start=0.0),),
        output_function=lambda x, u, p: (p.a,),
    )
    return fit_output_error(model, Segment(name="s", t_s=np.arange(len(z)) * 0.1, u={}, z={"z": z}))


def test_the_t_test_is_two_sided_with_the_degrees_of_freedom_left():
    fit = mean_of(np.random.default_rng(0).standard_normal(11))
    test = uncertainty.t_tests(uncertainty.cramer_rao(fit))["a"]
    assert test.critical == pytest.approx(2.228, abs=1e-3)  # Student's t, 10 degrees of freedom, 5 %
    assert test.t == pytest.approx(fit.values[0] / fit.parameters["a"].standard_error)


def test_whiteness_is_the_test_of_ljung_and_box():
    fit = mean_of(first_order(np.random.default_rng(1), phi=0.1)[:80, 0])
    e = fit.residuals["s"][:, 0]
    n, lags = len(e), 5
    r = np.array([e[k:] @ e[: n - k] for k in range(1, lags + 1)]) / (e @ e)
    Q = n * (n + 2) * (r**2 / (n - np.arange(1, lags + 1))).sum()
    result = uncertainty.whiteness(fit, lags)["z"]
    assert result.lag_one == pytest.approx(r[0])
    assert result.p_value == pytest.approx(chi2.sf(Q, lags))


def test_what_the_variances_of_residuals_tell_is_white_and_adds_to_the_score():
    """In D (M + V) D, a V of half of the data's information adds half of the Cramer-Rao bound, whatever the noise."""
    fit = fit_noisy(first_order(np.random.default_rng(0)))
    more = replace(fit, variance_information=0.5 * fit.information)
    bound = uncertainty.cramer_rao(fit).covariance
    for method in (uncertainty.morelli_klein, lambda item: uncertainty.block_bootstrap(item, block_s=1.0, draws=50)):
        assert method(more).covariance - method(fit).covariance == pytest.approx(0.5 * bound, rel=1e-6)
