"""How far an estimate may be off: bounds, corrections for coloured residuals, and what follows from them.

The Cramer-Rao bound takes the residuals for white, which those of a flight are not; it is then several times too
small. `morelli_klein` uses the residuals' own autocorrelation, `block_bootstrap` their own stretches. None of them
sees an error that all data share and the model does not know.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft, special

from analysis.estimation import colored_residuals as coloring
from analysis.estimation.fit import Fit
from analysis.estimation.model import Named
from flight.errors import InputError

Array = NDArray[np.float64]

DIFFERENCE_STEP = 1e-3  # of a standard error: for derivatives of a user's function, which may be any Python


@dataclass(frozen=True)
class Uncertainty:
    """Covariance (m, m) of `fit.values`, in the order of `fit.names`, and where it comes from.

    prior_share : (m,) the part of each variance, 0 to 1, that the priors contribute
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
        errors = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(errors, errors)


def cramer_rao(fit: Fit) -> Uncertainty:
    """The Cramer-Rao bound (4.2) for white residuals, priors counted as measurements."""
    return _sandwich(fit, "Cramer-Rao", fit.information)


def morelli_klein(fit: Fit, autocorrelation: Literal["autoregressive", "raw"] = "autoregressive") -> Uncertainty:
    """Covariance for coloured residuals (Morelli & Klein 1997, J. Aircraft 34(5), 671).

    D [sum_i sum_j S_i' R^-1 Rnu(i-j) R^-1 S_j] D, all outputs with all, autocorrelation pooled over the segments,
    segments independent of each other. "raw" takes Rnu from the residuals as it is (biased estimate), which on 16 s of
    a coloured record leaves intervals that cover 90 % instead of 95; "autoregressive" models it, and makes good what
    the fit itself has taken out of the residuals (`coloring`): 93 to 94 %.
    """
    longest = max(len(piece.segment) for piece in fit.pieces)
    # Four times the longest record: what the autoregression still remembers after going round the circle is nothing.
    size = fft.next_fast_len(4 * longest)
    if autocorrelation == "raw":
        spectrum = coloring.spectrum_of(coloring.autocorrelation(fit, longest), size)
    else:
        spectrum = coloring.noise_spectrum(fit, size)
    middle = coloring.middle(fit, spectrum, size) + fit.spread_information
    return _sandwich(fit, f"Morelli-Klein ({autocorrelation})", middle)


