"""The pool of flights that give electrical power only, and their comparison (docs/understand/pooling.md).

At one lift coefficient power over V³ρ, and with it the efficiency's argument, are the same at every weight and
density: curves are put together at one condition by V √(W0 ρ / (W ρ0)) and (P - idle) (W0/W)^1.5 √(ρ/ρ0).

Each flight has own errors (air motion, the airspeed's zero, a mean updraft). The others are the same in all flights of
an aircraft: the current meter's and the airspeed's scale, mass, thermometer, power with the motor off, and how far the
priors are from the truth. They do not average out in a pool, and cancel between two pools of one aircraft.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.special import chdtrc

from analysis.curve import POLAR, Condition, Curve, stored_curve
from analysis.flights.agreement import Test, quadratic_form
from analysis.flights.evidence import (
    NOT_ONE_VEHICLE,
    SharedErrors,
    against_electrical,
    against_polars,
    one_vehicle,
    polars_text,
    vehicle_notes,
)
from analysis.flights.pool_settings import POOLING
from analysis.flights.power_train import mean_air
from analysis.records.flight import ConditionResult, Kind, PowerStatistics, Results
from analysis.records.pool import (
    AgreementTest,
    ComparisonResults,
    Configuration,
    Deviation,
    ElectricalPooledFlight,
    ElectricalPooledResults,
    PooledElectrical,
    PowerDifference,
)
from analysis.results.evidence import trust_by, worst_first
from analysis.results.settings import TRUST
from analysis.settings import CURVES
from analysis.uncertain import Uncertain, total
from flight.arrays import Array
from flight.errors import InputError
from flight.version import version


class ElectricalPool(NamedTuple):
    """Flights, the curve of each at the condition of the pool, and the curve of all."""

    flights: list[Results]
    curves: list[Curve]
    curve: Curve

    @property
    def speeds_mps(self) -> Array:
        """Speeds (n,) of the curve [m/s]."""
        return self.curve.V_mps

    def power(self, V: Array) -> tuple[Array, Array]:
        """Electrical power and its standard error [W], each (k,), at speeds V (k,) [m/s] within those flown."""
        at, power_W = self.curve.V_mps, self.curve.power_W
        return np.interp(V, at, power_W.value), np.interp(V, at, power_W.standard_error)

    def results(self, left_out: Sequence[str] = (), failures: Sequence[str] = ()) -> ElectricalPooledResults:
        """The contents of the pooled results.json; left_out, failures: as of a pool of drag."""
        return pooled_results(self, left_out, failures)


def electrical_pool(flights: Sequence[Results], condition: Condition | None = None) -> ElectricalPool:
    """At the flights' mean weight and density, or at another condition.

    Raises InputError for flights of two aircraft, for the same flight twice, and for results without statistics.
    """
    first = flights[0]
    for one in flights:
        if Kind.ELECTRICAL not in one.curves or one.curves[Kind.ELECTRICAL].statistics is None:
            raise InputError(f"{one.log}: its results are of an earlier version; analyze the log again")
        if (one.aircraft.wing_area_m2, one.aircraft.span_m) != (first.aircraft.wing_area_m2, first.aircraft.span_m):
            raise InputError(
                f"two aircraft in one pool, of {first.log} and {one.log}; pool each alone and compare them"
            )
    seen: dict[tuple[float, ...], str] = {}
    for one in flights:
        key = tuple(point.power_W for point in one.electrical_power)
        if key in seen:
            raise InputError(f"{one.log} and {seen[key]} are the same flight; give each flight once")
        seen[key] = one.log
    weight_N, rho = (
        float(np.mean([getattr(one.test, name) for one in flights])) for name in ("weight_N", "air_density_kgpm3")
    )
    condition = condition or Condition(weight_N, rho, first.aircraft.wing_area_m2)
    # Pools are compared at one weight and density, each with its own wing.
    curves = [_curve(one).at(condition._replace(wing_area_m2=one.aircraft.wing_area_m2)) for one in flights]
    low, high = min(one.V_mps[0] for one in curves), max(one.V_mps[-1] for one in curves)
    V = np.linspace(low, high, CURVES.points)
    flown = np.any([_inside(one, V) for one in curves], axis=0)
    return _together(list(flights), curves, V[flown])


def _curve(flight: Results) -> Curve:
    """Of one flight, at its own weight and density."""
    curve = stored_curve(flight.curves[Kind.ELECTRICAL], flight.aircraft.wing_area_m2)
    assert curve is not None  # as has been checked
    return curve


def _inside(curve: Curve, V: Array) -> NDArray[np.bool_]:
    return np.asarray((curve.V_mps[0] * (1 - 1e-9) <= V) & (curve.V_mps[-1] * (1 + 1e-9) >= V))


def _together(flights: list[Results], curves: list[Curve], V: Array) -> ElectricalPool:
    """At each speed the mean of the curves that contain it, weighed by the inverse variance of their own errors."""
    at = [CubicSpline(one.V_mps, np.eye(len(one.V_mps)))(np.clip(V, one.V_mps[0], one.V_mps[-1])) for one in curves]
    variance = np.stack([np.einsum("vi,ij,vj->v", B, one.power_W.own, B) for B, one in zip(at, curves, strict=True)])
    weight = np.where([_inside(one, V) for one in curves], 1 / variance, 0.0)
    weight /= weight.sum(axis=0)
    parts = (one.power_W.through(w[:, None] * B) for w, B, one in zip(weight, at, curves, strict=True))
    first, *_ = curves
    return ElectricalPool(flights, curves, replace(first, V_mps=V, power_W=total(parts), idle_W=_idle_W(flights)))


class ElectricalDifference(NamedTuple):
    """Power of one pool less that of another at V_mps (n,), and the test of any difference. power_W : of the other"""

    V_mps: Array
    power_W: Array
    value_W: Uncertain
    test: Test


def _difference(one: ElectricalPool, other: ElectricalPool, shares_errors: bool) -> ElectricalDifference:
    """Over the speeds that half of the flights of each reach. Raises InputError where there are none."""
    ends = [[float(np.median([curve.V_mps[at] for curve in pool.curves])) for at in (0, -1)] for pool in (one, other)]
    low, high = max(slow for slow, _ in ends), min(fast for _, fast in ends)
    if low >= high:
        said = " and ".join(f"{slow:.1f} to {fast:.1f} m/s" for slow, fast in ends)
        raise InputError(f"no speeds in common, {said}; fly both over the same speeds")
    V = np.linspace(low, high, POOLING.compared_speeds)
    a, b = (_together(pool.flights, pool.curves, V).curve for pool in (one, other))
    value = a.power_W.minus(b.power_W, shares_errors)
    other_W = b.power_W.value
    return ElectricalDifference(V, other_W, value, _test(value.value / other_W, value.covariance, other_W))


def _test(share: Array, covariance: Array, power_W: Array) -> Test:
    """Whether power changes by one share at all speeds, or in any way; the more certain counts, as one of two."""
    three = [0, len(share) // 2, -1]
    d, C = share[three], (covariance / np.outer(power_W, power_W))[np.ix_(three, three)]
    weight = np.linalg.solve(C, np.ones(len(POLAR)))
    tests = []
    for chi_square, freedom in (
        (float(weight @ d) ** 2 / float(weight.sum()), 1),
        (float(quadratic_form(d, C)), len(POLAR)),
    ):
        tests.append(Test(chi_square, freedom, min(1.0, 2 * float(chdtrc(freedom, chi_square)))))
    return min(tests, key=lambda one: one.p)


def pooled_results(
    pool: ElectricalPool, left_out: Sequence[str] = (), failures: Sequence[str] = ()
) -> ElectricalPooledResults:
    """The contents of the pool's results.json."""
    differences = _against_others(pool)
    test = _homogeneity(differences)
    evidence = worst_first([*against_electrical(pool.flights), *against_polars(test)])
    temperature_K, pressure_Pa = mean_air(pool.flights)
    return ElectricalPooledResults(
        trust=trust_by(evidence),
        evidence=evidence,
        software_version=version(),
        aircraft=pool.flights[0].aircraft,
        test=_condition_result(pool),
        electrical_power=pool.curve.points(),
        homogeneity=AgreementTest(**test._asdict(), text=polars_text(test)) if test else None,
        flights=_flights(pool, differences),
        notes=vehicle_notes(pool.flights),
        left_out=list(left_out),
        failures=list(failures),
        air_temperature_K=temperature_K,
        air_pressure_Pa=pressure_Pa,
        electrical=PooledElectrical(idle_power_W=pool.curve.idle_W, pooling=_statistics(pool)),
    )


