"""The pool of several flights, from their results: of drag where all have its statistics, else of electrical power."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

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
from flightpower.analysis.flights.pooled import Pool, refuse_repeated
from flightpower.analysis.records.flight import Kind, Results
from flightpower.analysis.results.read import read_results
from flightpower.flight.errors import InputError

__all__ = ["Pool", "Pooled", "joint_pool", "of_one_kind", "pool", "pool_flights", "pool_results"]


class Pooled(NamedTuple):
    """flights : those whose power of one kind is pooled     left_out : why others are not, a line each"""

    flights: list[Results]
    left_out: list[str]


def of_one_kind(*sides: Sequence[Results]) -> tuple[Kind, list[Pooled]]:
    """The kind of power by which most flights are pooled, drag where as many are, and the flights of each side with it.

    A kind that every side has goes first. Without one, the flights of a side are left out.
    """
    has = {
        kind: [[_gives(flight, kind) for flight in side] for side in sides]
        for kind in (Kind.POWER_REQUIRED, Kind.ELECTRICAL)
    }
    kind = max(has, key=lambda kind: (all(map(any, has[kind])), sum(map(sum, has[kind]))))
    pooled_sides = []
    for side, given in zip(sides, has[kind], strict=True):
        pairs = list(zip(side, given, strict=True))
        left_out = [f"{flight.log}: {_why_without(flight, kind)}" for flight, gives in pairs if not gives]
        pooled_sides.append(Pooled([flight for flight, gives in pairs if gives], left_out))
    return kind, pooled_sides


def _gives(results: Results, kind: Kind) -> bool:
    return results.pooling is not None if kind is Kind.POWER_REQUIRED else kind in results.curves


def _why_without(results: Results, kind: Kind) -> str:
    if kind is Kind.ELECTRICAL:
        return "gives drag only, since its log has no battery, which is not pooled with electrical power"
    if results.kind is Kind.ELECTRICAL:
        return "gives electrical power only, which is not pooled with drag"
    return "its curve is not by the dynamic method, and is not pooled"


def pool_results(results: Sequence[Path | Mapping[str, Any] | Results], kind: Kind | None = None) -> Pool:
    """The joint estimate of flights, from the results.json of each: of drag, or else of electrical power.

    kind : of power, of `of_one_kind`; None: drag, unless a flight gives electrical power only. Raises InputError for no
    flights, for flights of which some have drag alone and others electrical power alone, for results without
    statistics, for one flight twice, and for flights of two aircraft, propellers or installations.
    """
    if not results:
        raise InputError("no flights to pool; give the results.json of one or more flights")
    contents = [read_results(source) for source in results]
    electrical = [content.log for content in contents if kind is Kind.ELECTRICAL or content.kind is Kind.ELECTRICAL]
    if not electrical:
        return joint_pool(results)
    if drag := [content.log for content in contents if Kind.ELECTRICAL not in content.curves]:
        raise InputError(
            f"{electrical[0]} gives electrical power only, and {drag[0]} drag only, since its log has no battery: leave"
            " one of them out"
        )
    return curve_pool([read_curve(content) for content in contents])


def pool_flights(flights: Sequence[PoolFlight]) -> Pool:
    """The joint estimate of flights of one kind. Raises InputError as `pool_results`."""
    curves = [flight for flight in flights if isinstance(flight, FlightCurve)]
    drag = [flight for flight in flights if isinstance(flight, FlightStatistics)]
    return curve_pool(curves) if curves else pool(drag)


def joint_pool(results: Sequence[Path | Mapping[str, Any] | Results]) -> JointPool:
    """The joint estimate of drag. Raises InputError as `pool_results`."""
    return pool([read_statistics(path) for path in results])


def pool(flights: Sequence[FlightStatistics]) -> JointPool:
    """The joint estimate of drag, from the statistics of the flights. Raises InputError as above."""
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
