"""What a route reads of `results.json`, of one flight or of a pool."""

import msgspec

from analysis.records.flight import (
    FORMAT,
    AircraftResult,
    ComputationModel,
    ConditionResult,
    ElectricalStatistics,
    Evidence,
    PowerPoint,
    SlowestFlown,
    Trust,
)
from analysis.records.pool import ELECTRICAL_FORMAT, POOLED_FORMAT

FORMATS = (FORMAT, POOLED_FORMAT, ELECTRICAL_FORMAT)


class PowerModel(msgspec.Struct, frozen=True, kw_only=True):
    """losses_of : logs of a pool, of whose power trains the mean is taken; empty of one flight"""

    battery_energy_Wh: float
    model: ComputationModel | None = None
    losses_of: list[str] = []


class ElectricalCurve(msgspec.Struct, frozen=True, kw_only=True):
    """Null where results are of an earlier version."""

    idle_power_W: float
    pooling: ElectricalStatistics | None = None
    battery_energy_Wh: float | None = None


class PooledLog(msgspec.Struct, frozen=True, kw_only=True):
    log: str


class RouteInput(msgspec.Struct, frozen=True, kw_only=True):
    """Some fields of `Results`, `PooledResults` and `ElectricalPooledResults`; each stands where it is explained.

    flights : of a pool; empty of one flight
    """

    format: str
    trust: Trust = Trust.TRUSTED
    evidence: list[Evidence] = []
    aircraft: AircraftResult
    test: ConditionResult
    air_temperature_K: float | None = None
    air_pressure_Pa: float | None = None
    power_required: list[PowerPoint] = []
    electrical_power: list[PowerPoint] = []
    slowest_flown: SlowestFlown | None = None
    use: PowerModel | None = None
    electrical: ElectricalCurve | None = None
    flights: list[PooledLog] = []

    @property
    def battery_energy_Wh(self) -> float | None:
        """None where no battery was given with the analysis."""
        known = self.use or self.electrical
        return known.battery_energy_Wh if known else None