def _condition_result(pool: ElectricalPool) -> ConditionResult:
    condition = pool.curve.condition
    return ConditionResult(weight_N=condition.weight_N, air_density_kgpm3=condition.rho)


def _idle_W(flights: Sequence[Results]) -> float:
    return float(np.mean([one.curves[Kind.ELECTRICAL].idle_power_W for one in flights]))


def _statistics(pool: ElectricalPool) -> PowerStatistics:
    power = pool.curve.power_W
    return PowerStatistics(
        speed_mps=pool.curve.V_mps.tolist(),
        power_W=power.value.tolist(),
        own_covariance=power.own.tolist(),
        shared={name: change.tolist() for name, change in power.shared.items()},
    )


def _against_others(pool: ElectricalPool) -> list[ElectricalDifference]:
    """Each flight against the pool of all others; empty for one flight, or where one shares no speed with them."""
    found = []
    for i, (flight, curve) in enumerate(zip(pool.flights, pool.curves, strict=True)):
        flights, curves = pool.flights[:i] + pool.flights[i + 1 :], pool.curves[:i] + pool.curves[i + 1 :]
        if not curves:
            return []
        V = pool.curve.V_mps[np.any([_inside(one, pool.curve.V_mps) for one in curves], axis=0)]
        alone = _together([flight], [curve], curve.V_mps)
        try:
            found.append(_difference(alone, _together(flights, curves, V), shares_errors=True))
        except InputError:
            return []
    return found


