"""Tests the scale, the likelihood and the information of a sample for noise of Student's t distribution."""

import numpy as np
import pytest
from scipy.stats import t as student

from flightpower.analysis.estimation.noise import (
    information_factor,
    negative_log_likelihood,
    noise_covariance_of,
    whiten,
)

DOF, SCALES = 4.0, np.array([0.5, 3.0])


@pytest.fixture(scope="module")
def residuals() -> np.ndarray:
    return np.random.default_rng(0).standard_t(DOF, size=(20_000, 2)) * SCALES


def test_the_scale_of_t_noise_is_found_and_that_of_normal_noise_is_the_variance(residuals: np.ndarray) -> None:
    R = noise_covariance_of(residuals, SCALES, "diagonal", DOF)
    assert np.sqrt(np.diag(R)) == pytest.approx(SCALES, rel=0.02)
    normal = noise_covariance_of(residuals, SCALES, "diagonal", None)
    assert np.diag(normal) == pytest.approx(np.mean(residuals**2, axis=0))
    full = noise_covariance_of(residuals, SCALES, "full", None)
    assert full == pytest.approx(residuals.T @ residuals / len(residuals))


def test_the_likelihood_of_t_noise_is_that_of_its_density(residuals: np.ndarray) -> None:
    few, R = residuals[:50], np.diag(SCALES**2)
    S = np.zeros((50, 2, 1))

    def cost(values: np.ndarray, dof: float | None) -> float:
        return negative_log_likelihood(whiten(values, S, R, dof), R, dof)

    change = cost(few, DOF) - cost(0 * few, DOF)
    density = student.logpdf(few / SCALES, DOF).sum() - student.logpdf(0 * few, DOF).sum()
    assert change == pytest.approx(-density)
    assert cost(few, None) - cost(0 * few, None) == pytest.approx(np.sum((few / SCALES) ** 2) / 2)
    assert cost(0 * few, None) == pytest.approx(50 * np.log(SCALES.prod()))


def test_the_weight_of_a_residual_is_the_slope_of_the_likelihood(residuals: np.ndarray) -> None:
    few, R, S = residuals[:5], np.diag(SCALES**2), np.zeros((5, 2, 1))
    white = whiten(few, S, R, DOF)
    step = 1e-5
    for place in ((0, 0), (3, 1)):
        moved = np.zeros_like(few)
        moved[place] = step * SCALES[place[1]]
        above, below = (negative_log_likelihood(whiten(few + s * moved, S, R, DOF), R, DOF) for s in (1, -1))
        assert (above - below) / (2 * step) == pytest.approx(white.weight[place] * white.e[place], rel=1e-5)


def test_a_sample_of_t_noise_tells_as_much_as_its_fisher_information() -> None:
    """It is the mean square of the slope of the log density."""
    x = np.linspace(-400, 400, 400_001)
    slope = (DOF + 1) * x / (DOF + x**2)
    information = np.trapezoid(slope**2 * student.pdf(x, DOF), x)
    assert information_factor(DOF) == pytest.approx(information, rel=1e-3) and information_factor(None) == 1.0
