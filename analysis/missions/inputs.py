"""What a route reads of `results.json`, of one flight or of a pool."""

from pathlib import Path

import msgspec

from flightpower.analysis.records.flight import ComputationModel, WithCurves
from flightpower.analysis.records.pool import EARLIER_POOLED_FORMATS, POOLED_FORMAT
from flightpower.analysis.results.read import FORMATS, read_file


class PowerModel(msgspec.Struct, frozen=True, kw_only=True):
    """losses_of : logs of a pool, of whose power trains the mean is taken; empty of one flight"""

    model: ComputationModel | None = None
    losses_of: list[str] = []


class PooledLog(msgspec.Struct, frozen=True, kw_only=True):
    log: str


class RouteInput(WithCurves, frozen=True, kw_only=True):
    """Some fields of `Results` and of the results of pools; each stands where it is explained.

    flights : of a pool; empty of one flight
    """

    use: PowerModel | None = None
    flights: list[PooledLog] = msgspec.field(default_factory=list)


def read_route_input(path: Path) -> RouteInput:
    """Raises InputError where the file is something else."""
    return read_file(path, RouteInput, (*FORMATS, POOLED_FORMAT, *EARLIER_POOLED_FORMATS))
