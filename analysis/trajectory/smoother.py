"""One Gauss-Newton step of a maximum a posteriori smoother: states at n instants, and sensor errors common to all.

Process residuals connect the states of neighboring instants, and every residual may depend on the sensor errors: the
normal equations are block tridiagonal with a border. Banded Cholesky factorization solves them in time proportional to
the length of the record; the Schur complement of the states is the exact inverse covariance of the sensor errors.
Iterated to convergence this is an iterated Kalman smoother, without its recursion over time.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky_banded, lapack

Array = NDArray[np.float64]

CHUNK = 64  # instants


class Linearization(NamedTuple):
    """Residuals in units of their standard deviations, and their derivatives; m sensor errors.

    process_residual : (n-1, nx) between instants k and k+1
    process_jacobian : (n-1, nx, nx + nx + m) by x_k, x_k+1, sensor errors
    measurement_residual : (n, ny) at instant k
    measurement_jacobian : (n, ny, nx + m) by x_k, sensor errors
    """

    process_residual: Array
    process_jacobian: Array
    measurement_residual: Array
    measurement_jacobian: Array


class TrajectoryPrior(NamedTuple):
    """Mean and standard deviation of normal priors: of the initial state (nx,) and of the sensor errors (m,)."""

    initial_mean: Array
    initial_sigma: Array
    error_mean: Array
    error_sigma: Array


class StatesGivenErrors(NamedTuple):
    """The distribution of the states conditional on the sensor errors. factor: banded Cholesky factor of its inverse
    covariance."""

    factor: Array

    def state_sensitivity(self, linearization: Linearization) -> Array:
        """Derivative of the conditional mean of the states by the sensor errors, (n, nx, m).

        linearization : its derivatives by the sensor errors may differ from those used by `gauss_newton_step`
        """
        n, nx = len(linearization.measurement_residual), linearization.process_residual.shape[1]
        m = linearization.measurement_jacobian.shape[2] - nx
        process = _state_by_error(linearization.process_jacobian, 2 * nx)
        border = np.empty((m, n * nx)).T  # Fortran order, as LAPACK requires
        by_instant = border.reshape(n, nx, m)
        by_instant[:] = _state_by_error(linearization.measurement_jacobian, nx)
        by_instant[:-1] += process[:, :nx]
        by_instant[1:] += process[:, nx:]
        half = _triangular_solution(self.factor, border, overwrite=True)
        return -_triangular_solution(self.factor, half, transposed=True).reshape(n, nx, m)

    def covariance_of(self, gradient: Array) -> Array:
        """Covariance (k, k) of k linear functions of the states; gradient: (n, nx, k) of these."""
        half = _triangular_solution(self.factor, np.asfortranarray(gradient.reshape(-1, gradient.shape[2])))
        return np.asarray(half.T @ half)

    def draws(self, nx: int, count: int) -> Array:
        """Random errors (count, n, nx) of the states given the sensor errors; the same in every call."""
        white = np.random.default_rng(0).standard_normal((self.factor.shape[1], count))
        return _triangular_solution(self.factor, white, transposed=True).T.reshape(count, -1, nx)


class GaussNewtonStep(NamedTuple):
    """A step, and what follows from its normal equations.

    states, sensor_errors : corrections (n, nx), (m,)      covariance : of the sensor errors (m, m)
    conditional : distribution of the states given the sensor errors
    cost_decrease : predicted for linear equations         log_determinant : ln det of the whole normal matrix
    """

    states: Array
    sensor_errors: Array
    covariance: Array
    conditional: StatesGivenErrors
    cost_decrease: float
    log_determinant: float


def cost(linearization: Linearization, prior: TrajectoryPrior, initial: Array, sensor_errors: Array) -> float:
    """Sum of squares that `gauss_newton_step` minimizes: minus twice the log posterior, up to a constant."""
    return float(
        np.sum(linearization.process_residual**2)
        + np.sum(linearization.measurement_residual**2)
        + np.sum(((initial - prior.initial_mean) / prior.initial_sigma) ** 2)
        + np.sum(((sensor_errors - prior.error_mean) / prior.error_sigma) ** 2)
    )


def gauss_newton_step(
    linearization: Linearization, prior: TrajectoryPrior, initial: Array, sensor_errors: Array
) -> GaussNewtonStep:
    """The Gauss-Newton step from a linearization at this initial state (nx,) and these sensor errors (m,).

    Raises LinAlgError when the equations do not determine every state.
    """
    n, _, width = linearization.measurement_jacobian.shape
    nx = linearization.process_residual.shape[1]
    m = width - nx
    before, after, errors = slice(nx), slice(nx, 2 * nx), slice(2 * nx, None)
    normal, gradient = _normal_equations(linearization.measurement_jacobian, linearization.measurement_residual, nx)

    diagonal = normal[:, :, :nx].copy()
    diagonal[0] += np.diag(1 / prior.initial_sigma**2)
    border = normal[:, :, nx:].copy()
    del normal
    above = np.empty((n - 1, nx, nx))
    for start in range(0, n - 1, CHUNK):  # temporary arrays of a chunk fit in the processor's cache
        stop = min(start + CHUNK, n - 1)
        first_instants, second_instants = slice(start, stop), slice(start + 1, stop + 1)
        process, process_gradient = _normal_equations(
            linearization.process_jacobian[first_instants], linearization.process_residual[first_instants], 2 * nx
        )
        diagonal[first_instants] += process[:, before, before]
        diagonal[second_instants] += process[:, after, after]
        above[first_instants] = process[:, before, after]
        border[first_instants] += process[:, before, errors]
        border[second_instants] += process[:, after, errors]
        gradient[first_instants] += process_gradient[:, before]
        gradient[second_instants] += process_gradient[:, after]
    gradient[0] += (initial - prior.initial_mean) / prior.initial_sigma**2

    by_error = (
        linearization.measurement_jacobian[:, :, nx:].reshape(-1, m),
        linearization.process_jacobian[:, :, 2 * nx :].reshape(-1, m),
    )
    corner = by_error[0].T @ by_error[0] + by_error[1].T @ by_error[1] + np.diag(1 / prior.error_sigma**2)
    error_gradient = (
        by_error[0].T @ linearization.measurement_residual.ravel()
        + by_error[1].T @ linearization.process_residual.ravel()
    )
    error_gradient += (sensor_errors - prior.error_mean) / prior.error_sigma**2

    band = _banded(diagonal, above)
    del diagonal, above
    factor = cholesky_banded(band, lower=True, overwrite_ab=True, check_finite=False)
    right = np.empty((1 + m, n * nx)).T  # Fortran order, as LAPACK requires
    right[:, 0], right[:, 1:] = gradient.ravel(), border.reshape(-1, m)
    del border
    half = _triangular_solution(factor, right, overwrite=True)
    schur = corner - half[:, 1:].T @ half[:, 1:]
    covariance = np.linalg.inv(schur)
    d_errors = -covariance @ (error_gradient - half[:, 1:].T @ half[:, 0])
    d_states = -_triangular_solution(factor, half[:, :1] + half[:, 1:] @ d_errors[:, None], transposed=True)[:, 0]
    log_determinant = 2 * float(np.sum(np.log(factor[0]))) + float(np.linalg.slogdet(schur)[1])
    cost_decrease = -float(gradient.ravel() @ d_states + error_gradient @ d_errors)
    covariance = (covariance + covariance.T) / 2
    conditional = StatesGivenErrors(factor)
    return GaussNewtonStep(d_states.reshape(n, nx), d_errors, covariance, conditional, cost_decrease, log_determinant)


def _state_by_error(derivative: Array, n_states: int) -> Array:
    """J_x^T J_c of each instant: J_x the first `n_states` columns of the derivatives, J_c the others."""
    return derivative[:, :, :n_states].transpose(0, 2, 1) @ derivative[:, :, n_states:]


def _normal_equations(derivative: Array, residual: Array, n_states: int) -> tuple[Array, Array]:
    """J_x^T J and J_x^T r of each instant: derivatives J (n, k, j), J_x their first columns, residuals r (n, k)."""
    states = derivative[:, :, :n_states].transpose(0, 2, 1)
    return states @ derivative, (states @ residual[:, :, None])[:, :, 0]


def _triangular_solution(factor: Array, right: Array, *, transposed: bool = False, overwrite: bool = False) -> Array:
    """Solution of a banded triangular system with `factor` L, or with L^T; `overwrite` allows reuse of `right`."""
    solution: Array
    solution, _ = lapack.dtbtrs(factor, right, uplo="L", trans="T" if transposed else "N", overwrite_b=overwrite)
    return solution


def _banded(diagonal: Array, above: Array) -> Array:
    """Lower band storage of a symmetric block tridiagonal matrix: row i - j of column j, in LAPACK's order of memory.

    above : (n-1, nx, nx) blocks of row k and column k+1
    """
    n, nx, _ = diagonal.shape
    band = np.zeros((n, nx, 2 * nx))
    for j in range(nx):
        band[:, j, : nx - j] = diagonal[:, j, j:]
        band[:-1, j, nx - j : 2 * nx - j] = above[:, j]
    return band.reshape(n * nx, 2 * nx).T
