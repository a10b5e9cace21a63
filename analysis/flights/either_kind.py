"""One pool and one comparison for flights of either kind: drag by the dynamic method, or electrical power."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from analysis.flights.comparison import Comparison
from analysis.flights.comparison import compare as compare_drag
from analysis.flights.electrical import ElectricalPool, compare_electrical, electrical_pool
from analysis.flights.pool import Pool
from analysis.flights.pool import pool_results as pool_drag
from analysis.records.flight import Kind, Results
from analysis.records.pool import ComparisonResults
from analysis.results.read import read_results
from flight.arrays import Array
from flight.errors import InputError

Content = Path | Mapping[str, Any] | Results


def pool_flights(results: Sequence[Content]) -> Pool | ElectricalPool:
    """The joint estimate of flights, from the results.json of each: of drag where the flights have it.

    Raises InputError for no flights, for flights of both kinds, for results without statistics, for one flight twice,
    and for flights of two aircraft, propellers or installations.
    """
    contents = [read_results(one) for one in results]
    electrical = [one.log for one in contents if one.pooling is None and one.kind is Kind.ELECTRICAL]
    if not electrical:
        return pool_drag(contents)
    if len(electrical) < len(contents):
        raise InputError(f"{electrical[0]}: gives electrical power only, and others drag; pool flights of one kind")
    return electrical_pool(contents)


@dataclass(frozen=True)
class ElectricalComparison:
    """Electrical power of B minus that of A, with the attributes of a `Comparison`; arrays (n,) at speeds_mps."""

    a: ElectricalPool
    b: ElectricalPool

    def results(self, a_name: str = "", b_name: str = "") -> ComparisonResults:
        """The contents of the comparison's results.json."""
        return compare_electrical(self.a.flights, self.b.flights, (a_name, b_name))

    @cached_property
    def _results(self) -> ComparisonResults:
        return self.results()

    @property
    def differs(self) -> bool:
        return self._results.differs

    @property
    def speeds_mps(self) -> Array:
        return np.array([one.speed_mps for one in self._results.differences])

    @property
    def difference_percent(self) -> Array:
        """Of the power of A."""
        return np.array([one.difference_percent for one in self._results.differences])

    @property
    def half_width_percent(self) -> Array:
        """Of the 95 % interval of the difference."""
        return np.array([(one.hi_percent - one.lo_percent) / 2 for one in self._results.differences])


def compare_pools(a: Pool | ElectricalPool, b: Pool | ElectricalPool) -> Comparison | ElectricalComparison:
    """B against A at the weight and density of A, over the speeds that both flew.

    Raises InputError for pools of two kinds, where a flight is in both, and where they have no speeds in common.
    """
    if isinstance(a, ElectricalPool) and isinstance(b, ElectricalPool):
        return ElectricalComparison(a, b)
    if isinstance(a, ElectricalPool) or isinstance(b, ElectricalPool):
        which = "A" if isinstance(a, ElectricalPool) else "B"
        raise InputError(f"{which} gives electrical power only, and the other drag; compare flights of one kind")
    return compare_drag(a, b)
