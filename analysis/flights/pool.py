"""Pools several flights from their results: by drag, by electrical power, or by both."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from flightpower.analysis.flights.agreement import remounted_flights
from flightpower.analysis.flights.curve_pool import curve_pool
from flightpower.analysis.flights.flight_statistics import (
    FlightCurve,
    FlightStatistics,
    PoolFlight,
    check_one_aircraft,
    read_curve,
    read_statistics,
)
from flightpower.analysis.flights.joint import pooled_estimate, shared_prior, stacked
from flightpower.analysis.flights.joint_pool import JointPool, mean_condition, pooled_polar
from flightpower.analysis.flights.pooled import Pool, first_of_kinds, refuse_repeated
from flightpower.analysis.records.flight import Kind, Results
from flightpower.analysis.records.pool import LeftOut, LeftOutReason
from flightpower.analysis.results.read import read_results
from flightpower.flight.errors import InputError

__all__ = ["Pool", "joint_pool", "of_kind", "pool", "pool_flights", "pool_results"]


def pool_results(results: Sequence[Path | Mapping[str, Any] | Results]) -> Pool:
    """Pool flights from the results.json of each, by drag and, if some give electrical power only, also by that.

    With two pools, an added flight never removes the curve of earlier ones. The second pool is `other_kind`: it is the
    pool by drag if only one flight has drag. Raises InputError if there are no flights, results without statistics, the
    same flight twice, or flights of two aircraft, propellers or installations.
    """
    if not results:
        raise InputError("no flights to pool; give the results.json of one or more flights")
    contents = [read_results(source) for source in results]
    with_drag = sum(_has(content, Kind.POWER_REQUIRED) for content in contents)
    kinds = [Kind.POWER_REQUIRED] if with_drag else []
    if any(_has(content, Kind.ELECTRICAL) and not _has(content, Kind.POWER_REQUIRED) for content in contents):
        kinds.insert(1 if with_drag > 1 else 0, Kind.ELECTRICAL)
    if not kinds:
        read_statistics(results[0])  # raises an error that says why
    return first_of_kinds(kinds, lambda kind: _of_kind(contents, kind))


def of_kind(pool: Pool, kind: Kind) -> Pool | None:
    """Return a pool of the same flights by another kind of power; None if no flight has it. Raises InputError if they
    cannot be pooled by it.
    """
    if pool.kind is kind or pool.other_kind:
        return pool if pool.kind is kind else pool.other_kind
    contents = [flight.content for flight in pool.flights]
    return _of_kind(contents, kind) if any(_has(content, kind) for content in contents) else None


def _has(results: Results, kind: Kind) -> bool:
    return results.pooling is not None if kind is Kind.POWER_REQUIRED else kind in results.curves


def _of_kind(contents: Sequence[Results], kind: Kind) -> Pool:
    """Return the pool of the flights that have this kind of power; at least one flight must have it."""
    flights = [content for content in contents if _has(content, kind)]
    left_out = tuple(_left_out(content) for content in contents if not _has(content, kind))
    pooled = joint_pool(flights) if kind is Kind.POWER_REQUIRED else curve_pool([*map(read_curve, flights)])
    return replace(pooled, left_out=left_out)


_WHY = {
    LeftOutReason.ELECTRICAL_ONLY: "it gives electrical power only",
    LeftOutReason.NO_BATTERY: "it gives drag only, since its log has no battery",
    LeftOutReason.NO_STATISTICS: "its curve is not by the dynamic method, and is not pooled",
}


def _left_out(results: Results) -> LeftOut:
    """Return the entry for a flight that lacks one kind of power."""
    reason = LeftOutReason.ELECTRICAL_ONLY if _has(results, Kind.ELECTRICAL) else LeftOutReason.NO_STATISTICS
    reason = LeftOutReason.NO_BATTERY if _has(results, Kind.POWER_REQUIRED) else reason
    return LeftOut(log=results.log, reason=reason, text=_WHY[reason])


def pool_flights(flights: Sequence[PoolFlight]) -> Pool:
    """Pool flights of one kind. Raises InputError as `pool_results` does."""
    curves = [flight for flight in flights if isinstance(flight, FlightCurve)]
    drag = [flight for flight in flights if isinstance(flight, FlightStatistics)]
    return curve_pool(curves) if curves else pool(drag)


def joint_pool(results: Sequence[Path | Mapping[str, Any] | Results]) -> JointPool:
    """Pool flights by drag. Raises InputError as `pool_results` does."""
    return pool([read_statistics(path) for path in results])


def pool(flights: Sequence[FlightStatistics]) -> JointPool:
    """Pool flights by drag, from their statistics. Raises InputError as `pool_results` does."""
    refuse_repeated(flights)
    check_one_aircraft(flights)
    as_stated, prior = stacked(flights), shared_prior(flights)
    remounted = remounted_flights(as_stated, prior)
    stack = stacked(flights, remounted) if remounted else as_stated
    estimate = pooled_estimate(stack, prior)
    return JointPool(
        flights=tuple(flights),
        as_stated=as_stated,
        stack=stack,
        remounted=remounted,
        prior=prior,
        estimate=estimate,
        polar=pooled_polar(flights, estimate),
        condition=mean_condition(flights),
        flown_CL=(min(f.flown_CL[0] for f in flights), max(f.flown_CL[1] for f in flights)),
    )
