"""Output error agrees with closed forms of estimate, standard error and likelihood on static models."""

import numpy as np
import pytest

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.output_error import MeasurementNoise, fit_output_error


def test_a_prior_adds_half_its_squared_deviation_to_the_cost():
    """With a known R and a prior far from the data, the cost, the mean and its error have closed forms."""
    n, sigma = 50, 0.5
    z = 1.0 + sigma * np.random.default_rng(8).standard_normal(n)
    model = Model(
        name="mean",
        outputs=("z",),
        parameters=(Parameter(name="a", start=0.0, prior_mean=2.0, prior_sigma=0.1),),
        output_function=lambda x, u, p: (p.a,),
    )
    segment = Segment(name="s", t_s=np.arange(n) * 0.1, u={}, z={"z": z})
    fit = fit_output_error(model, segment, noise=MeasurementNoise(covariance=[sigma**2]))
    information = n / sigma**2 + 1 / 0.1**2
    a = (z.sum() / sigma**2 + 2.0 / 0.1**2) / information
    assert fit.values[0] == pytest.approx(a, rel=1e-9)
    assert fit.covariance[0, 0] == pytest.approx(1 / information, rel=1e-9)
    cost = ((z - a) ** 2).sum() / sigma**2 / 2 + n * np.log(sigma) + (a - 2.0) ** 2 / 0.1**2 / 2
    assert fit.negative_log_likelihood == pytest.approx(cost, rel=1e-12)


def test_t_noise_has_the_likelihood_and_information_of_student():
    """The location of t noise (4 degrees of freedom) maximizes scipy's density, with Fisher's information."""
    from scipy import optimize, stats

    n, dof = 400, 4.0
    z = 3.0 + 0.2 * stats.t.rvs(dof, size=n, random_state=9)
    model = Model(
        name="mean",
        outputs=("z",),
        parameters=(Parameter(name="a", start=0.0),),
        output_function=lambda x, u, p: (p.a,),
    )
    fit = fit_output_error(
        model, Segment(name="s", t_s=np.arange(n) * 0.1, u={}, z={"z": z}), noise=MeasurementNoise(tail_dof=dof)
    )
    best = optimize.minimize(
        lambda q: -stats.t.logpdf(z, dof, q[0], np.exp(q[1])).sum(), [3.0, np.log(0.2)], method="Nelder-Mead",
        options={"xatol": 1e-8, "fatol": 1e-10},
    )  # fmt: skip
    scale = np.exp(best.x[1])
    assert fit.values[0] == pytest.approx(best.x[0], abs=1e-5)
    assert fit.noise_covariance[0, 0] == pytest.approx(scale**2, rel=1e-4)
    constant = n * (np.log(scale) + stats.t.logpdf(0, dof, 0, scale))  # constant that the cost omits
    assert fit.negative_log_likelihood == pytest.approx(best.fun + constant, abs=1e-5)
    assert fit.covariance[0, 0] == pytest.approx(scale**2 / n * (dof + 3) / (dof + 1), rel=1e-3)


def test_the_smallest_noise_is_a_billionth_of_the_signal():
    """If the model reproduces the data to rounding errors, ln det R stays finite."""
    model = Model(
        name="gain",
        inputs=("u",),
        outputs=("z",),
        parameters=(Parameter(name="a", start=1.0),),
        output_function=lambda x, u, p: (p.a * u.u,),
    )
    t = np.arange(50) * 0.1
    fit = fit_output_error(model, Segment(name="s", t_s=t, u={"u": np.sin(t)}, z={"z": 2 * np.sin(t)}))
    assert fit.noise_covariance[0, 0] == pytest.approx(1e-18 * np.mean((2 * np.sin(t)) ** 2))
