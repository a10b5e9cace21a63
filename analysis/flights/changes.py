"""Finds the flight since which an airframe has had more drag or less thrust: steps and drifts over its flights.

Each flight estimates drag and thrust, both as a share of the airframe's own. The prior pulls on the estimate, so a
change of one parameter shows partly in the other; the model of the pool tells how much (`analysis.flights.joint`).
After each flight, generalized least squares find the best step and the best drift in both parameters, starting at any
flight. A change is reported if the fit improves by more than chance alone achieves once in the number of flights
allowed per false alarm (the generalized likelihood ratio; Basseville and Nikiforov 1993, sec. 2.4.3).
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.special import lambertw, ndtri

from flightpower.analysis.curve import POLAR
from flightpower.analysis.flights.agreement import ErrorParts, error_parts
from flightpower.analysis.flights.flight_statistics import POOLED, M
from flightpower.analysis.flights.joint_pool import JointPool
from flightpower.analysis.records.fleet import Shape, What
from flightpower.analysis.settings import EVIDENCE
from flightpower.flight.arrays import Array

_N_POLAR, _THRUST = len(POLAR), POOLED.index("thrust_scale")
_SHARES = len(("drag", "thrust"))


class Series(NamedTuple):
    """Drag and thrust of n flights as shares of the airframe's own.

    values : (n, 2)     by_truth : (n, 2, 2) change of the values per true change of drag and of thrust
    errors : k = 2
    """

    values: Array
    by_truth: Array
    errors: ErrorParts


class Change(NamedTuple):
    """A change that starts at one flight and lasts until the next change or the last flight.

    since, detected : indices of the first flight that differs and of the flight after which the change was reported
    drag, thrust : change as a share; for a drift, the change up to the last of these flights
    covariance : (2, 2) of drag and thrust
    """

    shape: Shape
    since: int
    detected: int
    drag: float
    thrust: float
    covariance: Array

    @property
    def errors(self) -> tuple[float, float]:
        """Standard errors of drag and thrust."""
        drag, thrust = np.sqrt(np.diag(self.covariance))
        return float(drag), float(thrust)

    @property
    def what(self) -> What:
        """BOTH if drag and thrust each differ from 0 at the level `EVIDENCE.rare_false_alarms`, else the more
        significant one."""
        z = np.abs([self.drag, self.thrust]) / self.errors
        sure = z > -ndtri(EVIDENCE.rare_false_alarms / 2)
        if sure.all():
            return What.BOTH
        return What.DRAG if z[0] > z[1] else What.PROPULSION


def series(pool: JointPool) -> Series:
    """Build the series of the flights of one airframe and configuration, at the middle lift coefficient flown."""
    flights, stack, A = pool.flights, pool.as_stated, pool.polar.A
    CL = np.sqrt(
        np.median([flight.flown_CL[0] for flight in flights]) * np.median([flight.flown_CL[1] for flight in flights])
    )
    gradient = CL ** np.arange(_N_POLAR)
    of_flight = np.zeros((_SHARES, M))
    of_flight[0, :_N_POLAR], of_flight[1, _THRUST] = gradient / (gradient @ A), 1.0
    changed = np.zeros((M, _SHARES))
    changed[:_N_POLAR, 0], changed[_THRUST, 1] = A, 1.0
    by_truth = of_flight @ (np.eye(M) - stack.prior_part) @ changed
    return Series(stack.values @ of_flight.T, by_truth, error_parts(stack, pool.prior, of_flight))


class FlightShares(NamedTuple):
    """Drag and thrust of n flights as shares of the airframe's own, less their mean before the first change.

    values, errors : (n, 2); the standard errors exclude errors that all flights share. NaN where a flight alone does
    not separate drag from thrust
    """

    values: Array
    errors: Array


def flight_shares(of_flights: Series, changes: Sequence[Change]) -> FlightShares:
    """Compute the shares from each flight alone; without a change, the mean is taken over all flights. changes : of
    `find_changes`"""
    values, by_truth, errors = of_flights
    seen = np.abs(np.linalg.det(by_truth)) > np.sqrt(np.finfo(float).eps)
    before = seen & (np.arange(len(values)) < min((change.since for change in changes), default=len(values)))
    weights = np.linalg.pinv(errors.own[before])
    mean = np.linalg.pinv(weights.sum(axis=0)) @ np.einsum("fij,fj->i", weights, values[before])
    back = np.full_like(by_truth, np.nan)
    back[seen] = np.linalg.inv(by_truth[seen])
    covariance = back @ errors.own @ back.transpose(0, 2, 1)
    return FlightShares(np.einsum("fij,fj->fi", back, values - mean), np.sqrt(np.einsum("fkk->fk", covariance)))


def least_gain(flights_per_false_alarm: float) -> float:
    """Return the drop in the weighted sum of squared residuals that chance exceeds once in so many flights."""
    # The improvement at one flight is chi-square with two degrees of freedom: it exceeds h at the rate exp(-h / 2). The
    # best improvement over all flights and both shapes does so h / 2 times as often, as the extremes of chi-square
    # fields do (Siegmund and Venkatraman 1995): h / 2 exp(-h / 2) is the rate of false alarms.
    return -2 * float(lambertw(-1 / max(flights_per_false_alarm, math.e), -1).real)


def find_changes(of_flights: Series, times: Array, flights_per_false_alarm: float) -> list[Change]:
    """Find all changes, in the order of the flights, as they would have been reported flight by flight.

    A single flight that differs from the flights before and after it is not a change, and is skipped.

    times : (n,) of the flights, ascending     flights_per_false_alarm : mean number of flights of an unchanged airframe
    between false alarms
    """
    threshold = least_gain(flights_per_false_alarm)
    equations = _normal_equations(of_flights)
    regular = np.arange(len(times))
    while True:
        changes = _reported(equations[regular], times[regular], threshold)
        odd = [change.since for change, following in pairwise(changes) if following.since == change.since + 1]
        if not odd:
            break
        regular = np.delete(regular, odd)
    return [
        change._replace(since=int(regular[change.since]), detected=int(regular[change.detected])) for change in changes
    ]


def _reported(equations: Array, times: Array, threshold: float) -> list[Change]:
    """Return the changes as reported flight by flight, each estimated from all flights until the next change."""
    reported: list[tuple[int, int, Shape]] = []
    start, n = 0, len(times)
    sums = _sums(equations, times)
    for end in range(3, n + 1):
        if end - start < 3:
            continue
        best = _best(sums, times, slice(start, end))
        if best.gain > threshold:
            reported.append((start, end - 1, best.shape))
            start = best.since if best.shape is Shape.STEP else end - 1
    changes = []
    for (begin, detected, _), following in pairwise([*reported, (n, n, Shape.STEP)]):
        best = _best(sums, times, slice(begin, max(following[0], detected + 1)))
        drag, thrust = best.change.tolist()
        changes.append(Change(best.shape, best.since, detected, drag, thrust, best.covariance))
    return changes


class _Best(NamedTuple):
    gain: float
    shape: Shape
    since: int
    change: Array
    covariance: Array


def _normal_equations(of_flights: Series) -> Array:
    """Return the products (n, c, c) of each flight's whitened columns: mean, shared errors, change, values."""
    values, by_truth, errors = of_flights
    n = len(values)
    columns = [np.broadcast_to(np.eye(_SHARES), (n, _SHARES, _SHARES)), errors.shared, by_truth, values[:, :, None]]
    white = errors.whitened(np.concatenate(columns, axis=2))
    return np.asarray(white.transpose(0, 2, 1) @ white)


