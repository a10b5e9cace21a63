"""One Gauss-Newton step of a smoother: many small states in a row, and a few numbers that they all share.

The states of neighbouring instants are tied by process residuals, all of them to the shared numbers: the normal
equations are block tridiagonal with a border. Banded Cholesky solves them in time proportional to the length of the
record, and the border's Schur complement gives the exact covariance of the shared numbers. Relinearised until it
stands still this is the maximum a posteriori path: an iterated Kalman smoother, without its loop over time.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky_banded, lapack

Array = NDArray[np.float64]

CHUNK = 64  # instants


class Linearised(NamedTuple):
    """Residuals in units of their standard deviations, and their derivatives.

    process : (n-1, nx) between instants k and k+1   d_process : (n-1, nx, nx + nx + m) over x_k, x_k+1, shared
    measured : (n, ny) at instant k                  d_measured : (n, ny, nx + m) over x_k, shared
    """

    process: Array
    d_process: Array
    measured: Array
    d_measured: Array


class Prior(NamedTuple):
    """Normal priors: of the first state (nx,) and of the shared numbers (m,), as mean and standard deviation."""

    first_mean: Array
    first_sigma: Array
    shared_mean: Array
    shared_sigma: Array


class Held(NamedTuple):
    """What tells how the states move when the shared numbers are held elsewhere, and how sure they are while held."""

    factor: Array

    def follow(self, at: Linearised) -> Array:
        """Change of each state by each shared number, all else as measured, (n, nx, m).

        at : may have other derivatives by the shared numbers than those that `step` had.
        """
        n, nx = len(at.measured), at.process.shape[1]
        m = at.d_measured.shape[2] - nx
        tied = _across(at.d_process, 2 * nx)
        border = np.empty((m, n * nx)).T  # column by column, as LAPACK has it
        by_state = border.reshape(n, nx, m)
        by_state[:] = _across(at.d_measured, nx)
        by_state[:-1] += tied[:, :nx]
        by_state[1:] += tied[:, nx:]
        half = _solved(self.factor, border, overwrite=True)
        return -_solved(self.factor, half, transposed=True).reshape(n, nx, m)

    def draws(self, nx: int, count: int) -> Array:
        """By how much each of `nx` states may be off though the shared numbers are right: draws, (count, n, nx)."""
        white = np.random.default_rng(0).standard_normal((self.factor.shape[1], count))
        return _solved(self.factor, white, transposed=True).T.reshape(count, -1, nx)


class Step(NamedTuple):
    """Corrections of the states (n, nx) and of the shared numbers (m,), the latter's covariance (m, m), what states do
    when shared numbers are held, by how much the cost falls if the equations are straight, and ln det of the whole
    normal matrix."""

    states: Array
    shared: Array
    covariance: Array
    held: Held
    decrease: float
    log_determinant: float


def cost(residuals: Linearised, prior: Prior, first: Array, shared: Array) -> float:
    """Sum of squares that `step` makes smaller: minus twice the log posterior, up to what does not change."""
    return float(
        np.sum(residuals.process**2)
        + np.sum(residuals.measured**2)
        + np.sum(((first - prior.first_mean) / prior.first_sigma) ** 2)
        + np.sum(((shared - prior.shared_mean) / prior.shared_sigma) ** 2)
    )


def step(at: Linearised, prior: Prior, first: Array, shared: Array) -> Step:
    """The Gauss-Newton step from a linearisation at which the first state and the shared numbers are as given.

    Raises LinAlgError when the equations do not determine every state.
    """
    n, _, width = at.d_measured.shape
    nx = at.process.shape[1]
    m = width - nx
    before, after, common = slice(nx), slice(nx, 2 * nx), slice(2 * nx, None)
    seen, seen_gradient = _squared(at.d_measured, at.measured, nx)

    diagonal = seen[:, :, :nx].copy()
    diagonal[0] += np.diag(1 / prior.first_sigma**2)
    border = seen[:, :, nx:].copy()
    above = np.empty((n - 1, nx, nx))
    gradient = seen_gradient
    for start in range(0, n - 1, CHUNK):  # what does not outlive a chunk stays in the processor's cache
        here, there = slice(start, min(start + CHUNK, n - 1)), slice(start + 1, min(start + CHUNK, n - 1) + 1)
        moved, moved_gradient = _squared(at.d_process[here], at.process[here], 2 * nx)
        diagonal[here] += moved[:, before, before]
        diagonal[there] += moved[:, after, after]
        above[here] = moved[:, before, after]
        border[here] += moved[:, before, common]
        border[there] += moved[:, after, common]
        gradient[here] += moved_gradient[:, before]
        gradient[there] += moved_gradient[:, after]
    gradient[0] += (first - prior.first_mean) / prior.first_sigma**2

    flat = at.d_measured[:, :, nx:].reshape(-1, m), at.d_process[:, :, 2 * nx :].reshape(-1, m)
    corner = flat[0].T @ flat[0] + flat[1].T @ flat[1] + np.diag(1 / prior.shared_sigma**2)
    shared_gradient = flat[0].T @ at.measured.ravel() + flat[1].T @ at.process.ravel()
    shared_gradient += (shared - prior.shared_mean) / prior.shared_sigma**2

    factor = cholesky_banded(_banded(diagonal, above), lower=True, overwrite_ab=True, check_finite=False)
    right = np.empty((1 + m, n * nx)).T  # column by column, as LAPACK has it
    right[:, 0], right[:, 1:] = gradient.ravel(), border.reshape(-1, m)
    half = _solved(factor, right, overwrite=True)
    schur = corner - half[:, 1:].T @ half[:, 1:]
    covariance = np.linalg.inv(schur)
    d_shared = -covariance @ (shared_gradient - half[:, 1:].T @ half[:, 0])
    d_states = -_solved(factor, half[:, :1] + half[:, 1:] @ d_shared[:, None], transposed=True)[:, 0]
    log_determinant = 2 * float(np.sum(np.log(factor[0]))) + float(np.linalg.slogdet(schur)[1])
    decrease = -float(gradient.ravel() @ d_states + shared_gradient @ d_shared)
    covariance = (covariance + covariance.T) / 2
    return Step(d_states.reshape(n, nx), d_shared, covariance, Held(factor), decrease, log_determinant)


def _across(derivative: Array, own: int) -> Array:
    """J_x^T J_c of each instant: the first `own` columns of the derivatives, and the others."""
    return derivative[:, :, :own].transpose(0, 2, 1) @ derivative[:, :, own:]


def _squared(derivative: Array, residual: Array, own: int) -> tuple[Array, Array]:
    """J_x^T J and J_x^T r of each instant: derivatives J (n, k, j), the first `own` columns J_x, residuals r (n, k)."""
    states = derivative[:, :, :own].transpose(0, 2, 1)
    return states @ derivative, (states @ residual[:, :, None])[:, :, 0]


def _solved(factor: Array, right: Array, *, transposed: bool = False, overwrite: bool = False) -> Array:
    """The solution of a triangular system with `factor` L, or with L^T; in place of `right` where that may go."""
    return lapack.dtbtrs(factor, right, uplo="L", trans="T" if transposed else "N", overwrite_b=overwrite)[0]


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
