"""One Gauss-Newton step of a smoother: many small states in a row, and a few numbers that they all share.

The states of neighbouring instants are tied by process residuals, all of them to the shared numbers: the normal
equations are block tridiagonal with a border. Banded Cholesky solves them in time proportional to the length of the
record, and the border's Schur complement gives the exact covariance of the shared numbers. Relinearised until it
stands still this is the maximum a posteriori path: an iterated Kalman smoother, without its loop over time.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded

Array = NDArray[np.float64]


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


class Step(NamedTuple):
    """Corrections of the states (n, nx) and of the shared numbers (m,), the latter's covariance (m, m), how the states
    follow a change of the shared numbers (n, nx, m), by how much the cost falls if the equations are straight, and
    ln det of the whole normal matrix."""

    states: Array
    shared: Array
    covariance: Array
    follow: Array
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
    A, B, C = at.d_process[:, :, :nx], at.d_process[:, :, nx : 2 * nx], at.d_process[:, :, 2 * nx :]
    H, G = at.d_measured[:, :, :nx], at.d_measured[:, :, nx:]
    At, Bt, Ht = (M.transpose(0, 2, 1) for M in (A, B, H))

    diagonal = Ht @ H
    diagonal[:-1] += At @ A
    diagonal[1:] += Bt @ B
    diagonal[0] += np.diag(1 / prior.first_sigma**2)
    below = Bt @ A
    border = Ht @ G
    border[:-1] += At @ C
    border[1:] += Bt @ C
    gradient = (Ht @ at.measured[:, :, None])[:, :, 0]
    gradient[:-1] += (At @ at.process[:, :, None])[:, :, 0]
    gradient[1:] += (Bt @ at.process[:, :, None])[:, :, 0]
    gradient[0] += (first - prior.first_mean) / prior.first_sigma**2

    flat_G, flat_C = G.reshape(-1, m), C.reshape(-1, m)
    corner = flat_G.T @ flat_G + flat_C.T @ flat_C + np.diag(1 / prior.shared_sigma**2)
    shared_gradient = flat_G.T @ at.measured.ravel() + flat_C.T @ at.process.ravel()
    shared_gradient += (shared - prior.shared_mean) / prior.shared_sigma**2

    factor = cholesky_banded(_banded(diagonal, below), lower=True, overwrite_ab=True, check_finite=False)
    border = border.reshape(n * nx, m)
    right = np.concatenate([gradient.reshape(n * nx, 1), border], axis=1)
    solved = cho_solve_banded((factor, True), right, overwrite_b=True, check_finite=False)
    schur = corner - border.T @ solved[:, 1:]
    covariance = np.linalg.inv(schur)
    d_shared = -covariance @ (shared_gradient - border.T @ solved[:, 0])
    d_states = -(solved[:, 0] + solved[:, 1:] @ d_shared)
    log_determinant = 2 * float(np.sum(np.log(factor[0]))) + float(np.linalg.slogdet(schur)[1])
    follow = -solved[:, 1:].reshape(n, nx, m)
    decrease = -float(gradient.ravel() @ d_states + shared_gradient @ d_shared)
    return Step(d_states.reshape(n, nx), d_shared, (covariance + covariance.T) / 2, follow, decrease, log_determinant)


def _banded(diagonal: Array, below: Array) -> Array:
    """Lower band storage of a block tridiagonal matrix: row i - j of column j."""
    n, nx, _ = diagonal.shape
    band = np.zeros((2 * nx, n * nx))
    for j in range(nx):
        for i in range(j, nx):
            band[i - j, j::nx] = diagonal[:, i, j]
        for i in range(nx):
            band[nx + i - j, j : (n - 1) * nx : nx] = below[:, i, j]
    return band
