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


class FlightStack(NamedTuple):
    """Flights in the normal equations: arrays (n, M) or (n, M, M).

    values : the flights' own estimates
    information, vector : without the prior, deviations of a flight's own installation marginalized
    gain : derivative of `vector` by the flight's own estimate
    prior_part : derivative of the flight's own estimate by an error of the prior's mean
    own_covariance : of the flight's own estimate for given shared parameters
    changes : (n, M) by error that no residual shows and that all flights have in common
    """

    values: Array
    information: Array
    vector: Array
    gain: Array
    prior_part: Array
    own_covariance: Array
    changes: dict[str, Array]


class Prior(NamedTuple):
    """Mean and information of the shared parameters; information 0 where there is no prior."""

    mean: Array
    information: Array


class Group(NamedTuple):
    """Flights whose parameters are the same among all that are estimated.

    columns : (M,) where these are     counts : (n,) how many flights like each there are, each with its own errors
    """

    stack: FlightStack
    columns: NDArray[np.intp]
    counts: Array


class JointEstimate(NamedTuple):
    """The solution: x (k,), covariance (k, k) by noise and priors; influences (n, k, M) of each group's estimates.

    prior_part : (k, k) derivative of x by an error of the prior's mean     prior_covariance : (k,) variances
    total : (k, k) covariance with the errors that no residual shows, the floor of `analysis.drag.covariance` excepted
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


def stacked(flights: Sequence[FlightStatistics]) -> FlightStack:
    """Flights as arrays."""
    information, vector, gain, prior_part, own_covariance = (
        np.stack(part) for part in zip(*(_information(flight) for flight in flights), strict=True)
    )
    names = sorted({name for flight in flights for name in flight.changes} - OWN_CHANGES)
    changes = {name: np.stack([flight.changes.get(name, np.zeros(M)) for flight in flights]) for name in names}
    values = np.stack([flight.values for flight in flights])
    return FlightStack(values, information, vector, gain, prior_part, own_covariance, changes)


def take(stack: FlightStack, numbers: Sequence[int]) -> FlightStack:
    """Some of the flights, by number."""
    at = list(numbers)
    changes = {name: change[at] for name, change in stack.changes.items()}
    arrays = {name: getattr(stack, name)[at] for name in FlightStack._fields if name != "changes"}
    return FlightStack(**arrays, changes=changes)


def _information(flight: FlightStatistics) -> tuple[Array, Array, Array, Array, Array]:
    """Of `FlightStack`: information, vector, gain, prior_part, own_covariance."""
    P, S = np.diag(flight.prior_information), flight.covariance
    scale = np.sqrt(np.diag(S))
    own, vectors = np.linalg.eigh(np.linalg.inv(S / np.outer(scale, scale)) - P * np.outer(scale, scale))
    L = (vectors * np.maximum(own, 0.0)) @ vectors.T / np.outer(scale, scale)
    K = L + P
    excess = np.zeros((M, M))
    if own[0] < -1e-9 * own[-1]:  # the estimate is less certain than its prior: colored residuals, random draws
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
    return shrink @ L, shrink @ vector, shrink @ K, S @ P, own_covariance


def shared_prior(flights: Sequence[FlightStatistics]) -> Prior:
    """The prior of what the flights share; the widest, where theirs differ."""
    widest = np.min([flight.prior_information for flight in flights], axis=0)
    share = 1.0 if flights[0].installation else 1 - REMOUNTED**2
    return Prior(flights[0].prior_mean, np.where(_INSTALLATION, widest / share, widest))


def solve(groups: Sequence[Group], prior: Prior) -> JointEstimate:
    """Solve for all parameters (k,) that the flights share."""
    H, b = np.diag(prior.information), prior.information * prior.mean
    for stack, at, counts in groups:
        H[np.ix_(at, at)] += np.tensordot(counts, stack.information, 1)
        b[at] += counts @ stack.vector
    scale = 1 / np.sqrt(np.diag(H))
    C = np.linalg.inv(H * np.outer(scale, scale)) * np.outer(scale, scale)
    C = (C + C.T) / 2
    influences = [C[:, at] @ stack.gain for stack, at, _ in groups]
    with np.errstate(divide="ignore"):
        prior_covariance = np.where(prior.information > 0, 1 / prior.information, 0.0)
    prior_part = C * prior.information
    total = (prior_part * prior_covariance) @ prior_part.T
    changes: dict[str, Array] = {}
    for W, (stack, _, counts) in zip(influences, groups, strict=True):
        total += np.einsum("f,fij,fjk,flk->il", counts, W, stack.own_covariance, W, optimize=True)
        for name, change in stack.changes.items():
            changes[name] = changes.get(name, 0.0) + np.einsum("f,fij,fj->i", counts, W, change, optimize=True)
    for change in changes.values():
        total += np.outer(change, change)
    return JointEstimate(C @ b, C, influences, prior_part, prior_covariance, total)


def pooled_estimate(stack: FlightStack, prior: Prior, counts: Sequence[float] = ()) -> JointEstimate:
    """The joint estimate (M,) of flights of one aircraft and installation. counts: of `Group`; one where empty."""
    times = np.array(counts or np.ones(len(stack.values)), dtype=float)
    return solve([Group(stack, np.arange(M), times)], prior)
