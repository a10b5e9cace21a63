"""The pool of several flights, from their results."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analysis.pooling.flight_statistics import FlightStatistics, check_one_aircraft, read_statistics
from analysis.pooling.joint import pooled_estimate, shared_prior, stacked
from analysis.pooling.joint_pool import JointPool, mean_condition, pooled_polar
from analysis.pooling.pooled_json import pooled_json
from flight.errors import InputError


@dataclass(frozen=True)
class PooledResult(JointPool):
    """The pool, and the form of its results.json."""

    def to_json(self) -> dict[str, Any]:
        """The content of the pooled results.json (docs/pooling.md)."""
        return pooled_json(self)


def pool_results(results: Sequence[Path | Mapping[str, Any]]) -> PooledResult:
    """The joint estimate of flights, from the results.json of each.

    Raises InputError for none, for results without statistics, for one flight twice, and for flights of two aircraft,
    propellers or installations.
    """
    if not results:
        raise InputError("no flights to pool; give the results.json of one or more flights")
    return pool([read_statistics(one) for one in results])


def pool(flights: Sequence[FlightStatistics]) -> PooledResult:
    """The same from the statistics of the flights."""
    _refuse_repeated(flights)
    check_one_aircraft(flights)
    stack, prior = stacked(flights), shared_prior(flights)
    estimate = pooled_estimate(stack, prior)
    return PooledResult(
        flights=tuple(flights),
        stack=stack,
        prior=prior,
        estimate=estimate,
        polar=pooled_polar(flights, estimate),
        condition=mean_condition(flights),
        flown_CL=(min(f.flown_CL[0] for f in flights), max(f.flown_CL[1] for f in flights)),
    )


def _refuse_repeated(flights: Sequence[FlightStatistics]) -> None:
    seen: dict[bytes, str] = {}
    for flight in flights:
        key = flight.values.tobytes()
        if key in seen:
            raise InputError(
                f"{flight.name} and {seen[key]} are the same flight: their estimates are equal to the digit; give each"
                " flight once"
            )
        seen[key] = flight.name
