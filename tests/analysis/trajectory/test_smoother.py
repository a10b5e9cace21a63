"""The banded solution equals the dense one, and its covariance is that of least squares."""

import numpy as np
import pytest

from flightpower.analysis.trajectory.smoother import Linearization, TrajectoryPrior, cost, gauss_newton_step
from flightpower.analysis.trajectory.sparse_jacobian import SparseJacobian

N, NX, NY, M = 7, 3, 2, 2


def problem(seed: int) -> tuple[Linearization, TrajectoryPrior, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    linearization = Linearization(
        rng.normal(size=(N - 1, NX)),
        SparseJacobian.of(rng.normal(size=(N - 1, NX, 2 * NX + M))),
        rng.normal(size=(N, NY)),
        SparseJacobian.of(rng.normal(size=(N, NY, NX + M))),
    )
    prior = TrajectoryPrior(rng.normal(size=NX), np.full(NX, 2.0), rng.normal(size=M), np.array([0.5, 3.0]))
    return linearization, prior, rng.normal(size=NX), rng.normal(size=M)


def dense(
    linearization: Linearization, prior: TrajectoryPrior, first: np.ndarray, errors: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the least squares as one matrix: (residuals, Jacobian), with unknowns x_0 … x_n-1 and then the errors."""
    rows, r = [], []
    for k in range(N - 1):
        row = np.zeros((NX, N * NX + M))
        row[:, k * NX : (k + 2) * NX] = linearization.process_jacobian.dense()[k, :, : 2 * NX]
        row[:, N * NX :] = linearization.process_jacobian.dense()[k, :, 2 * NX :]
        rows.append(row)
        r.append(linearization.process_residual[k])
    for k in range(N):
        row = np.zeros((NY, N * NX + M))
        row[:, k * NX : (k + 1) * NX] = linearization.measurement_jacobian.dense()[k, :, :NX]
        row[:, N * NX :] = linearization.measurement_jacobian.dense()[k, :, NX:]
        rows.append(row)
        r.append(linearization.measurement_residual[k])
    row = np.zeros((NX + M, N * NX + M))
    row[:NX, :NX] = np.diag(1 / prior.initial_sigma)
    row[NX:, N * NX :] = np.diag(1 / prior.error_sigma)
    rows.append(row)
    r.append(
        np.concatenate(
            [(first - prior.initial_mean) / prior.initial_sigma, (errors - prior.error_mean) / prior.error_sigma]
        )
    )
    return np.concatenate(r), np.concatenate(rows)


@pytest.mark.parametrize("seed", range(5))
def test_the_step_is_that_of_dense_least_squares(seed: int) -> None:
    linearization, prior, first, errors = problem(seed)
    r, J = dense(linearization, prior, first, errors)
    expected = -np.linalg.lstsq(J, r, rcond=None)[0]
    inverse = np.linalg.inv(J.T @ J)
    got = gauss_newton_step(linearization, prior, first, errors)
    scale = np.linalg.cond(J) ** 2 * 1e-15  # rounding errors of the normal equations
    assert got.states.ravel() == pytest.approx(expected[: N * NX], abs=10 * scale)
    assert got.sensor_errors == pytest.approx(expected[N * NX :], abs=10 * scale)
    assert got.covariance == pytest.approx(inverse[N * NX :, N * NX :], rel=1e-8, abs=10 * scale)
    assert got.log_determinant == pytest.approx(np.linalg.slogdet(J.T @ J)[1], rel=1e-9)
    assert cost(linearization, prior, first, errors) == pytest.approx(float(r @ r), rel=1e-12)
    assert float(r @ r) - got.cost_decrease == pytest.approx(float(np.sum((r + J @ expected) ** 2)), rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_the_state_sensitivity_is_that_of_least_squares(seed: int) -> None:
    """If sensor errors are fixed one unit away, the best states move by `state_sensitivity`."""
    linearization, prior, first, errors = problem(seed)
    _, J = dense(linearization, prior, first, errors)
    by_state, by_error = J[:, : N * NX], J[:, N * NX :]
    sensitivity = (
        gauss_newton_step(linearization, prior, first, errors)
        .conditional.state_sensitivity(linearization)
        .reshape(N * NX, M)
    )
    assert sensitivity == pytest.approx(-np.linalg.lstsq(by_state, by_error, rcond=None)[0], abs=1e-8)


def test_draws_have_the_covariance_of_the_states_given_the_sensor_errors() -> None:
    """It is the inverse of the states' own block; 4,000 draws give a variance to 2.2 %, 1 sigma."""
    linearization, prior, first, errors = problem(0)
    _, J = dense(linearization, prior, first, errors)
    free = J[:, : N * NX]
    draws = gauss_newton_step(linearization, prior, first, errors).conditional.draws(NX, 4000).reshape(4000, N * NX)
    own = np.linalg.inv(free.T @ free)
    scale = np.sqrt(np.outer(np.diag(own), np.diag(own)))
    assert np.abs(draws.T @ draws / 4000 - own).max() < 5 * np.sqrt(2 / 4000) * scale.max()


def test_derivatives_that_are_always_zero_can_be_left_out() -> None:
    """Steps with every third derivative zero or left out are equal, for more instants than are summed at once."""
    rng = np.random.default_rng(0)
    n = SparseJacobian.chunk + 3
    nonzero = [place for k, place in enumerate(np.ndindex(NX, 2 * NX + M)) if k % 3]
    sparse = SparseJacobian(rng.normal(size=(len(nonzero), n - 1)), nonzero, 2 * NX + M)
    measured = SparseJacobian.of(rng.normal(size=(n, NY, NX + M)))
    residuals = rng.normal(size=(n - 1, NX)), rng.normal(size=(n, NY))
    _, prior, first, errors = problem(0)
    steps = [
        gauss_newton_step(Linearization(residuals[0], process, residuals[1], measured), prior, first, errors)
        for process in (sparse, SparseJacobian.of(sparse.dense()))
    ]
    assert steps[0].states == pytest.approx(steps[1].states, rel=1e-9, abs=1e-12)
    assert steps[0].covariance == pytest.approx(steps[1].covariance, rel=1e-9)
