"""Noise of the polar by errors of the reconstructed states and by what remains of the residuals without them.

The residuals of the runs contain the errors of the states: their slow part is hardly anything else. The covariance by
residuals and that by errors of the states must therefore not simply be added. The latter is propagated exactly. The
spectrum that errors of the states have in the residuals is estimated from random draws, and subtracted from the
spectrum of the residuals.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from analysis.estimation.colored_residuals import Autoregression, noise_spectrum, score_covariance, spectrum_order
from analysis.estimation.data import Segment
from analysis.estimation.fit import Fit
from analysis.estimation.model import NamedValues
from analysis.trajectory.reconstruction import Trajectory

Array = NDArray[np.float64]


STATE_STEP = 1e-4  # of the derivatives by the states [rad], [m/s]


def noise_covariance(fit: Fit, trajectory: Trajectory, segments_along: Callable[[Array], list[Segment]]) -> Array:
    """Covariance (m, m) of a fit with one output by errors of the states and by other noise.

    segments_along: the segments of the fit along states (n, nx) other than the most probable ones.
    """
    return _by_states(fit, trajectory, segments_along) + _by_rest(fit, trajectory, segments_along)


def _by_states(fit: Fit, trajectory: Trajectory, segments_along: Callable[[Array], list[Segment]]) -> Array:
    """Covariance (m, m) by the errors of the states for given sensor errors, propagated to first order."""
    states, t_s = trajectory.states.to_numpy(), trajectory.states.index.to_numpy()
    gradient = np.zeros((*states.shape, len(fit.names)))
    for i, step in enumerate(STATE_STEP * np.eye(states.shape[1])):
        for change, segment_fit in zip(_changes(fit, segments_along(states + step)), fit.segment_fits, strict=True):
            rows = np.searchsorted(t_s, segment_fit.segment.t_s)
            by_state = change[:, None] * segment_fit.white.S[:, 0] / STATE_STEP
            gradient[rows[:, None], i, segment_fit.columns] = by_state
    D = fit.covariance
    return np.asarray(D @ trajectory.states_given_errors.covariance_of(gradient) @ D)


def _by_rest(fit: Fit, trajectory: Trajectory, segments_along: Callable[[Array], list[Segment]]) -> Array:
    """Covariance (m, m) by the residuals, less what errors of the states explain of these.

    Per parameter it is at least that by the white part of the rest, as in `covariance.of_noise`.
    """
    states = trajectory.states.to_numpy()
    changes = [change for draw in trajectory.draws for change in _changes(fit, segments_along(states + draw))]
    samples, order = sum(len(change) for change in changes), spectrum_order(fit)
    gamma = np.zeros((order, 1, 1))
    for change in changes:
        for lag in range(min(order, len(change))):
            gamma[lag] += change[lag:] @ change[: len(change) - lag] / samples
    size = fft.next_fast_len(4 * max(len(segment_fit.segment) for segment_fit in fit.segment_fits))
    of_residuals = noise_spectrum(fit, size).real
    rest = of_residuals
    if gamma[0, 0, 0] > 0:
        rest = np.maximum(of_residuals - Autoregression.fitted(gamma, samples).spectrum(size).real, 0.0)
    D = fit.covariance
    prior = D @ fit.prior_information @ D
    colored = D @ score_covariance(fit, rest.astype(complex), size) @ D + prior
    white = D @ (fit.information * rest.mean() / of_residuals.mean()) @ D + prior
    scale = np.sqrt(np.maximum(1.0, np.diag(white) / np.diag(colored)))
    return np.asarray(colored * np.outer(scale, scale))


def _changes(fit: Fit, segments: list[Segment]) -> list[Array]:
    """Change of the whitened residuals (n,) by segment, 0 where a sample is missing."""
    (output,), p = fit.model.outputs, fit.shared()
    sigma = float(np.sqrt(fit.noise_covariance[0, 0]))
    residuals = fit.residuals
    changes = []
    for segment in segments:
        (modelled,) = fit.model.output_function(NamedValues("state", {}), NamedValues("input", segment.u), p)
        changes.append(np.nan_to_num(segment.z[output] - modelled - residuals[segment.name][:, 0]) / sigma)
    return changes
