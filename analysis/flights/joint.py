"""The joint estimate of several flights: normal equations for the parameters they share, with each prior used once.

A flight is estimated in two steps: the errors of its installation along the flight path, and then drag and thrust for
these errors. The information that drag contains on these errors is not used, so a pool must not use it either:
otherwise the prior of thrust would move the airspeed scale. Each step adds the normal equations of all flights without
their priors, and then the prior once (Tapley et al. 2004, sec. 4.5): first for the errors alone, then for drag and
thrust at the pooled errors. The combined matrix is block triangular. A flight's own errors (biases of the IMU, wind,
gusts, zeros) have been marginalized: they are in its covariance.

Unless a flight's file states that the probe stayed mounted, each flight has its own deviation, with the variance Q,
from the shared errors of the installation. The variance of the shared part's prior is smaller by Q, so that a single
flight still has its own prior. A flight that contradicts the installation stated for it is treated as remounted: its
deviation has the variance of the prior.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.flights.flight_statistics import INSTALLATION_ERRORS, POOLED, FlightStatistics, M
from flightpower.analysis.flights.pool_settings import POOLING
from flightpower.analysis.methods.assumed_values import ZERO_STEPS
from flightpower.analysis.methods.consider import DENSITY, UPDRAFT
from flightpower.analysis.uncertain import Uncertain
from flightpower.flight.arrays import Array

# Errors that no residual shows and that are separate for each flight; all others are common to all flights.
OWN_CHANGES = frozenset({UPDRAFT, DENSITY, *ZERO_STEPS.values()})
_INSTALLATION = np.array([name in INSTALLATION_ERRORS for name in POOLED])


class FlightStack(NamedTuple):
    """Flights in the normal equations: arrays (n, M) or (n, M, M).

    values : the flights' own estimates
    normal_matrix, vector : matrix and right-hand side of the normal equations without the prior; deviations of a
        flight's own installation are marginalized
    gain : derivative of `vector` with respect to the flight's own estimate
    prior_part : derivative of the flight's own estimate with respect to an error of the prior's mean
    own_covariance : of the flight's own estimate for given shared parameters
    changes : (n, M) changes of the estimates by each error that no residual shows and that all flights have in common
    """

    values: Array
    normal_matrix: Array
    vector: Array
    gain: Array
    prior_part: Array
    own_covariance: Array
    changes: dict[str, Array]


class Prior(NamedTuple):
    """Prior of the shared parameters (k,): information (k, k), 0 if none, and information times mean (k,)."""

    information: Array
    vector: Array

    @property
    def covariance(self) -> Array:
        """Covariance (k, k); 0 where there is no prior."""
        informed = np.diag(self.information) > 0
        covariance = np.zeros(self.information.shape)
        own = self.information[np.ix_(informed, informed)]
        scale = 1 / np.sqrt(np.diag(own))
        off_diagonal = own - np.diag(np.diag(own))
        if not off_diagonal.any():
            covariance[informed, informed] = 1 / np.diag(own)
        else:
            covariance[np.ix_(informed, informed)] = np.linalg.inv(own * np.outer(scale, scale)) * np.outer(
                scale, scale
            )
        return covariance


class Group(NamedTuple):
    """Flights with the same M parameters among all that are estimated.

    columns : (M,) positions of these parameters in the solution
    counts : (n,) how many flights like each there are, each with its own errors
    """

    stack: FlightStack
    columns: NDArray[np.intp]
    counts: Array


class WithoutEach(NamedTuple):
    """The joint estimates of n - 1 flights, leaving out each of n flights in turn.

    x : (n, M)     prior_part : (n, M, M) derivative of x with respect to an error of the prior's mean
    by_others : (n, M, M) covariance from the other flights' own errors
    changes : (n, M) changes of x by each error that all flights have in common
    """

    x: Array
    prior_part: Array
    by_others: Array
    changes: dict[str, Array]

    def total(self, prior_covariance: Array) -> Array:
        """Return the covariance (n, M, M) from all errors."""
        by_changes = sum(change[:, :, None] * change[:, None, :] for change in self.changes.values())
        return np.asarray(_congruent(self.prior_part, prior_covariance) + self.by_others + by_changes)


class PooledEstimate(NamedTuple):
    """The solution (k,), and influences (n, k, M) of each group's estimates on it.

    parameters : their `shared` errors are those that no residual shows, without the floor of
    `analysis.methods.consider`
    prior_part : (k, k) derivative of the solution with respect to an error of the prior's mean
    prior_covariance : (k, k)
    """

    parameters: Uncertain
    influences: list[Array]
    prior_part: Array
    prior_covariance: Array


def remounting_variance(flight: FlightStatistics, *, remounted: bool) -> Array:
    """Return the variance (M,) of a flight's own deviations: 0 if its installation has a name, unless it was remounted.

    remounted : whether the flight contradicts the installation's name
    """
    if flight.installation and not remounted:
        return np.zeros(M)
    share = 1.0 if remounted else POOLING.remounted
    with np.errstate(divide="ignore"):
        return np.where(_INSTALLATION, share**2 / flight.prior_information, 0.0)


def stacked(flights: Sequence[FlightStatistics], remounted: Collection[int] = ()) -> FlightStack:
    """Return flights as arrays. remounted: numbers of flights to treat as remounted, whatever their files say."""
    normal_matrix, vector, gain, prior_part, own_covariance = (
        np.stack(part)
        for part in zip(
            *(
                _normal_equations(flight, remounting_variance(flight, remounted=i in remounted))
                for i, flight in enumerate(flights)
            ),
            strict=True,
        )
    )
    names = sorted({name for flight in flights for name in flight.parameters.shared} - OWN_CHANGES)
    changes = {
        name: np.stack([flight.parameters.shared.get(name, np.zeros(M)) for flight in flights]) for name in names
    }
    values = np.stack([flight.parameters.value for flight in flights])
    return FlightStack(values, normal_matrix, vector, gain, prior_part, own_covariance, changes)


def take(stack: FlightStack, numbers: Sequence[int]) -> FlightStack:
    """Return some of the flights, by number."""
    indices = list(numbers)
    changes = {name: change[indices] for name, change in stack.changes.items()}
    arrays = {name: getattr(stack, name)[indices] for name in FlightStack._fields if name != "changes"}
    return FlightStack(**arrays, changes=changes)


class _DataInformation(NamedTuple):
    """What the data contribute: information (k, k) without the prior, and the excess (k, k) of the estimate's
    covariance over what information and prior give (from colored residuals and random draws)."""

    information: Array
    excess: Array


def _without_prior(covariance: Array, prior: Array) -> _DataInformation:
    """Return the information of the data alone, from an estimate whose covariance includes the prior's (k, k)."""
    scale = np.sqrt(np.diag(covariance))
    own, vectors = np.linalg.eigh(np.linalg.inv(covariance / np.outer(scale, scale)) - prior * np.outer(scale, scale))
    information = (vectors * np.maximum(own, 0.0)) @ vectors.T / np.outer(scale, scale)
    excess = np.zeros_like(covariance)
    if own[0] < -1e-9 * own[-1]:
        excess = covariance - np.linalg.inv(information + prior)
    return _DataInformation(information, excess)


