"""The code that all segments of a plan share: the interface, the context, and the choice of speed."""

from collections.abc import Generator
from dataclasses import dataclass
from typing import Protocol

from flightpower.sim.integration import Observation
from flightpower.sim.pilot import Targets

SegmentTargets = Generator[Targets, Observation, None]


@dataclass
class FlightContext:
    """Data for a segment: limits of the aircraft, time step, and the state at the end of the previous segment."""

    V_stall: float
    V_max: float
    dt: float
    height_m: float
    heading_rad: float
    speed_mps: float
    throttle: float = 0.0


class PlanSegment(Protocol):
    """A segment. `fly` yields `Targets`, receives the `Observation` one step later, and returns at the end."""

    kind: str

    def fly(self, seen: Observation, context: FlightContext) -> SegmentTargets: ...


def chosen_speed(
    context: FlightContext, speed_mps: float | None, over_stall: float | None, of_max: float | None
) -> float:
    """The speed of a segment [m/s], which may be given in any of three ways; by default the present speed."""
    if speed_mps is not None:
        return speed_mps
    if over_stall is not None:
        return over_stall * context.V_stall
    if of_max is not None:
        return of_max * context.V_max
    return context.speed_mps


def steps_in(duration_s: float, context: FlightContext) -> int:
    return max(1, round(duration_s / context.dt))
