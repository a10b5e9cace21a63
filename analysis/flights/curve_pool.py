"""The pool of flights that contribute curves of electrical power, without installation, drag or thrust.

At one lift coefficient, power over V³ρ is the same at every weight and density, and so is the argument of the
efficiency. So curves are reduced to one condition by V √(W0 ρ / (W ρ0)) and (P - idle) (W0/W)^1.5 √(ρ/ρ0).

Each flight has its own errors (air motion, the airspeed's zero, a mean updraft). The other errors are the same in all
flights of an aircraft: the scales of current meter and airspeed, mass, thermometer, power with the motor off, and how
far the priors are from the truth. These do not average out in a pool, but cancel between two pools of one aircraft.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from msgspec import structs
from scipy.interpolate import CubicSpline

from flightpower.analysis.curve import Condition, Curve
from flightpower.analysis.flights.agreement import (
    Compared,
    ErrorParts,
    LargestDifference,
    Test,
    chi_square_test,
    common_values,
    of_difference,
    outliers,
    quadratic_form,
)
from flightpower.analysis.flights.evidence import shape_text, vehicle_notes
from flightpower.analysis.flights.flight_statistics import FlightCurve
from flightpower.analysis.flights.pool_settings import POOLING
from flightpower.analysis.flights.pooled import Pool, refuse_repeated
from flightpower.analysis.performance.autopilot_parameters import of_electrical_pool
from flightpower.analysis.performance.other_weights import electrical_at_weights
from flightpower.analysis.performance.request import Request
from flightpower.analysis.records.flight import CurveResult, Kind
from flightpower.analysis.records.pool import PooledResults
from flightpower.analysis.results.curves import curve_result, power_statistics
from flightpower.analysis.results.settings import TRUST
from flightpower.analysis.settings import CURVES
from flightpower.analysis.uncertain import Uncertain, total, variances
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError


class CurveDifference(NamedTuple):
    """Power of one pool minus the power of another at V_mps (n,). power_W : of the other pool"""

    V_mps: Array
    power_W: Array
    value_W: Uncertain

    @property
    def share(self) -> Uncertain:
        """The difference as a fraction (n,) of the other pool's power."""
        return self.value_W.through(np.diag(1 / self.power_W))

    @property
    def test(self) -> LargestDifference:
        """Tests whether there is a difference at any speed."""
        return of_difference(self.share.value, self.share.covariance)


class FlightDifference(NamedTuple):
    """One flight compared with the pool of the other flights.

    p : from a chi-square test at the first, the middle and the last speed, as in `agreement.Difference`; a flight that
    differs by the same share everywhere, for example by its weight, shows at all three
    share, error : the difference as a share, mean over the speeds, and its standard error
    """

    p: float
    share: float
    error: float

    @property
    def p_installation(self) -> float | None:
        return None