class _Sums(NamedTuple):
    """Running sums over flights: entry i, of n + 1, covers the flights before i. There are c columns.

    products : (n + 1, c, c) products of all columns
    change : (3, n + 1, c, 2) products with the two columns of the change, times powers 0 to 2 of the time since the
    first flight
    """

    products: Array
    change: Array


def _sums(equations: Array, times: Array) -> _Sums:
    """Return running sums of _normal_equations; the sum over any stretch of flights is a difference of two of them."""
    since = (times - times[0])[:, None, None]
    with_change = equations[:, :, -1 - _SHARES : -1]
    return _Sums(_before_each(equations), np.stack([_before_each(since**power * with_change) for power in (0, 1, 2)]))


def _before_each(of_flights: Array) -> Array:
    return np.concatenate([np.zeros_like(of_flights[:1]), of_flights.cumsum(axis=0)])


def _best(sums: _Sums, times: Array, part: slice) -> _Best:
    """Return the step or drift that improves the fit most and starts at the second flight of a part or later."""
    G, t = sums.products[part.stop] - sums.products[part.start], (times[part] - times[0])[:, None, None]
    before = len(G) - 1 - _SHARES  # number of columns for mean and shared errors
    change, value = slice(before, before + _SHARES), -1
    A = G[:before, :before]
    A[_SHARES:, _SHARES:] += np.eye(before - _SHARES)
    inverse = np.linalg.inv(A)
    explained = inverse @ G[:before, value]
    zeroth, first, second = sums.change[:, part.stop, None] - sums.change[:, part.start + 1 : part.stop]
    start = t[:-1]  # a drift starts from the flight before
    lasts = t[-1] > start  # a drift needs flights at different times
    length = np.where(lasts, t[-1] - start, 1.0)
    candidates = []
    for shape, possible, linear, square in (
        (Shape.STEP, np.ones(len(t) - 1, dtype=bool), zeroth, zeroth[:, change]),
        (
            Shape.DRIFT,
            lasts.ravel(),
            (first - start * zeroth) / length,
            (second - 2 * start * first + start**2 * zeroth)[:, change] / length**2,
        ),
    ):
        B = linear[:, :before]
        information = square - B.transpose(0, 2, 1) @ inverse @ B
        vector = linear[:, value] - explained @ B
        seen = possible & (np.linalg.eigvalsh(information)[:, 0] > np.finfo(float).eps * np.trace(square[0]))
        information[~seen] = np.eye(_SHARES)
        estimate = np.linalg.solve(information, vector[:, :, None])[:, :, 0]
        gain = np.where(seen, np.sum(estimate * vector, axis=1), 0.0)
        k = int(np.argmax(gain))
        candidates.append(_Best(float(gain[k]), shape, part.start + 1 + k, estimate[k], np.linalg.inv(information[k])))
    return max(candidates, key=lambda candidate: candidate.gain)
