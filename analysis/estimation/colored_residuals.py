"""Colored residuals: their autocorrelation, and the spectrum of the noise that caused them.

Gamma(k) = E[e_(i+k) e_i'] is the autocorrelation of the whitened residuals e of several outputs;
f(w) = sum_k Gamma(k) exp(-i w k) is its spectrum at the frequencies of a real Fourier transform of length `size`.

Residuals are not the noise itself: the fit has absorbed the part of the noise that resembles a sensitivity.
`noise_spectrum` therefore corrects the autocorrelation by `absorbed_autocorrelation` before it fits an autoregression.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.linalg import lapack

from flightpower.analysis.estimation.fit import Fit
from flightpower.flight.arrays import Array

Spectrum = NDArray[np.complex128]


def residual_autocorrelation(fit: Fit, lags: int) -> Array:
    """Biased estimate of Gamma(0) .. Gamma(lags - 1), (lags, outputs, outputs), pooled over all segments.

    With missing samples, the mean is over the existing pairs, times the bias factor 1 - lag/n of a complete record.
    """
    outputs = len(fit.model.outputs)
    size = fft.next_fast_len(2 * max(lags, max(len(segment_fit.segment) for segment_fit in fit.segment_fits)))
    products, pairs = np.zeros((lags, outputs, outputs)), np.zeros((lags, outputs, outputs))
    full_pairs = np.zeros(lags)
    for segment_fit in fit.segment_fits:
        white = segment_fit.white
        products += _lagged_products(white.weight * white.e, size)[:lags]
        pairs += _lagged_products(white.present.astype(float), size)[:lags]
        full_pairs += np.maximum(len(segment_fit.segment) - np.arange(lags), 0)
    pairs = np.round(pairs)
    mean = np.divide(products, pairs, out=np.zeros_like(products), where=pairs > 0)
    gamma: Array = mean * (full_pairs / full_pairs[0])[:, None, None]
    return gamma


def _lagged_products(e: Array, size: int) -> Array:
    """sum_i e[i + k] e[i]' for k = 0, 1, …; (size, outputs, outputs)."""
    e_hat = fft.rfft(e, size, axis=0)
    return fft.irfft(e_hat[:, :, None] * e_hat.conj()[:, None, :], size, axis=0)


def spectrum_of(gamma: Array, size: int) -> Spectrum:
    """Spectrum (size // 2 + 1, outputs, outputs) of Gamma(0), Gamma(1), …, which is zero beyond its last lag."""
    n = len(gamma)
    circular = np.zeros((size, *gamma.shape[1:]))
    circular[:n] = gamma
    circular[size - n + 1 :] = gamma[:0:-1].transpose(0, 2, 1)  # Gamma(-k) = Gamma(k)'
    return fft.rfft(circular, axis=0)