@dataclass(frozen=True)
class CurvePool(Pool):
    """Flights with their curves at the condition of the pool. V_mps : (n,) speeds that at least one flight flew"""

    kind = Kind.ELECTRICAL
    flights: tuple[FlightCurve, ...]
    curves: tuple[Curve, ...]
    V_mps: Array

    @cached_property
    def curve(self) -> Curve:
        first, *_ = self.curves
        idle_W = float(np.mean([curve.idle_W for curve in self.curves]))
        return replace(first, V_mps=self.V_mps, power_W=self.smooth_mean(), idle_W=idle_W)

    @cached_property
    def ends_mps(self) -> tuple[float, float]:
        """The slowest and the fastest speed that half of the flights reach."""
        slow, fast = (float(np.median([curve.V_mps[end] for curve in self.curves])) for end in (0, -1))
        return slow, fast

    @cached_property
    def speeds_mps(self) -> Array:
        return np.linspace(*self.ends_mps, POOLING.compared_speeds)

    def power(self, V: Array) -> tuple[Array, Array]:
        """Return electrical power and its standard error [W], each (k,), at speeds V (k,) [m/s] that were flown."""
        speeds, power_W = self.curve.V_mps, self.curve.power_W
        return np.interp(V, speeds, power_W.value), np.interp(V, speeds, power_W.standard_error)

    def mean(self, V: Array, counts: Sequence[float] = ()) -> Uncertain:
        """Return, at each speed (n,), the mean of the curves that contain it, weighted by the inverse variance of their
        own errors; NaN where no curve does. counts: how many flights like each one to assume, each with its own
        errors"""
        return total(self._parts(V, self._weights(V, counts), counts))

    def smooth_mean(self, counts: Sequence[float] = ()) -> Uncertain:
        """Return the mean at the pool's speeds (n,), without its steps where a flight's curve begins or ends."""
        power_W = self.mean(self.V_mps, counts)
        ends = {(curve.V_mps[0], curve.V_mps[-1]) for curve in self.curves}
        return power_W.through(_smoothing(self.V_mps, power_W.standard_error)) if len(ends) > 1 else power_W

    def some(self, numbers: Sequence[int]) -> "CurvePool":
        """Return the pool of some of the flights, by number."""
        flights, curves = tuple(self.flights[i] for i in numbers), tuple(self.curves[i] for i in numbers)
        V = self.V_mps[np.any([curve.covers(self.V_mps) for curve in curves], axis=0)]
        return CurvePool(flights, self.condition, curves, V)

    def _weights(self, V: Array, counts: Sequence[float] = ()) -> Array:
        """Return the weights (flights, n) of the curves; each column sums to 1."""
        times = np.ones(len(self.curves)) if len(counts) == 0 else np.array(counts, dtype=float)
        B = self._interpolation(V)
        variance = np.stack([variances(b, curve.power_W.own) for b, curve in zip(B, self.curves, strict=True)])
        weight = np.where([curve.covers(V) for curve in self.curves], times[:, None] / variance, 0.0)
        with np.errstate(invalid="ignore"):
            return np.asarray(weight / weight.sum(axis=0))

    def _parts(self, V: Array, weights: Array, counts: Sequence[float] = ()) -> list[Uncertain]:
        """Return each curve times its weights (flights, n); the own errors of several like flights average out."""
        times = np.ones(len(self.curves)) if len(counts) == 0 else np.maximum(np.array(counts, dtype=float), 1.0)
        parts = []
        for b, w, curve, n in zip(self._interpolation(V), weights, self.curves, times, strict=True):
            part = curve.power_W.through(w[:, None] * b)
            parts.append(replace(part, own=part.own / n))
        return parts

    def _interpolation(self, V: Array) -> list[Array]:
        """Return, for each curve, the derivative of its power at V with respect to its power at its own speeds."""
        return [
            CubicSpline(curve.V_mps, np.eye(len(curve.V_mps)))(np.clip(V, curve.V_mps[0], curve.V_mps[-1]))
            for curve in self.curves
        ]

    @cached_property
    def differences(self) -> Sequence[Compared]:
        return self._compared(list(range(len(self.flights))))

    def _compared(self, numbers: list[int]) -> list[FlightDifference]:
        """Compare each selected flight with the pool of the others; empty if a flight shares no speeds with them."""
        differences = []
        for i in numbers:
            others = [j for j in numbers if j != i]
            if not others:
                return []
            try:
                difference = curve_difference(self.some([i]), self.some(others), shares_errors=True)
            except InputError:
                return []
            n = len(difference.V_mps)
            mean, three = difference.share.through(np.full((1, n), 1 / n)), difference.share.at([0, n // 2, n - 1])
            p = chi_square_test(float(quadratic_form(three.value, three.covariance)), len(three.value)).p
            differences.append(FlightDifference(p, float(mean.value.item()), float(mean.standard_error.item())))
        return differences

    @cached_property
    def outliers(self) -> dict[int, Compared]:
        if not self.differences:
            return {}
        return dict(outliers(len(self.flights), self._compared, TRUST.false_alarm_rate))

    def reason(self, difference: Compared) -> str:
        assert isinstance(difference, FlightDifference)  # the type that these flights give
        return shape_text(difference.share, difference.error)

    @cached_property
    def homogeneity(self) -> Test | None:
        """Test of whether flights agree at three speeds; None for one flight, or if no two flights share a speed."""
        slow, fast = self.ends_mps
        if len(self.flights) < 2 or slow >= fast:
            return None
        V = np.linspace(slow, fast, 3)
        values, errors = self._shares(V)
        unknown = int(np.sum(~np.array([curve.covers(V) for curve in self.curves])))
        if len(self.flights) * len(V) - unknown <= len(V):
            return None
        return common_values(values, errors, unknown)

    def _shares(self, V: Array) -> tuple[Array, ErrorParts]:
        """Return each flight's power at V (k,) minus the pool's, as shares (flights, k) of the pool's, with their
        errors. At a speed that a flight did not fly, its error is set larger than any other."""
        power = self.mean(V).value
        parts = self._parts(V, np.ones((len(self.curves), len(V))) / power)
        names = list(dict.fromkeys(name for part in parts for name in part.shared))
        values, own, shared = [], [], []
        for curve, part in zip(self.curves, parts, strict=True):
            covered = curve.covers(V)
            values.append(np.where(covered, part.value - 1, 0.0))
            own.append(np.where(np.outer(covered, covered), part.own, np.eye(len(V)) / np.finfo(float).eps))
            changes = [part.shared.get(name, np.zeros(len(V))) for name in names]
            shared.append(np.where(covered[:, None], np.array(changes).reshape(len(names), len(V)).T, 0.0))
        return np.stack(values), ErrorParts(np.stack(own), np.stack(shared))

    def half_widths_percent(self, counts: Sequence[int], V: Array) -> Array:
        return np.asarray(100 * self._half_width(V, counts) / self.power(V)[0])

    def half_widths_alone_percent(self, number: int, V: Array) -> Array:
        return np.asarray(100 * self.some([number])._half_width(V) / self.power(V)[0])

    def half_widths_without_percent(self, V: Array) -> Array:
        n = len(self.flights)
        without = [self.some([j for j in range(n) if j != i])._half_width(V) for i in range(n)]
        return np.nan_to_num(100 * np.stack(without) / self.power(V)[0], nan=np.inf)

    def _half_width(self, V: Array, counts: Sequence[float] = ()) -> Array:
        """Return the half width [W] of the smooth mean at speeds V (k,); NaN outside the range flown."""
        half_width_W = self.smooth_mean(counts).half_width
        return np.asarray(np.interp(V, self.V_mps, half_width_W, left=np.nan, right=np.nan))

    def deviations(self) -> list[tuple[Array, Array]]:
        V = self.speeds_mps
        weights, power = self._weights(V), self.mean(V).value
        deviations = []
        for i, curve in enumerate(self.curves):
            of_difference = -weights
            of_difference[i] += 1
            difference = total(self._parts(V, of_difference))
            covered = np.where(curve.covers(V), 1.0, np.nan)
            deviations.append((100 * covered * difference.value / power, 100 * covered * difference.half_width / power))
        return deviations

    def deviations_for_trends(self) -> tuple[Array, ErrorParts]:
        values, errors = self._shares(self.speeds_mps)
        index = int(np.argmin(np.einsum("fkk->k", errors.own)))
        own, shared = errors.own[:, index : index + 1, index : index + 1], errors.shared[:, index : index + 1]
        return 100 * values[:, index], ErrorParts(100**2 * own, 100 * shared)

    def planned_difference(self, flights: int) -> Array:
        n = len(self.flights)
        counts = [len(range(i, flights, n)) for i in range(n)]
        used = self.some([i for i in range(n) if counts[i]])
        V = np.linspace(*used.ends_mps, POOLING.compared_speeds)
        power = used.mean(V, [count for count in counts if count])
        return np.asarray(2 * power.own / np.outer(power.value, power.value))  # the shared errors cancel

    def curve_result(self) -> CurveResult:
        statistics = power_statistics(self.curve.V_mps, self.curve.power_W)
        return curve_result(self.curve, statistics=statistics, battery=self.battery)

    @property
    def notes(self) -> list[str]:
        return vehicle_notes([flight.content for flight in self.flights])

    def _form(self, results: PooledResults, request: Request) -> PooledResults:
        others = electrical_at_weights(self.curve, request.weights_N, self.battery)
        parameters, withheld = of_electrical_pool(results, [flight.content for flight in self.flights])
        return structs.replace(
            results,
            notes=[*results.notes, *others, *request.questions(self.condition.weight_N)],
            autopilot_parameters=parameters,
            autopilot_parameters_withheld=withheld,
        )


def curve_pool(flights: Sequence[FlightCurve], condition: Condition | None = None) -> CurvePool:
    """Pool curves at the flights' mean weight and density, or at another condition.

    Raises InputError for flights of two aircraft, or if a flight is given twice.
    """
    first = flights[0]
    for flight in flights:
        if (flight.aircraft.wing_area_m2, flight.aircraft.span_m) != (
            first.aircraft.wing_area_m2,
            first.aircraft.span_m,
        ):
            raise InputError(
                f"two aircraft in one pool, of {first.name} and {flight.name}; pool each alone and compare them"
            )
    refuse_repeated(flights)
    weight_N, rho, _ = (
        float(np.mean(column)) for column in zip(*(flight.curve.condition for flight in flights), strict=True)
    )
    condition = condition or Condition(weight_N, rho, first.aircraft.wing_area_m2)
    # Pools are compared at one weight and density, each with its own wing.
    curves = [flight.curve.at(condition._replace(wing_area_m2=flight.aircraft.wing_area_m2)) for flight in flights]
    low, high = min(curve.V_mps[0] for curve in curves), max(curve.V_mps[-1] for curve in curves)
    V = np.linspace(low, high, CURVES.points)
    flown = np.any([curve.covers(V) for curve in curves], axis=0)
    return CurvePool(tuple(flights), condition, tuple(curves), V[flown])


def _smoothing(V: Array, error_W: Array) -> Array:
    """Return the matrix (n, n) that fits powers with standard errors (n,) by 1/V, 1, V, V^2 and V^3 (least squares).

    Where a flight's curve begins or ends, the mean has a step, and without smoothing the least power would lie there.
    """
    u = V / np.mean(V)
    terms = np.stack([1 / u, np.ones(len(u)), u, u**2, u**3], axis=1)
    return np.asarray(terms @ np.linalg.pinv(terms / error_W[:, None]) / error_W)


def curve_difference(pool: CurvePool, other: CurvePool, shares_errors: bool) -> CurveDifference:
    """Return one pool's power minus the other's, at speeds that at least half of the flights in each pool reach.

    Raises InputError if there are no such speeds.
    """
    ends = [pool.ends_mps, other.ends_mps]
    low, high = max(slow for slow, _ in ends), min(fast for _, fast in ends)
    if low >= high:
        ranges = " and ".join(f"{slow:.1f} to {fast:.1f} m/s" for slow, fast in ends)
        raise InputError(f"the two pools have no speeds in common: {ranges}; fly both over the same speeds")
    V = np.linspace(low, high, POOLING.compared_speeds)
    a, b = pool.mean(V), other.mean(V)
    return CurveDifference(V, b.value, a.minus(b, shares_errors))
