"""Maneuvers for parameter estimation: load factor up and down, elevator inputs, wind-up turn."""

from cmath import exp
from dataclasses import dataclass
from math import acos, pi, radians, sin

from flightpower.flight.errors import InputError
from flightpower.sim.integration import Observation
from flightpower.sim.pilot import Targets
from flightpower.sim.plan_segment import FlightContext, SegmentTargets, chosen_speed, steps_in

RECOVERY_S = 8.0
ADAPTING, LARGEST_CORRECTION = 0.5, 1.5  # correction of porpoising from cycle to cycle: its exponent, and its limit
LARGEST_ELEVATOR_RAD = radians(18)


@dataclass(frozen=True, kw_only=True)
class RollerCoasterSegment:
    """Load factor up and down between two values (pushover and pull-up), at `load_rate` per second.

    The 0.1 g/s of the literature is too slow for such a slow aircraft: the path would turn by g/V (dn)^2 / load_rate,
    until the aircraft stands on its tail.
    """

    lowest: float = 0.4
    highest: float = 1.6
    load_rate: float = 1.0
    cycles: int = 2
    kind = "roller-coaster"

    def fly(self, seen: Observation, context: FlightContext) -> SegmentTargets:
        _check_load(self.highest, seen, context)
        load, throttle = 1.0, context.throttle
        for goal in [self.highest, self.lowest] * self.cycles + [1.0]:
            while abs(goal - load) > 1e-9:
                step = self.load_rate * context.dt
                load += min(max(goal - load, -step), step)
                seen = yield Targets(load_factor=load, throttle=throttle, bank_rad=0.0)
        yield from _recover(seen, context)


@dataclass(frozen=True, kw_only=True)
class PorpoiseSegment:
    """Elevator oscillation about level flight with rising frequency; mean height is held.

    Angle of attack oscillates faster than speed and gusts change, so that the probe's slope can be identified.

    load : amplitude of the load factor, which the pilot reaches by moving the stick more or less from cycle to cycle,
    beginning with `elevator`. Without a `load` the elevator moves by `elevator` throughout.
    """

    duration_s: float
    elevator_rad: float = radians(12)
    load: float | None = None
    first_period_s: float = 1.8
    last_period_s: float = 1.3
    speed_mps: float | None = None
    speed_over_stall: float | None = None
    speed_of_max: float | None = None
    kind = "porpoise"

    def fly(self, seen: Observation, context: FlightContext) -> SegmentTargets:
        speed = chosen_speed(context, self.speed_mps, self.speed_over_stall, self.speed_of_max)
        first, last = 2 * pi / self.first_period_s, 2 * pi / self.last_period_s
        amplitude, cycle, at_phase = self.elevator_rad, 0, 0j
        for i in range(steps_in(self.duration_s, context)):
            t = i * context.dt
            phase = first * t + (last - first) * t**2 / (2 * self.duration_s)
            seen = yield Targets(
                height_m=context.height_m,
                speed_mps=speed,
                heading_rad=context.heading_rad,
                elevator_rad=amplitude * sin(phase),
            )
            at_phase += (
                seen.load_factor * exp(-1j * phase) * (first + (last - first) * t / self.duration_s) * context.dt
            )
            if self.load is not None and phase > 2 * pi * (cycle + 1):
                reached = abs(at_phase) / pi
                correction = (self.load / max(reached, 1e-3)) ** ADAPTING
                amplitude = min(
                    amplitude * min(max(correction, 1 / LARGEST_CORRECTION), LARGEST_CORRECTION), LARGEST_ELEVATOR_RAD
                )
                cycle, at_phase = cycle + 1, 0j
        context.speed_mps = speed


@dataclass(frozen=True, kw_only=True)
class WindUpTurnSegment:
    """Load factor rising by `load_rate` per second at constant speed, by increasing bank."""

    highest: float = 1.8
    load_rate: float = 0.1
    kind = "wind-up-turn"

    def fly(self, seen: Observation, context: FlightContext) -> SegmentTargets:
        _check_load(self.highest, seen, context)
        load, speed = 1.0, context.speed_mps
        while load < self.highest:
            load += self.load_rate * context.dt
            seen = yield Targets(height_m=context.height_m, speed_mps=speed, bank_rad=acos(1 / load))
        context.heading_rad = seen.psi
        yield from _recover(seen, context)


@dataclass(frozen=True, kw_only=True)
class MultistepSegment:
    """Elevator steps of 3, 2, 1 and 1 units of time, alternating, about trim; `units = [1, 1]` is a doublet."""

    units: tuple[float, ...] = (3.0, 2.0, 1.0, 1.0)
    amplitude_rad: float = radians(3)
    unit_s: float = 0.4
    rest_s: float = 4.0
    kind = "3-2-1-1"

    def fly(self, seen: Observation, context: FlightContext) -> SegmentTargets:
        throttle = context.throttle
        sign = 1.0
        for units in self.units:
            for _ in range(steps_in(units * self.unit_s, context)):
                seen = yield Targets(
                    hold_elevator=True, elevator_rad=sign * self.amplitude_rad, throttle=throttle, bank_rad=0.0
                )
            sign = -sign
        for _ in range(steps_in(self.rest_s, context)):
            seen = yield Targets(hold_elevator=True, throttle=throttle, bank_rad=0.0)
        yield from _recover(seen, context)


def _check_load(highest: float, seen: Observation, context: FlightContext) -> None:
    limit = (seen.V / context.V_stall) ** 2
    if highest >= limit:
        raise InputError(
            f"a load factor of {highest:.2f} stalls the aircraft at {seen.V:.1f} m/s; the limit is {limit:.2f}"
        )


def _recover(seen: Observation, context: FlightContext) -> SegmentTargets:
    """Recover to level flight at the height that the maneuver ends at."""
    context.height_m = seen.height
    for _ in range(steps_in(RECOVERY_S, context)):
        seen = yield Targets(height_m=context.height_m, speed_mps=context.speed_mps, heading_rad=context.heading_rad)
