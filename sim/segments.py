"""The segments of a plan. Each tells the pilot what to hold, and until when (`sim.plan_segment.PlanSegment`)."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi, sin

from flightpower.flight.errors import InputError
from flightpower.sim.bench import (
    BoomWeightsSegment,
    BurstsSegment,
    ColumnSegment,
    DeflectSegment,
    HandTurnSegment,
    RunUpSegment,
    SixSidesSegment,
)
from flightpower.sim.integration import Observation
from flightpower.sim.maneuvers import MultistepSegment, PorpoiseSegment, RollerCoasterSegment, WindUpTurnSegment
from flightpower.sim.pilot import Targets, wrap_angle
from flightpower.sim.plan_segment import FlightContext, SegmentTargets, chosen_speed, steps_in

LEVEL_OFF_S = 10.0  # longest time to level off after a climb
ROLL_OUT_S = 5.0
EXCURSION_SHARE = 0.75  # the change of height is complete at this share of the run's change of speed
PROGRESS_LAG_S = 1.0  # time constant of the lag of the completed share of a run


@dataclass(frozen=True, kw_only=True)
class StandSegment:
    """Standing still on the ground."""

    duration_s: float
    kind = "stand"


@dataclass(frozen=True, kw_only=True)
class TakeOffSegment:
    """Take-off to trimmed flight along a smooth path (a quintic in time); the wheels are not modeled."""

    height_m: float = 20.0
    duration_s: float = 12.0
    speed_over_stall: float = 1.6
    kind = "take-off"


@dataclass(frozen=True, kw_only=True)
class LandSegment:
    """Landing to a stop along a smooth path."""

    duration_s: float = 14.0
    kind = "land"


@dataclass(frozen=True, kw_only=True)
class HoldSegment:
    """Hold height, heading and speed, to settle, or as a steady point for PIW-VIW."""

    duration_s: float
    speed_mps: float | None = None
    speed_over_stall: float | None = None
    speed_of_max: float | None = None
    wander_m: float = 0.0  # amplitude of a height error made of three sines
    wander_period_s: float = 12.0
    bank_rad: float | None = None  # an unintended gentle turn
    kind = "hold"

    def fly(self, seen: Observation, context: FlightContext) -> SegmentTargets:
        speed = chosen_speed(context, self.speed_mps, self.speed_over_stall, self.speed_of_max)
        for i in range(steps_in(self.duration_s, context)):
            offset, rate = _wander(i * context.dt, self.wander_m, self.wander_period_s)
            seen = yield Targets(
                height_m=context.height_m + offset,
                climb_mps=rate,
                speed_mps=speed,
                heading_rad=None if self.bank_rad is not None else context.heading_rad,
                bank_rad=self.bank_rad,
            )
        context.speed_mps = speed
        if self.bank_rad is not None:
            context.heading_rad = seen.psi


def _wander(t: float, amplitude: float, period: float) -> tuple[float, float]:
    """A sum of three sines with incommensurable periods [m], and its rate [m/s]."""
    if amplitude == 0.0:
        return 0.0, 0.0
    offset = rate = 0.0
    for share, ratio in ((0.5, 1.0), (0.3, 1.618), (0.2, 2.718)):
        omega = 2 * pi * ratio / period
        offset += share * amplitude * sin(omega * t)
        rate += share * amplitude * omega * cos(omega * t)
    return offset, rate


@dataclass(frozen=True, kw_only=True)
class ClimbSegment:
    """Climb or descend to a height at a rate and a speed.

    climb_over_stall : limits the rate to this multiple of the stalling speed, for aircraft that climb as steeply but
        fly slower.
    """

    height_m: float
    climb_mps: float = 2.5
    climb_over_stall: float | None = None
    speed_mps: float | None = None
    speed_over_stall: float | None = None
    speed_of_max: float | None = None
    kind = "climb"

    def rate_mps(self, context: FlightContext) -> float:
        limit = self.climb_over_stall
        return self.climb_mps if limit is None else min(self.climb_mps, limit * context.V_stall)

    def fly(self, seen: Observation, context: FlightContext) -> SegmentTargets:
        speed = chosen_speed(context, self.speed_mps, self.speed_over_stall, self.speed_of_max)
        start, target, rate = seen.height, context.height_m, self.rate_mps(context)
        up = 1.0 if self.height_m >= start else -1.0
        while (self.height_m - target) * up > 0:
            target += up * rate * context.dt
            seen = yield Targets(height_m=target, climb_mps=up * rate, speed_mps=speed, heading_rad=context.heading_rad)
        context.height_m, context.speed_mps = self.height_m, speed
        for _ in range(steps_in(LEVEL_OFF_S, context)):
            if abs(seen.height - self.height_m) < 0.5 and abs(seen.climb) < 0.2:
                break
            seen = yield Targets(height_m=self.height_m, speed_mps=speed, heading_rad=context.heading_rad)


@dataclass(frozen=True, kw_only=True)
class RunSegment:
    """An acceleration or deceleration: throttle ramps to `throttle` while height is held.

    It ends at the given speed, or after `longest`, whichever is first. `wander` and `end_higher` make case 2 of the
    source: height deviates and returns, or the run ends higher or lower.
    """

    throttle: float
    speed_mps: float | None = None
    speed_over_stall: float | None = None
    speed_of_max: float | None = None
    ramp_s: float = 1.0
    longest_s: float = 20.0
    wander_m: float = 0.0
    end_higher_m: float = 0.0
    bank_rad: float | None = None
    kind = "run"

    def fly(self, seen: Observation, context: FlightContext) -> SegmentTargets:
        until = chosen_speed(context, self.speed_mps, self.speed_over_stall, self.speed_of_max)
        faster = until > seen.V
        first = context.throttle
        steps = steps_in(self.longest_s, context)
        offset, x, begun_at = 0.0, 0.0, seen.V
        for i in range(steps):
            t = i * context.dt
            ramp = min(t / self.ramp_s, 1.0) if self.ramp_s > 0 else 1.0
            # x: completed share of the height excursion, a lagged function of speed. Half a sine of x returns to the
            # first height; half a cosine ends at another height.
            done = min(max((seen.V - begun_at) / (until - begun_at) / EXCURSION_SHARE, 0.0), 1.0)
            advance = (done - x) / PROGRESS_LAG_S
            x += advance * context.dt
            offset = self.wander_m * sin(pi * x) + self.end_higher_m * (1 - cos(pi * x)) / 2
            rate = pi * advance * (self.wander_m * cos(pi * x) + self.end_higher_m * sin(pi * x) / 2)
            seen = yield Targets(
                height_m=context.height_m + offset,
                climb_mps=rate,
                throttle=first + (self.throttle - first) * ramp,
                heading_rad=None if self.bank_rad is not None else context.heading_rad,
                bank_rad=self.bank_rad,
            )
            if t > self.ramp_s and (seen.V >= until if faster else seen.V <= until):
                break
        context.height_m += offset if self.end_higher_m else 0.0
        context.speed_mps = seen.V
        if self.bank_rad is not None:
            context.heading_rad = seen.psi


@dataclass(frozen=True, kw_only=True)
class TurnSegment:
    """Turn by an angle (positive: right) at a bank and a speed, level; then wings level."""

    angle_rad: float = pi
    bank_rad: float = 0.6
    speed_mps: float | None = None
    speed_over_stall: float | None = None
    speed_of_max: float | None = None
    kind = "turn"

    def fly(self, seen: Observation, context: FlightContext) -> SegmentTargets:
        speed = chosen_speed(context, self.speed_mps, self.speed_over_stall, self.speed_of_max)
        side = 1.0 if self.angle_rad >= 0 else -1.0
        turned, before = 0.0, seen.psi
        # The heading loop flies the last 0.35 rad and rolls out.
        while abs(turned) < abs(self.angle_rad) - 0.35:
            seen = yield Targets(height_m=context.height_m, speed_mps=speed, bank_rad=side * self.bank_rad)
            turned += wrap_angle(seen.psi - before)
            before = seen.psi
        context.heading_rad = wrap_angle(context.heading_rad + self.angle_rad)
        for _ in range(steps_in(ROLL_OUT_S, context)):
            seen = yield Targets(height_m=context.height_m, speed_mps=speed, heading_rad=context.heading_rad)
        context.speed_mps = speed


@dataclass(frozen=True, kw_only=True)
class ManualSegment:
    """A throttle history flown at constant height: times and throttles, interpolated linearly."""

    times: tuple[float, ...]  # [s]
    throttles: tuple[float, ...]
    kind = "manual"

    def fly(self, seen: Observation, context: FlightContext) -> SegmentTargets:
        if len(self.times) != len(self.throttles) or len(self.times) < 2 or sorted(set(self.times)) != list(self.times):
            raise InputError("manual: times must be ascending and have as many entries as throttles, two or more")
        for i in range(steps_in(self.times[-1], context)):
            throttle = _linear(i * context.dt, self.times, self.throttles)
            seen = yield Targets(height_m=context.height_m, throttle=throttle, heading_rad=context.heading_rad)
        context.speed_mps = seen.V


def _linear(t: float, times: Sequence[float], values: Sequence[float]) -> float:
    for a, b, ya, yb in zip(times, times[1:], values, values[1:], strict=False):
        if t <= b:
            return ya + (yb - ya) * (t - a) / (b - a)
    return values[-1]


AIRBORNE: dict[str, type] = {
    kind.kind: kind
    for kind in (
        HoldSegment,
        ClimbSegment,
        RunSegment,
        TurnSegment,
        RollerCoasterSegment,
        PorpoiseSegment,
        WindUpTurnSegment,
        MultistepSegment,
        ManualSegment,
    )
}
GROUND: dict[str, type] = {
    kind.kind: kind
    for kind in (
        StandSegment,
        TakeOffSegment,
        LandSegment,
        BurstsSegment,
        ColumnSegment,
        HandTurnSegment,
        DeflectSegment,
        RunUpSegment,
        BoomWeightsSegment,
        SixSidesSegment,
    )
}