def _normal_equations(flight: FlightStatistics, Q: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Return the terms of `FlightStack` for one flight. Q: (M,) variances of its own deviations.

    s: errors of the installation, estimated in the first step, with the covariance S_ss. r: drag and thrust, estimated
    in the second step; they change by `slope` times s and have the covariance S_rr - slope S_ss slope' for given s. D,
    the covariance for white residuals, weighted their data and priors.
    """
    P, S = flight.prior_matrix, flight.parameters.own
    s, r = np.flatnonzero(_INSTALLATION), np.flatnonzero(~_INSTALLATION)
    ss, rr, rs = np.ix_(s, s), np.ix_(r, r), np.ix_(r, s)
    slope = np.linalg.solve(S[ss], S[rs].T).T
    first = _without_prior(S[ss], P[ss])
    D = flight.weighting_covariance
    second = _DataInformation(_inverse(D) - P[rr], S[rr] - slope @ S[rs].T - D)
    gain, inverse, noise, excess = (np.zeros((M, M)) for _ in range(4))
    gain[ss], gain[rr] = first.information + P[ss], second.information + P[rr]
    gain[rs] = -gain[rr] @ slope
    inverse[ss], inverse[rr] = np.linalg.inv(gain[ss]), np.linalg.inv(gain[rr])
    inverse[rs] = slope @ inverse[ss]
    noise[ss], noise[rr] = first.information, second.information
    by_first = np.zeros((M, len(s)))
    by_first[s], by_first[r] = np.eye(len(s)), slope
    excess[rr] = second.excess
    excess = excess + by_first @ first.excess @ by_first.T

    normal_matrix, vector = gain - P, gain @ flight.parameters.value - flight.prior_vector
    moved = Q > 0
    shrink = np.eye(M)
    if moved.any():
        inner = np.linalg.inv(normal_matrix[np.ix_(moved, moved)] + np.diag(1 / Q[moved]))
        shrink[:, moved] -= normal_matrix[:, moved] @ inner
    score = noise + normal_matrix @ np.diag(Q) @ normal_matrix.T
    own_covariance = inverse @ score @ inverse.T + excess
    for name, change in flight.parameters.shared.items():
        if name in OWN_CHANGES:
            own_covariance = own_covariance + np.outer(change, change)
    return shrink @ normal_matrix, shrink @ vector, shrink @ gain, inverse @ P, own_covariance


def shared_prior(flights: Sequence[FlightStatistics]) -> Prior:
    """Return the prior of the shared parameters; the widest if flights differ. The stand's measurement is taken from
    the first flight: flights with one propeller share it."""
    widest = np.min([flight.prior_information for flight in flights], axis=0)
    share = 1.0 if flights[0].installation else 1 - POOLING.remounted**2
    own = np.where(_INSTALLATION, widest / share, widest)
    measured = flights[0].prior_measurements
    return Prior(
        sum((prior_measurement.information for prior_measurement in measured), np.diag(own)),
        sum((prior_measurement.vector for prior_measurement in measured), own * flights[0].prior_mean),
    )


def solve(groups: Sequence[Group], prior: Prior) -> PooledEstimate:
    """Solve for all shared parameters (k,)."""
    H, b = prior.information.copy(), prior.vector.copy()  # not symmetric: the first step ignores the second
    for stack, indices, counts in groups:
        H[np.ix_(indices, indices)] += np.tensordot(counts, stack.normal_matrix, 1)
        b[indices] += counts @ stack.vector
    solution = _inverse(H)
    influences = [solution[:, indices] @ stack.gain for stack, indices, _ in groups]
    prior_covariance = prior.covariance
    prior_part = solution @ prior.information
    own = prior_part @ prior_covariance @ prior_part.T
    changes: dict[str, Array] = {}
    for W, (stack, _, counts) in zip(influences, groups, strict=True):
        own += np.einsum("f,fij,fjk,flk->il", counts, W, stack.own_covariance, W, optimize=True)
        for name, change in stack.changes.items():
            changes[name] = changes.get(name, 0.0) + np.einsum("f,fij,fj->i", counts, W, change, optimize=True)
    return PooledEstimate(Uncertain(solution @ b, own, changes), influences, prior_part, prior_covariance)


def pooled_estimate(stack: FlightStack, prior: Prior, counts: Sequence[float] = ()) -> PooledEstimate:
    """Return the joint estimate (M,) of flights of one aircraft and installation. counts: as in `Group`; default 1."""
    repeats = np.array(counts or np.ones(len(stack.values)), dtype=float)
    return solve([Group(stack, np.arange(M), repeats)], prior)


def without_each(stack: FlightStack, prior: Prior) -> WithoutEach:
    """Return the joint estimates that leave out each flight in turn; requires at least two flights."""
    noise = _congruent(stack.gain, stack.own_covariance)
    gained = {name: np.einsum("fij,fj->fi", stack.gain, change) for name, change in stack.changes.items()}
    solution = _inverse(prior.information + _sum_over_others(stack.normal_matrix))
    return WithoutEach(
        np.einsum("fij,fj->fi", solution, prior.vector + _sum_over_others(stack.vector)),
        solution @ prior.information,
        _congruent(solution, _sum_over_others(noise)),
        {name: np.einsum("fij,fj->fi", solution, _sum_over_others(change)) for name, change in gained.items()},
    )


def _sum_over_others(of_flights: Array) -> Array:
    """Return, for each flight, the sum over all other flights."""
    return np.asarray(of_flights.sum(axis=0) - of_flights)


def _congruent(W: Array, C: Array) -> Array:
    """Return W C W', where W and C are (..., M, M)."""
    return np.asarray(W @ C @ np.swapaxes(W, -1, -2))


def _inverse(H: Array) -> Array:
    """Invert matrices (..., k, k) whose parameters have different units."""
    scale = 1 / np.sqrt(np.diagonal(H, axis1=-2, axis2=-1))
    scales = scale[..., :, None] * scale[..., None, :]
    return np.asarray(np.linalg.inv(H * scales) * scales)
