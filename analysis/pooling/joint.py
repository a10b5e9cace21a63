"""The joint estimate of several flights: normal equations over what they share, each prior used once.

Flight f estimates v_f with covariance S_f, prior included. Its information without the prior is L_f = S_f^-1 - P. The
pool has the information P + sum L_f (Bayesian linear update; Tapley et al. 2004, sec. 4.5). The flight's own errors
(biases of the IMU, wind, gusts, zeros) have been marginalized: they are in S_f.

Where nothing says that the probe stayed mounted, each flight has its own deviation from the shared errors of the
installation, with the variance Q. The prior of the shared part is smaller by Q, so that a single flight has its own
prior again.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.drag.consider import UPDRAFT
from analysis.pooling.flight_statistics import INSTALLATION, POOLED, FlightStatistics, M

Array = NDArray[np.float64]

# Standard deviation of what moves when the probe is taken off and put on again, as a part of the prior's: 0.3 deg of
# angle of attack, 0.4 % of airspeed.
REMOUNTED = 0.3
OWN_CHANGES = frozenset({UPDRAFT})  # errors that each flight has its own of; all others are common to all flights
_INSTALLATION = np.array([name in INSTALLATION for name in POOLED])


class Information(NamedTuple):
    """One flight in the normal equations; arrays (M, M) unless stated otherwise.

    matrix, vector (M,) : information without the prior, deviations of its own installation marginalized
    gain : derivative of `vector` by the flight's own estimate
    prior_part : derivative of the flight's own estimate by an error of the prior's mean
    own_covariance : of the flight's own estimate for given shared parameters
    """

    matrix: Array
    vector: Array
    gain: Array
    prior_part: Array
    own_covariance: Array


class JointEstimate(NamedTuple):
    """The solution: x (n,), covariance (n, n) by noise and priors, and the influence (n, M) of each flight's estimate.

    prior_part : (n, n) derivative of x by an error of the prior's mean     prior_covariance : (n,) variances
    total : (n, n) covariance with the errors that no residual shows, the floor of `analysis.drag.covariance` excepted
    """

    x: Array
    covariance: Array
    influences: list[Array]
    prior_part: Array
    prior_covariance: Array
    total: Array


def remounting_variance(flight: FlightStatistics) -> Array:
    """Variance (M,) of a flight's own deviations: 0 where the installation has a name."""
    with np.errstate(divide="ignore"):
        variance = np.where(_INSTALLATION, REMOUNTED**2 / flight.prior_information, 0.0)
    return np.zeros(M) if flight.installation else variance


def information(flight: FlightStatistics) -> Information:
    """The flight's contribution to the normal equations."""
    P, S = np.diag(flight.prior_information), flight.covariance
    scale = np.sqrt(np.diag(S))
    own, vectors = np.linalg.eigh(np.linalg.inv(S / np.outer(scale, scale)) - P * np.outer(scale, scale))
    L = (vectors * np.maximum(own, 0.0)) @ vectors.T / np.outer(scale, scale)
    K = L + P
    excess = np.zeros((M, M))
    if own[0] < -1e-9 * own[-1]:  # the estimate is less certain than its prior: rounding, or colored residuals
        excess = S - np.linalg.inv(K)
        S = np.linalg.inv(K)
    vector = K @ flight.values - P @ flight.prior_mean
    Q = remounting_variance(flight)
    moved = Q > 0
    shrink = np.eye(M)
    if moved.any():
        inner = np.linalg.inv(L[np.ix_(moved, moved)] + np.diag(1 / Q[moved]))
        shrink[:, moved] -= L[:, moved] @ inner
    own_covariance = S @ (L + L @ np.diag(Q) @ L) @ S + excess
    for name, change in flight.changes.items():
        if name in OWN_CHANGES:
            own_covariance = own_covariance + np.outer(change, change)
    return Information(shrink @ L, shrink @ vector, shrink @ K, S @ P, own_covariance)


def shared_prior(flights: Sequence[FlightStatistics]) -> tuple[Array, Array]:
    """Mean and information (M,) of the prior of what the flights share; the widest, where theirs differ."""
    widest = np.min([flight.prior_information for flight in flights], axis=0)
    share = 1.0 if flights[0].installation else 1 - REMOUNTED**2
    return flights[0].prior_mean, np.where(_INSTALLATION, widest / share, widest)


def solve(
    flights: Sequence[FlightStatistics],
    informations: Sequence[Information],
    columns: Sequence[NDArray[np.intp]],
    prior_mean: Array,
    prior_information: Array,
    counts: Sequence[int] = (),
) -> JointEstimate:
    """Solve for all shared parameters (n,).

    columns : (M,) of each flight, where its parameters are among them
    counts : how many flights like it there are, each with its own errors; one where it is empty
    """
    times = counts or [1] * len(flights)
    H, b = np.diag(prior_information), prior_information * prior_mean
    for info, at, count in zip(informations, columns, times, strict=True):
        H[np.ix_(at, at)] += count * info.matrix
        b[at] += count * info.vector
    scale = 1 / np.sqrt(np.diag(H))
    C = np.linalg.inv(H * np.outer(scale, scale)) * np.outer(scale, scale)
    C = (C + C.T) / 2
    influences = [C[:, at] @ info.gain for info, at in zip(informations, columns, strict=True)]
    with np.errstate(divide="ignore"):
        prior_covariance = np.where(prior_information > 0, 1 / prior_information, 0.0)
    prior_part = C * prior_information
    total = (prior_part * prior_covariance) @ prior_part.T
    for influence, info, count in zip(influences, informations, times, strict=True):
        total += count * influence @ info.own_covariance @ influence.T
    for name in common_changes(flights):
        changes = [
            count * W @ flight.changes.get(name, np.zeros(M))
            for W, flight, count in zip(influences, flights, times, strict=True)
        ]
        change = np.sum(changes, axis=0)
        total += np.outer(change, change)
    return JointEstimate(C @ b, C, influences, prior_part, prior_covariance, total)


def common_changes(flights: Sequence[FlightStatistics]) -> list[str]:
    """Names of the errors that no residual shows and that all flights have in common."""
    return sorted({name for flight in flights for name in flight.changes} - OWN_CHANGES)


def pooled_estimate(
    flights: Sequence[FlightStatistics], informations: Sequence[Information], counts: Sequence[int] = ()
) -> JointEstimate:
    """The joint estimate (M,) of flights of one aircraft and installation. counts: as in `solve`."""
    at = np.arange(M)
    return solve(flights, informations, [at] * len(flights), *shared_prior(flights), counts)