def block_bootstrap(fit: Fit, *, block_s: float, draws: int = 500, seed: int = 0) -> Uncertainty:
    """Covariance by drawing the residuals anew in blocks of `block_s` seconds, linear about the estimate.

    A block must be long against the time over which residuals are correlated. Priors' means are drawn too.
    """
    rng = np.random.default_rng(seed)
    m = len(fit.names)
    score = np.zeros((draws, m))
    for piece in fit.pieces:
        e = piece.white.weight * piece.white.e
        n = len(e)
        length = min(n, max(1, round(block_s / piece.segment.step_s)))
        starts = rng.integers(0, n - length + 1, size=(draws, -(-n // length)))
        index = (starts[:, :, None] + np.arange(length)).reshape(draws, -1)[:, :n]
        drawn = (e - e.mean(axis=0))[index].reshape(draws, -1)
        score[:, piece.columns] += drawn @ piece.white.S.reshape(-1, len(piece.columns))
    return _sandwich(fit, "block bootstrap", np.cov(score, rowvar=False).reshape(m, m) + fit.spread_information)


def _sandwich(fit: Fit, method: str, middle: Array) -> Uncertainty:
    D = fit.covariance
    with np.errstate(invalid="ignore", divide="ignore"):  # inf and NaN stay what they are where nothing is known
        prior = D @ fit.prior_information @ D
        covariance = D @ middle @ D + prior
        return Uncertainty(fit, method, covariance, np.diag(prior) / np.diag(covariance))


class Derived(NamedTuple):
    """A quantity computed from the parameters, (k,), and its covariance (k, k)."""

    value: Array
    covariance: Array

    @property
    def standard_error(self) -> Array:
        return np.sqrt(np.diag(self.covariance))


def delta(uncertainty: Uncertainty, function: Callable[[Named], Any]) -> Derived:
    """Anything computed from the shared parameters, with its covariance to first order (the delta method).

    function : takes the parameters by name, p.CL0, gives a number or an array (a curve)
    """
    fit = uncertainty.fit

    def at(values: Array) -> Array:
        return np.atleast_1d(np.asarray(function(fit.shared(values)), dtype=float))

    h = DIFFERENCE_STEP * np.sqrt(np.diag(uncertainty.covariance))
    if not np.isfinite(h).all():
        raise InputError(f"the covariance is not finite, nothing can be derived from it: {fit.verdict}")
    gradient = np.stack([(at(fit.values + d) - at(fit.values - d)) for d in np.diag(h)], axis=1)
    gradient = np.divide(gradient, 2 * h, out=np.zeros_like(gradient), where=h > 0)
    return Derived(at(fit.values), gradient @ uncertainty.covariance @ gradient.T)


class Significance(NamedTuple):
    t: float
    critical: float
    significant: bool


def t_tests(uncertainty: Uncertainty, level: float = 0.05) -> dict[str, Significance]:
    """Whether each free number differs from zero: t against Student's t of N - n_p degrees of freedom (4.3-4.5).

    Logarithms of noises are left out: for them zero means nothing (see `filter_error.Intensity` instead).
    """
    fit = uncertainty.fit
    critical = float(special.stdtrit(max(1, fit.samples - len(fit.names)), 1 - level / 2))
    return {
        name: Significance(value / error, critical, bool(abs(value) > critical * error))
        for (name, error), value in zip(uncertainty.standard_errors.items(), fit.values.tolist(), strict=True)
        if not name.startswith(("ln w(", "ln v("))
    }


class Whiteness(NamedTuple):
    """lag_one : correlation of neighbouring residuals     p_value : of the Ljung-Box test, small if not white."""

    lag_one: float
    p_value: float


def whiteness(fit: Fit, lags: int = 20) -> dict[str, Whiteness]:
    """Per output, whether residuals are white over the first `lags` samples (Ljung & Box 1978, Biometrika 65, 297)."""
    result = {}
    for i, name in enumerate(fit.model.outputs):
        products, pairs, n = np.zeros(lags + 1), np.zeros(lags + 1), 0
        for piece in fit.pieces:
            e = np.nan_to_num(piece.residuals[:, i])
            present = np.isfinite(piece.residuals[:, i]).astype(float)
            for lag in range(min(lags, len(e) - 1) + 1):
                products[lag] += e[: len(e) - lag] @ e[lag:]
                pairs[lag] += present[: len(e) - lag] @ present[lag:]
            n += int(present.sum())
        r = products[1:] / products[0]
        usable = pairs[1:] > 0
        Q = float((n * (n + 2) * r[usable] ** 2 / pairs[1:][usable]).sum())
        result[name] = Whiteness(float(r[0]), float(special.chdtrc(usable.sum(), Q)))
    return result


def signal_to_noise(fit: Fit) -> dict[str, float]:
    """Per output, variance of the model's response over that of the residuals (4.6, 4.7), over all segments."""
    y = np.concatenate([piece.response.y for piece in fit.pieces])
    residuals = np.concatenate([piece.residuals for piece in fit.pieces])
    ratio = np.nanvar(np.where(np.isfinite(residuals), y, np.nan), axis=0) / np.nanvar(residuals, axis=0)
    return dict(zip(fit.model.outputs, ratio.tolist(), strict=True))


class BetweenRuns(NamedTuple):
    """Mean of separate fits, the covariance of that mean from their scatter, and their names."""

    names: tuple[str, ...]
    mean: Array
    covariance: Array


def between_runs(fits: Sequence[Fit]) -> BetweenRuns:
    """Shared parameters of one fit a run: their mean and what the scatter between runs says of it.

    Blind to whatever all runs have in common. Raises InputError for fewer than two fits.
    """
    if len(fits) < 2:
        raise InputError(f"scatter between runs needs at least two fits, there are {len(fits)}")
    names = tuple(q.name for q in fits[0].model.parameters if q.free and q.shared)
    values = np.array([[fit.parameters[name].value for name in names] for fit in fits])
    return BetweenRuns(names, values.mean(axis=0), np.cov(values, rowvar=False).reshape(len(names), -1) / len(fits))
