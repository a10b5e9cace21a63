"""The colour of residuals: their autocorrelation, and the spectrum of the noise behind them.

Gamma(k) = E[e_(i+k) e_i'] for residuals e of several outputs at once, in units of the white noise they were taken for;
f(w) = sum_k Gamma(k) exp(-i w k) on the frequencies of a real Fourier transform of some length.

Residuals are not the noise: the fit has taken out whatever of the noise looks like a sensitivity. `Autoregression`
is fitted to an autocorrelation from which this loss has been removed (`fit_loss`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from analysis.estimation.fit import Fit

Array = NDArray[np.float64]
Spectrum = NDArray[np.complex128]

PASSES = 2  # of removing the fit's loss; the third changes a standard error by less than 1 %


def autocorrelation(fit: Fit, lags: int) -> Array:
    """Gamma(0) .. Gamma(lags - 1), (lags, outputs, outputs): the biased estimate, over all segments.

    Where samples are missing, the mean is over the pairs there are; the bias, 1 - lag/n, is that of a full record.
    """
    outputs = len(fit.model.outputs)
    size = fft.next_fast_len(2 * max(lags, max(len(piece.segment) for piece in fit.pieces)))
    products, pairs = np.zeros((lags, outputs, outputs)), np.zeros((lags, outputs, outputs))
    full_pairs = np.zeros(lags)
    for piece in fit.pieces:
        products += _lagged_products(piece.white.weight * piece.white.e, size)[:lags]
        pairs += _lagged_products(piece.white.present.astype(float), size)[:lags]
        full_pairs += np.maximum(len(piece.segment) - np.arange(lags), 0)
    pairs = np.round(pairs)
    mean = np.divide(products, pairs, out=np.zeros_like(products), where=pairs > 0)
    return mean * (full_pairs / full_pairs[0])[:, None, None]


def _lagged_products(e: Array, size: int) -> Array:
    """sum_i e[i + k] e[i]' for k = 0, 1, …; (size, outputs, outputs)."""
    e_hat = fft.rfft(e, size, axis=0)
    return fft.irfft(e_hat[:, :, None] * e_hat.conj()[:, None, :], size, axis=0)


def spectrum_of(gamma: Array, size: int) -> Spectrum:
    """f (size // 2 + 1, outputs, outputs) of an autocorrelation that is zero beyond its last lag."""
    n = len(gamma)
    circle = np.zeros((size, *gamma.shape[1:]))
    circle[:n] = gamma
    circle[size - n + 1 :] = gamma[:0:-1].transpose(0, 2, 1)  # Gamma(-k) = Gamma(k)'
    return fft.rfft(circle, axis=0)


def through(spectrum: Spectrum, S: Array, size: int) -> Array:
    """sum_j Gamma(i - j) S_j for every i: S (n, outputs, numbers) seen through the noise's covariance."""
    return fft.irfft(spectrum @ fft.rfft(S, size, axis=0), size, axis=0)[: len(S)]


class Autoregression(NamedTuple):
    """e_i = A[0] e_(i-1) + A[1] e_(i-2) + … + white noise of covariance Q."""

    A: Array  # (order, outputs, outputs)
    Q: Array

    def spectrum(self, size: int) -> Spectrum:
        w = 2 * np.pi * np.arange(size // 2 + 1) / size
        H = np.repeat(np.eye(len(self.Q), dtype=complex)[None], len(w), axis=0)
        for lag, A in enumerate(self.A, start=1):
            H -= np.exp(-1j * w * lag)[:, None, None] * A
        H = np.linalg.inv(H)
        return H @ self.Q @ H.conj().transpose(0, 2, 1)

    @classmethod
    def fitted(cls, gamma: Array, samples: int) -> "Autoregression":
        """Yule-Walker, of the order up to len(gamma) - 1 that Akaike's criterion likes best."""
        outputs = gamma.shape[1]

        def G(k: int) -> Array:
            return gamma[k] if k >= 0 else gamma[-k].T

        candidates = [(np.linalg.slogdet(gamma[0])[1], cls(np.zeros((0, outputs, outputs)), gamma[0]))]
        for order in range(1, len(gamma)):
            lags = range(1, order + 1)
            toeplitz = np.block([[G(k - i) for k in lags] for i in lags])
            row = np.linalg.solve(toeplitz.T, np.hstack([G(k) for k in lags]).T).T
            A = row.reshape(outputs, order, outputs).transpose(1, 0, 2)
            Q = gamma[0] - sum(A_i @ G(-i) for i, A_i in zip(lags, A, strict=True))
            Q = (Q + Q.T) / 2
            if np.linalg.eigvalsh(Q)[0] > 0:
                akaike = np.linalg.slogdet(Q)[1] + 2 * order * outputs**2 / samples
                candidates.append((akaike, cls(A, Q)))
        return min(candidates, key=lambda candidate: candidate[0])[1]


def middle(fit: Fit, spectrum: Spectrum, size: int) -> Array:
    """sum_i sum_j S_i' Gamma(i-j) S_j in noise units, (m, m): the covariance of the likelihood's gradient."""
    total = np.zeros_like(fit.information)
    for piece in fit.pieces:
        S = piece.white.S
        total[np.ix_(piece.columns, piece.columns)] += np.einsum("koi,koj->ij", S, through(spectrum, S, size))
    return (total + total.T) / 2


def fit_loss(fit: Fit, spectrum: Spectrum, size: int, lags: int) -> Array:
    """What the fit takes out of the noise's autocorrelation at the first `lags` lags, (lags, outputs, outputs).

    Residuals are (1 - H) noise with H = S D S', so their covariance lacks H O + O H - H O H of the noise's O; its
    diagonals are summed from these thin factors.
    """
    D = fit.covariance
    DMD = D @ middle(fit, spectrum, size) @ D
    loss = np.zeros((lags, *spectrum.shape[1:]))
    for piece in fit.pieces:
        S, own = piece.white.S, np.ix_(piece.columns, piece.columns)
        thin = (through(spectrum, S, size), S @ D[own], S, S @ DMD[own])
        O_S, S_D, S_, S_DMD = (factor.transpose(1, 0, 2) for factor in thin)
        for k in range(min(lags, len(S))):
            loss[k] += _outer(S_D, O_S, k) + _outer(O_S, S_D, k) - _outer(S_DMD, S_, k)
    return loss / sum(len(piece.segment) for piece in fit.pieces)


def _outer(a: Array, b: Array, lag: int) -> Array:
    """sum_i a_(i+lag) b_i', (outputs, outputs), of factors (outputs, n, numbers)."""
    outputs, n, _ = a.shape
    return a[:, lag:].reshape(outputs, -1) @ b[:, : n - lag].reshape(outputs, -1).T


def noise_spectrum(fit: Fit, size: int) -> Spectrum:
    """Spectrum of the noise behind a fit's residuals, autoregressive, the fit's own loss made good."""
    samples = sum(len(piece.segment) for piece in fit.pieces)
    # The usual bound of the order, 10 log10 N, shared among the outputs.
    lags = min(samples, 1 + max(1, int(10 * np.log10(samples) / len(fit.model.outputs))))
    gamma = autocorrelation(fit, lags)
    spectrum = Autoregression.fitted(gamma, samples).spectrum(size)
    # Without a finite covariance there is no telling what the fit took.
    for _ in range(PASSES if np.isfinite(fit.covariance).all() else 0):
        spectrum = Autoregression.fitted(gamma + fit_loss(fit, spectrum, size, lags), samples).spectrum(size)
    return spectrum
