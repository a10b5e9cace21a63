"""Autocorrelation absorbed by a fit and the order of autoregressions agree with exact matrices and probabilities."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.stats import chi2

from flightpower.analysis.estimation.colored_residuals import Autoregression, absorbed_autocorrelation, spectrum_of
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.output_error import fit_output_error

N, LAGS = 40, 6
LINE = Model(
    name="line",
    inputs=("u",),
    outputs=("z",),
    parameters=(Parameter(name="a", start=0.0), Parameter(name="b", start=0.0)),
    output_function=lambda x, u, p: (p.a + p.b * u.u,),
)


def test_the_fit_absorbs_what_the_exact_projection_removes_from_the_noise():
    """Residuals are (1 - H) noise with the covariance O - H O - O H + H O H, whose diagonals are averaged."""
    t = np.arange(N) * 0.1
    z = np.random.default_rng(0).standard_normal(N)
    fit = fit_output_error(LINE, Segment(name="s", t_s=t, u={"u": t}, z={"z": z}))
    fit = replace(fit, covariance=np.linalg.inv(fit.information))
    gamma = np.zeros(N)
    gamma[:LAGS] = 0.8 ** np.arange(LAGS)
    S = fit.segment_fits[0].white.S[:, 0]
    noise, H = toeplitz(gamma), S @ fit.covariance @ S.T
    assert H @ H == pytest.approx(H), "H must be a projection"
    absorbed = H @ noise + noise @ H - H @ noise @ H
    expected = [np.trace(absorbed, -lag) / N for lag in range(LAGS)]
    size = 4 * N
    got = absorbed_autocorrelation(fit, spectrum_of(gamma[:, None, None], size), size, LAGS)[:, 0, 0]
    assert got == pytest.approx(expected)


@pytest.mark.parametrize("outputs", [1, 2])
def test_white_noise_is_found_to_be_white_as_often_as_akaike_s_criterion_says(outputs):
    """Order k adds k outputs^2 coefficients; for white noise, twice the gain of the log-likelihood is chi-square.

    The random walk of gains less penalties stays below zero with probability exp(-sum_k P(chi2(k m) > 2 k m)/k),
    m = outputs^2 (Shibata 1976): 0.71 for one output, 0.88 for two. Four standard errors of 200 records are allowed.
    """
    records, samples, orders = 200, 400, 6
    rng = np.random.default_rng(outputs)
    white = 0
    for _ in range(records):
        e = rng.standard_normal((samples, outputs))
        gamma = np.array([e[lag:].T @ e[: samples - lag] / samples for lag in range(orders + 1)])
        white += len(Autoregression.fitted(gamma, samples).A) == 0
    k, m = np.arange(1, orders + 1), outputs**2
    probability = np.exp(-np.sum(chi2.sf(2 * k * m, k * m) / k))
    assert white / records == pytest.approx(probability, abs=4 * np.sqrt(probability * (1 - probability) / records))


@pytest.mark.parametrize("outputs", [1, 2])
def test_the_order_is_that_of_least_criterion_among_all_orders_solved_one_by_one(outputs):
    """The part not predicted by the last k values has the variance Gamma(0) less the variance of the prediction."""
    samples, orders, rng = 300, 12, np.random.default_rng(8)
    e = rng.standard_normal((samples, outputs))
    for i in range(4, samples):
        e[i] += 0.5 * e[i - 1] - 0.6 * e[i - 4]
    gamma = np.array([e[lag:].T @ e[: samples - lag] / samples for lag in range(orders + 1)])
    criteria, variances = [], []
    for k in range(orders + 1):
        lagged = np.array([[gamma[j - i] if j >= i else gamma[i - j].T for j in range(k)] for i in range(k)])
        among = lagged.transpose(0, 2, 1, 3).reshape(k * outputs, k * outputs) if k else np.zeros((0, 0))
        with_last = gamma[1 : k + 1].transpose(0, 2, 1).reshape(k * outputs, outputs)
        variances.append(gamma[0] - with_last.T @ np.linalg.solve(among, with_last))
        criteria.append(np.linalg.slogdet(variances[-1])[1] + 2 * k * outputs**2 / samples)
    fitted = Autoregression.fitted(gamma, samples)
    assert len(fitted.A) == np.argmin(criteria) >= 4
    assert fitted.Q == pytest.approx(variances[len(fitted.A)], rel=1e-9)


def test_lags_that_no_covariance_has_are_left_out():
    """No process has a covariance at lag 3 that is larger than its variance."""
    gamma = np.array([1.0, 0.7, 0.5, 2.0])[:, None, None]
    fitted = Autoregression.fitted(gamma, 100)
    assert 1 <= len(fitted.A) <= 2 and 0 < float(fitted.Q.item()) < 1
