"""One Gauss-Newton step of a maximum a posteriori smoother: states at n instants, and sensor errors common to all.

Process residuals connect the states of neighboring instants, and every residual may depend on the sensor errors: the
normal equations are block tridiagonal with a border. Banded Cholesky factorization solves them in time proportional to
the length of the record; the Schur complement of the states is the exact inverse covariance of the sensor errors.
Iterated to convergence this is an iterated Kalman smoother, without its recursion over time.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky_banded, lapack

from flightpower.analysis.trajectory.sparse_jacobian import SparseJacobian
from flightpower.flight.arrays import Array


class Linearization(NamedTuple):
    """Residuals in units of their standard deviations, and their derivatives; m sensor errors.

    process_residual : (n-1, nx) between instants k and k+1
    process_jacobian : at n-1 instants, with respect to x_k, x_k+1 and sensor errors
    measurement_residual : (n, ny) at instant k
    measurement_jacobian : at n instants, with respect to x_k and sensor errors
    """

    process_residual: Array
    process_jacobian: SparseJacobian
    measurement_residual: Array
    measurement_jacobian: SparseJacobian


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
        """Derivative of the conditional mean of the states with respect to the sensor errors, (n, nx, m).

        linearization : its derivatives for the sensor errors may differ from those used by `gauss_newton_step`
        """
        n, nx = len(linearization.measurement_residual), linearization.process_residual.shape[1]
        m = linearization.measurement_jacobian.width - nx
        border = np.zeros((m, n * nx))
        linearization.measurement_jacobian.add_border(border.reshape(m, n, nx), nx)
        linearization.process_jacobian.add_border(border.reshape(m, n, nx), 2 * nx)
        half = _triangular_solution(self.factor, border.T, overwrite=True)
        return -_triangular_solution(self.factor, half, transposed=True).reshape(n, nx, m)

    def covariance_of(self, gradient: Array) -> Array:
        """Covariance (k, k) of k linear functions of the states; gradient: their derivatives (n, nx, k)."""
        half = _triangular_solution(self.factor, np.asfortranarray(gradient.reshape(-1, gradient.shape[2])))
        return np.asarray(half.T @ half)

    def draws(self, nx: int, count: int) -> Array:
        """Random errors (count, n, nx) of the states given the sensor errors; the same in every call."""
        white = np.random.default_rng(0).standard_normal((self.factor.shape[1], count))
        return _triangular_solution(self.factor, white, transposed=True).T.reshape(count, -1, nx)


class GaussNewtonStep(NamedTuple):
    """A step, and results of its normal equations.

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
    n, nx = len(linearization.measurement_residual), linearization.process_residual.shape[1]
    band, right = _normal_equations(linearization)
    band[0, :, 0] += 1 / prior.initial_sigma**2
    right[:nx, 0] += (initial - prior.initial_mean) / prior.initial_sigma**2
    gradient = right[:, 0].copy()

    process, measurement = linearization.process_jacobian, linearization.measurement_jacobian
    corner = measurement.corner(nx) + process.corner(2 * nx) + np.diag(1 / prior.error_sigma**2)
    error_gradient = measurement.corner_gradient(linearization.measurement_residual, nx)
    error_gradient += process.corner_gradient(linearization.process_residual, 2 * nx)
    error_gradient += (sensor_errors - prior.error_mean) / prior.error_sigma**2

    band = band.reshape(n * nx, 2 * nx).T  # row i - j of column j, in LAPACK's order of memory
    factor = cholesky_banded(band, lower=True, overwrite_ab=True, check_finite=False)
    half = _triangular_solution(factor, right, overwrite=True)
    schur = corner - half[:, 1:].T @ half[:, 1:]
    covariance = np.linalg.inv(schur)
    d_errors = -covariance @ (error_gradient - half[:, 1:].T @ half[:, 0])
    d_states = -_triangular_solution(factor, half[:, :1] + half[:, 1:] @ d_errors[:, None], transposed=True)[:, 0]
    log_determinant = 2 * float(np.sum(np.log(factor[0]))) + float(np.linalg.slogdet(schur)[1])
    cost_decrease = -float(gradient @ d_states + error_gradient @ d_errors)
    covariance = (covariance + covariance.T) / 2
    conditional = StatesGivenErrors(factor)
    return GaussNewtonStep(d_states.reshape(n, nx), d_errors, covariance, conditional, cost_decrease, log_determinant)


def _normal_equations(linearization: Linearization) -> tuple[Array, Array]:
    """The normal equations of the states without prior: the matrix J_x^T J_x, and [J_x^T r, J_x^T J_c].

    The matrix is symmetric and block tridiagonal: (n, nx, 2 nx), columns of its lower triangle from the diagonal on.
    The right sides are (n nx, 1 + m) in Fortran order, as LAPACK requires.
    """
    n, nx = len(linearization.measurement_residual), linearization.process_residual.shape[1]
    m = linearization.measurement_jacobian.width - nx
    band, right = np.zeros((n, nx, 2 * nx)), np.zeros((1 + m, n, nx))
    for jacobian, residual, n_states in (
        (linearization.measurement_jacobian, linearization.measurement_residual, nx),
        (linearization.process_jacobian, linearization.process_residual, 2 * nx),
    ):
        jacobian.add_state_products(band, n_states)
        jacobian.add_gradient(right[0], residual, n_states)
        jacobian.add_border(right[1:], n_states)
    return band, right.reshape(1 + m, n * nx).T


def _triangular_solution(factor: Array, right: Array, *, transposed: bool = False, overwrite: bool = False) -> Array:
    """Solution of a banded triangular system with `factor` L, or with L^T; `overwrite` allows reuse of `right`."""
    solution: Array
    solution, _ = lapack.dtbtrs(factor, right, uplo="L", trans="T" if transposed else "N", overwrite_b=overwrite)
    return solution
