"""Uncertainty of estimates: Cramer-Rao bound, corrections for colored residuals, delta method, tests.

The Cramer-Rao bound assumes white residuals. Residuals of flight data are colored, and the bound is then several times
too small. `morelli_klein` uses the autocorrelation of the residuals, `block_bootstrap` resamples blocks of them. None
of these methods can detect a systematic error that is common to all data and not in the model.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy import fft, special

from flightpower.analysis.estimation.colored_residuals import (
    noise_spectrum,
    residual_autocorrelation,
    score_covariance,
    spectrum_of,
)
from flightpower.analysis.estimation.fit import Fit, correlation_of
from flightpower.analysis.estimation.model import NamedValues
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError


@dataclass(frozen=True)
class Uncertainty:
    """Covariance (m, m) of `fit.values`, in the order of `fit.names`, and the method that computed it.

    prior_share : (m,) fraction of each variance, 0 to 1, that comes from the uncertainty of the priors
    """

    fit: Fit
    method: str
    covariance: Array
    prior_share: Array

    @property
    def standard_errors(self) -> dict[str, float]:
        return dict(zip(self.fit.names, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def correlation(self) -> Array:
        return correlation_of(self.covariance)


def cramer_rao(fit: Fit) -> Uncertainty:
    """Cramer-Rao bound (4.2), for white residuals. Priors count as measurements."""
    return _sandwich(fit, "Cramer-Rao", fit.information)


def morelli_klein(fit: Fit, autocorrelation: Literal["autoregressive", "raw"] = "autoregressive") -> Uncertainty:
    """Covariance for colored residuals (Morelli & Klein 1997, J. Aircraft 34(5), 671).

    It is D [sum_i sum_j S_i' R^-1 Rnu(i-j) R^-1 S_j] D, with cross terms between outputs, autocorrelation pooled over
    the segments, and independent segments. "raw" uses the biased estimate of Rnu from the residuals: on 16 s of a
    colored record, 95 % intervals cover 90 %. "autoregressive" fits a model to Rnu and corrects it for the part of the
    noise that the fit has absorbed (`colored_residuals`): intervals then cover 93 to 94 %.
    """
    longest = max(len(segment_fit.segment) for segment_fit in fit.segment_fits)
    # At four times the longest record the circular convolution wraps only lags at which the autocorrelation is zero.
    size = fft.next_fast_len(4 * longest)
    if autocorrelation == "raw":
        spectrum = spectrum_of(residual_autocorrelation(fit, longest), size)
    else:
        spectrum = noise_spectrum(fit, size)
    M = score_covariance(fit, spectrum, size) + fit.variance_information
    return _sandwich(fit, f"Morelli-Klein ({autocorrelation})", M)


def block_bootstrap(fit: Fit, *, block_s: float, draws: int = 500, seed: int = 0) -> Uncertainty:
    """Covariance by resampling the residuals in blocks of `block_s` seconds, linearized about the estimate.

    Blocks must be long compared with the correlation time of the residuals. The priors add their own covariance.
    """
    rng = np.random.default_rng(seed)
    m = len(fit.names)
    score = np.zeros((draws, m))
    for segment_fit in fit.segment_fits:
        e = segment_fit.white.weight * segment_fit.white.e
        n = len(e)
        length = min(n, max(1, round(block_s / segment_fit.segment.step_s)))
        starts = rng.integers(0, n - length + 1, size=(draws, -(-n // length)))
        index = (starts[:, :, None] + np.arange(length)).reshape(draws, -1)[:, :n]
        residual_draws = (e - e.mean(axis=0))[index].reshape(draws, -1)
        score[:, segment_fit.columns] += residual_draws @ segment_fit.white.S.reshape(-1, len(segment_fit.columns))
    return _sandwich(fit, "block bootstrap", np.cov(score, rowvar=False).reshape(m, m) + fit.variance_information)


def _sandwich(fit: Fit, method: str, M: Array) -> Uncertainty:
    """Covariance D M D + D P D of the estimate. M: covariance of the data's score. P: information of the priors."""
    D = fit.covariance
    with np.errstate(invalid="ignore", divide="ignore"):  # inf and NaN of unidentifiable unknowns propagate
        prior = D @ fit.prior_information @ D
        covariance = D @ M @ D + prior
        return Uncertainty(fit, method, covariance, np.diag(prior) / np.diag(covariance))


class Derived(NamedTuple):
    """A quantity (k,) computed from the parameters, and its covariance (k, k)."""

    value: Array
    covariance: Array

    @property
    def standard_error(self) -> Array:
        return np.sqrt(np.diag(self.covariance))


def delta_method(uncertainty: Uncertainty, function: Callable[[NamedValues], Any]) -> Derived:
    """A function of the shared parameters and its covariance to first order (delta method).

    function : takes the parameters by name, `p.stiffness`, and returns a number or a vector (k,)

    Raises InputError when the covariance is not finite.
    """
    fit = uncertainty.fit

    def value_of(values: Array) -> Array:
        return np.atleast_1d(np.asarray(function(fit.shared(values)), dtype=float))

    h = 1e-3 * np.sqrt(np.diag(uncertainty.covariance))  # of central differences: a thousandth of a standard error
    if not np.isfinite(h).all():
        raise InputError(f"the covariance of the estimate is not finite, the delta method needs it: {fit.verdict}")
    gradient = np.stack([(value_of(fit.values + d) - value_of(fit.values - d)) for d in np.diag(h)], axis=1)
    gradient = np.divide(gradient, 2 * h, out=np.zeros_like(gradient), where=h > 0)
    return Derived(value_of(fit.values), gradient @ uncertainty.covariance @ gradient.T)


class Significance(NamedTuple):
    t: float
    critical: float
    significant: bool


def t_tests(uncertainty: Uncertainty, level: float = 0.05) -> dict[str, Significance]:
    """Whether each unknown differs from zero, by Student's t with N - n_p degrees of freedom (4.3-4.5).

    Logarithms of noise parameters are left out, because zero has no meaning for them; see `fit.Intensity`.
    """
    fit = uncertainty.fit
    critical = float(special.stdtrit(max(1, fit.samples - len(fit.names)), 1 - level / 2))
    return {
        str(key): Significance(value / error, critical, bool(abs(value) > critical * error))
        for key, error, value in zip(fit.keys, uncertainty.standard_errors.values(), fit.values.tolist(), strict=True)
        if not key.is_noise
    }


class Whiteness(NamedTuple):
    """lag_one : correlation of successive residuals     p_value : of the Ljung-Box test; small if not white."""

    lag_one: float
    p_value: float


def whiteness(fit: Fit, lags: int = 20) -> dict[str, Whiteness]:
    """Test for each output whether residuals are white over `lags` lags (Ljung & Box 1978, Biometrika 65, 297).

    The mean of the residuals is not removed.
    """
    result = {}
    for i, name in enumerate(fit.model.outputs):
        products, pairs, n = np.zeros(lags + 1), np.zeros(lags + 1), 0
        for segment_fit in fit.segment_fits:
            e = np.nan_to_num(segment_fit.residuals[:, i])
            present = np.isfinite(segment_fit.residuals[:, i]).astype(float)
            for lag in range(min(lags, len(e) - 1) + 1):
                products[lag] += e[: len(e) - lag] @ e[lag:]
                pairs[lag] += present[: len(e) - lag] @ present[lag:]
            n += int(present.sum())
        r = products[1:] / products[0]
        usable = pairs[1:] > 0
        Q = float((n * (n + 2) * r[usable] ** 2 / pairs[1:][usable]).sum())
        result[name] = Whiteness(float(r[0]), float(special.chdtrc(usable.sum(), Q)))
    return result