class Autoregression(NamedTuple):
    """e_i = A[0] e_(i-1) + A[1] e_(i-2) + … + white noise of covariance Q."""

    A: Array  # (order, outputs, outputs)
    Q: Array  # (outputs, outputs)

    def spectrum(self, size: int) -> Spectrum:
        """Spectrum (size // 2 + 1, outputs, outputs)."""
        w = 2 * np.pi * np.arange(size // 2 + 1) / size
        H = np.repeat(np.eye(len(self.Q), dtype=complex)[None], len(w), axis=0)
        for lag, A in enumerate(self.A, start=1):
            H -= np.exp(-1j * w * lag)[:, None, None] * A
        H = np.linalg.inv(H)
        spectrum: Spectrum = H @ self.Q @ H.conj().transpose(0, 2, 1)
        return spectrum

    @classmethod
    def fitted(cls, gamma: Array, samples: int) -> "Autoregression":
        """Solve the Yule-Walker equations for the order, up to len(gamma) - 1, with the smallest AIC (Akaike).

        The diagonal of one Cholesky factor, that of the largest Toeplitz matrix, gives det Q for all orders. Orders for
        which the matrix is not positive definite are left out.
        """
        outputs = gamma.shape[1]
        G = np.concatenate([gamma, gamma[:0:-1].transpose(0, 2, 1)])  # G[-k] is the transpose of G[k]
        numbers = np.arange(len(gamma))
        blocks = G[numbers[None, :] - numbers[:, None]].transpose(0, 2, 1, 3)
        toeplitz = blocks.reshape(len(numbers) * outputs, -1)
        factor, failed = lapack.dpotrf(toeplitz, lower=1)
        possible = max(1, (failed - 1) // outputs) if failed else len(numbers)
        ln_det_Q = 2 * np.log(np.abs(np.diag(factor)[: possible * outputs])).reshape(possible, -1).sum(axis=1)
        order = int(np.argmin(ln_det_Q + 2 * numbers[:possible] * outputs**2 / samples))
        n = order * outputs
        backward = gamma[1 : order + 1].transpose(0, 2, 1).reshape(n, outputs)
        row = np.linalg.solve(toeplitz[:n, :n], backward).T
        Q = gamma[0] - row @ backward
        return cls(row.reshape(outputs, order, outputs).transpose(1, 0, 2), (Q + Q.T) / 2)


def transformed_sensitivities(fit: Fit, size: int) -> list[Spectrum]:
    """Fourier transforms (size // 2 + 1, outputs, unknowns) of each segment's whitened sensitivities."""
    return [fft.rfft(segment_fit.white.S, size, axis=0) for segment_fit in fit.segment_fits]


def score_covariance(fit: Fit, spectrum: Spectrum, size: int, transformed: list[Spectrum] | None = None) -> Array:
    """Covariance (m, m) of the likelihood's gradient: sum_i sum_j S_i' Gamma(i-j) S_j, of whitened sensitivities.

    Parseval's theorem gives the sum. transformed : from `transformed_sensitivities`, if the caller has them already
    """
    transformed = transformed or transformed_sensitivities(fit, size)
    occurs = np.full((len(spectrum), 1, 1), 2 / size)  # positive and negative frequency
    occurs[0] = 1 / size
    if size % 2 == 0:
        occurs[-1] = 1 / size
    weighted = spectrum * occurs
    total = np.zeros_like(fit.information)
    for segment_fit, S in zip(fit.segment_fits, transformed, strict=True):
        flat = S.reshape(-1, S.shape[2])
        own = np.ix_(segment_fit.columns, segment_fit.columns)
        total[own] += (flat.conj().T @ (weighted @ S).reshape(flat.shape)).real
    return (total + total.T) / 2


def absorbed_autocorrelation(
    fit: Fit, spectrum: Spectrum, size: int, lags: int, transformed: list[Spectrum] | None = None
) -> Array:
    """Autocorrelation of the noise minus autocorrelation of the residuals, at the first lags: (lags, outputs, outputs).

    The residuals are (1 - H) times the noise, with H = S D S'. Their covariance is the noise's covariance O minus
    H O + O H - H O H. The sums over diagonals use the factors (n, outputs, unknowns), not the (n, n) matrices.
    transformed : from `transformed_sensitivities`, if the caller has them already
    """
    transformed = transformed or transformed_sensitivities(fit, size)
    D, samples = fit.covariance, _samples(fit)
    DMD = D @ score_covariance(fit, spectrum, size, transformed) @ D
    # The factors of all segments in order, separated by zeros so that no lag connects two segments.
    n, (outputs, unknowns) = samples + lags * len(fit.segment_fits), fit.segment_fits[0].white.S.shape[1:]
    factors = np.zeros((4, outputs, n, unknowns))
    begin = 0
    for segment_fit, S_hat in zip(fit.segment_fits, transformed, strict=True):
        S, own = segment_fit.white.S, np.ix_(segment_fit.columns, segment_fit.columns)
        rows = slice(begin, begin + len(S))
        begin = rows.stop + lags
        convolved = fft.irfft(spectrum @ S_hat, size, axis=0)[: len(S)]  # sum_j Gamma(i - j) S_j
        for factor, values in zip(factors, (convolved, S @ D[own], S, S @ DMD[own]), strict=True):
            factor[:, rows] = values.transpose(1, 0, 2)
    O_S, S_D, S_, S_DMD = factors.reshape(4, outputs, -1)

    def product(a: Array, b: Array, lag: int) -> Array:
        """sum_i a_(i+lag) b_i', (outputs, outputs)."""
        shift = lag * unknowns
        return np.asarray(a[:, shift:] @ b[:, : b.shape[1] - shift].T)

    absorbed = [product(S_D, O_S, k) + product(O_S, S_D, k) - product(S_DMD, S_, k) for k in range(lags)]
    return np.array(absorbed) / samples


def noise_spectrum(fit: Fit, size: int) -> Spectrum:
    """Spectrum of the noise behind a fit's residuals: an autoregression, corrected for what the fit has absorbed."""
    samples, lags = _samples(fit), spectrum_order(fit)
    gamma, transformed = residual_autocorrelation(fit, lags), transformed_sensitivities(fit, size)
    spectrum = Autoregression.fitted(gamma, samples).spectrum(size)
    # A correction needs a finite covariance. A third correction would change standard errors by less than 1 %.
    for _ in range(2 if np.isfinite(fit.covariance).all() else 0):
        absorbed = absorbed_autocorrelation(fit, spectrum, size, lags, transformed)
        spectrum = Autoregression.fitted(gamma + absorbed, samples).spectrum(size)
    return spectrum


def spectrum_order(fit: Fit) -> int:
    """Number of lags, with lag 0, for an autoregression of an order up to 10 log10 N over the number of outputs."""
    samples = _samples(fit)
    return min(samples, 1 + max(1, int(10 * np.log10(samples) / len(fit.model.outputs))))


def _samples(fit: Fit) -> int:
    return sum(len(segment_fit.segment) for segment_fit in fit.segment_fits)
