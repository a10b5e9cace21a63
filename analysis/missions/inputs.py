"""The part of `results.json`, of one flight or of a pool, that a route reads."""

from pathlib import Path

import msgspec

from flightpower.analysis.records.flight import ComputationModel, WithCurves
from flightpower.analysis.records.pool import EARLIER_POOLED_FORMATS, POOLED_FORMAT
from flightpower.analysis.results.read import FORMATS, read_file


class PowerModel(msgspec.Struct, frozen=True, kw_only=True):
    """losses_of : logs of a pool whose power trains are averaged; empty for one flight"""

    model: ComputationModel | None = None
    losses_of: list[str] = []


class PooledLog(msgspec.Struct, frozen=True, kw_only=True):
    log: str


class RouteInput(WithCurves, frozen=True, kw_only=True):
    """Some fields of `Results` and of the results of pools, where each of them is explained.

    flights : of a pool; empty for one flight
    """

    use: PowerModel | None = None
    flights: list[PooledLog] = msgspec.field(default_factory=list)


def read_route_input(path: Path) -> RouteInput:
    """Read what a route needs. Raises InputError if the file is something else."""
    return read_file(path, RouteInput, (*FORMATS, POOLED_FORMAT, *EARLIER_POOLED_FORMATS))