def _homogeneity(differences: Sequence[ElectricalDifference]) -> Test | None:
    """Of the flight that differs most, of as many; None where none is compared."""
    worst = min((one.test for one in differences), key=lambda one: one.p, default=None)
    return worst._replace(p=min(1.0, len(differences) * worst.p)) if worst else None


def _flights(pool: ElectricalPool, differences: Sequence[ElectricalDifference]) -> list[ElectricalPooledFlight]:
    found = []
    for i, (flight, curve) in enumerate(zip(pool.flights, pool.curves, strict=True)):
        difference = differences[i] if differences else None
        alone = _together([flight], [curve], curve.V_mps if difference is None else difference.V_mps).curve.power_W
        half = 100 * alone.half_width / alone.value
        found.append(
            ElectricalPooledFlight(
                log=flight.log,
                vehicle=flight.vehicle,
                test=flight.test,
                half_width_percent=half.tolist(),
                against_others=_deviations(difference) if difference else [],
                p=difference.test.p if difference else None,
                outlier=len(pool.flights) > 2
                and difference is not None
                and difference.test.p < TRUST.false_alarm_rate / len(pool.flights),
            )
        )
    return found


def _deviations(difference: ElectricalDifference) -> list[Deviation]:
    percent = 100 / difference.power_W
    limit = percent * difference.value_W.half_width
    columns = (difference.V_mps, percent * difference.value_W.value, limit)
    return [
        Deviation(speed_mps=v, difference_percent=d, limit_percent=m)
        for v, d, m in zip(*(column.tolist() for column in columns), strict=True)
    ]


def compare_electrical(
    a: Sequence[Results], b: Sequence[Results], names: Sequence[str] = ("", "")
) -> ComparisonResults:
    """B against A at the weight and density of A. Errors of one aircraft, by its name and autopilot, cancel.

    Raises InputError where one of the two cannot be pooled, and where they have no speeds in common.
    """
    pool_a = electrical_pool(a)
    pool_b = electrical_pool(b, pool_a.curve.condition)
    one_name, vehicle = a[0].aircraft.title == b[0].aircraft.title, one_vehicle(a, b)
    same = one_name and vehicle
    found = _difference(pool_b, pool_a, same)
    apart = _difference(pool_b, pool_a, False)
    percent = 100 / found.power_W
    half, half_apart = (percent * one.value_W.half_width for one in (found, apart))
    difference = percent * found.value_W.value
    least = int(np.argmin(half))
    differs = f"B differs from A (p = {found.test.p:.2g})"
    verdict = differs if found.test.differs else f"No difference is seen (p = {found.test.p:.2g})"
    shares = SharedErrors.AIRCRAFT if same else SharedErrors.NONE
    within = [_homogeneity(_against_others(pool)) for pool in (pool_a, pool_b)]
    evidence = worst_first([*against_electrical([*a, *b]), *(one for test in within for one in against_polars(test))])
    columns = (found.V_mps, found.power_W, found.power_W + found.value_W.value, difference, half, half_apart)
    return ComparisonResults(
        trust=trust_by(evidence),
        evidence=evidence,
        software_version=version(),
        a=_configuration(pool_a, names[0]),
        b=_configuration(pool_b, names[1]),
        test=_condition_result(pool_a),
        same_installation=same,
        same_propeller=same,
        differences=[
            PowerDifference(
                speed_mps=v, power_a_W=of_a, power_b_W=of_b, difference_percent=d, lo_percent=d - h, hi_percent=d + h,
                independent_half_width_percent=m,
            )
            for v, of_a, of_b, d, h, m in zip(*(column.tolist() for column in columns), strict=True)
        ],
        chi_square=found.test.chi_square,
        degrees_of_freedom=found.test.degrees_of_freedom,
        p=found.test.p,
        differs=found.test.differs,
        text=f"{verdict}: at {found.V_mps[least]:.1f} m/s the electrical power of B is {difference[least]:+.1f} ±"
        f" {half[least]:.1f} % from that of A. {shares.value}",
        notes=[*vehicle_notes([*a, *b]), *([NOT_ONE_VEHICLE] if one_name and not vehicle else [])],
        flights_to_see=[],
    )  # fmt: skip


def _configuration(pool: ElectricalPool, name: str) -> Configuration:
    logs = [one.log for one in pool.flights]
    return Configuration(aircraft=pool.flights[0].aircraft, installation="", logs=logs, name=name)
