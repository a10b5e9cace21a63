"""Defines a run, a level acceleration or deceleration: its criteria, the legs of a speed history, reasons for
rejection.

The analysis (`analysis.maneuvers`) and the pilot's monitor (`daq.run_monitor`) judge by this module, so that a run
announced as good in flight is also a run for the analysis. Plain Python, because the aircraft's computer lacks numpy.

A leg lasts from one turning point of speed to the next; a run is the part of a leg in which speed changes. In gusts the
slope of speed changes sign every few seconds within a run. A leg continues through such changes; it ends when speed has
come back by a share of its value and by a share of the leg's total change.

Accelerations, climb rates, heights and durations marked "scaled" are multiplied by the aircraft's `speed_ratio`. A
slower aircraft changes its speed by the same share with a smaller acceleration, or in a shorter time, so its lower
limits are smaller. With the same excess force relative to its weight a much faster aircraft needs longer, so its upper
limits are larger.

An airspeed with little noise reveals even a gentler and smaller change: the lower limits of acceleration and of change
of speed are multiplied by `noise_share`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from flightpower.flight.settings import Settings, setting
from flightpower.flight.units import SEA_LEVEL_DENSITY

ACCELERATION, DECELERATION = "acceleration", "deceleration"


@dataclass(frozen=True)
class LevelRunSettings(Settings):
    """What counts as a level acceleration or deceleration."""

    smoothing_s: float = setting(
        2.2, "s", "the slope of speed with 0.3 m/s noise (Table 4.1) is then good to 0.06 m/s²"
    )
    changing_mps2: float = setting(0.15, "m/s²", "scaled; a run extends at its ends while speed changes faster")
    clearly_changing_mps2: float = setting(0.5, "m/s²", "scaled; the least peak acceleration of a run")
    mentioned_s: float = setting(
        3.0, "s", "scaled; a stretch this long is listed as rejected, a shorter one is ignored"
    )
    shortest_s: float = setting(5.0, "s", "scaled with speed; after smoothing, which lengthens a run")
    longest_s: float = setting(
        40.0, "s", "scaled; a longer change of speed is several maneuvers, with speed held between"
    )
    smallest_speed_change: float = setting(
        0.2, "1", "of the mean speed, times the share of noise; less shows little of how drag depends on speed"
    )
    noise_mps: float = setting(
        0.15,
        "m/s",
        "of airspeed at 25 samples a second, half of that of Table 4.1, below which least accelerations and changes of"
        " speed are smaller in proportion: the slope of speed is known better",
    )
    largest_height_change_m: float = setting(20.0, "m", "scaled; beyond it a run is not level")
    largest_climb_mps: float = setting(
        1.2, "m/s", "scaled; mean of a run; a pilot holds this, take-off and approach are steeper"
    )
    steep_mps: float = setting(2.0, "m/s", "scaled for faster aircraft; a run ends where it climbs faster for a moment")
    largest_bank_rad: float = setting(
        math.radians(25), "rad", "a run ends where a turn begins: 10 % more lift than weight"
    )
    bank_time_constant_s: float = setting(
        3.0,
        "s",
        "slower changes of bank come from the lateral force balance, faster ones from the roll rate",
    )
    turning_share: float = setting(
        0.12,
        "1",
        "share of the speed; a change beyond it ends a leg: a pilot who holds speed stays within, and so do most"
        " gusts of W20 = 15 kt",
    )
    turning_share_of_gain: float = setting(0.25, "1", "share of the speed gained beyond which a leg also ends")
    held_share: float = setting(0.05, "1", "speed is held while it is within this share of a leg's first or last speed")
    largest_gap_share: float = setting(0.02, "1", "of a run in which a needed quantity was not measured")


@dataclass(frozen=True)
class AircraftSizeSettings(Settings):
    """How thresholds scale with the aircraft's size.

    They were set on aircraft of 20 m/s and 80 N/m^2. An aircraft with a lower wing loading flies the same lift
    coefficients at lower speeds. Speeds, changes of speed in a given time, and durations of runs scale with its speed
    at a lift coefficient of 1: durations, because thrust and drag over weight are the same. Dynamic pressures scale
    with the square of that speed, which is proportional to the wing loading. Faster aircraft keep the lower limits,
    which noise sets; above twice the reference speed the upper limits of a run's duration, climb rate and height range
    grow.
    """

    reference_mps: float = setting(
        11.0, "m/s", "speed at C_L = 1 at sea level, from which on least values are constant"
    )
    flying_Pa: float = setting(30.0, "Pa", "dynamic pressure of flight, scaled twice: C_L = 2.5 at reference_mps")
    least_flying_Pa: float = setting(
        8.0, "Pa", "three standard deviations of a mean over 0.2 s of 6 Pa of noise (Table 4.1)"
    )
    least_height_m: float = setting(
        20.0,
        "m",
        "scaled, as climb is: below it wind shear matters, since climb times the wind's gradient, which is inverse to"
        " height, acts like an acceleration; twenty meters are eleven spans, and ten meters of a light aircraft still"
        " six: ground effect is below 0.1 % of induced drag from two spans on (McCormick)",
    )


@dataclass(frozen=True)
class StandingSettings(Settings):
    """Criteria for an aircraft that stands still: the spread of its sensors within a second, and the motor speed."""

    rate_spread_radps: float = setting(
        0.03, "rad/s", "bench noise is 0.005 rad/s (Table 4.1); gusts on the ground add to it"
    )
    force_spread_mps2: float = setting(
        0.5, "m/s²", "bench noise is 0.06 m/s² (Table 4.1); gusts on the ground add to it"
    )
    airspeed_spread_Pa: float = setting(8.0, "Pa", "or that of the noise of the transducer")
    motor_revps: float = setting(1.0, "1/s", "a motor that turns slower stands")


LEVEL_RUN = LevelRunSettings()
AIRCRAFT_SIZE = AircraftSizeSettings()
STANDING = StandingSettings()


def speed_ratio(weight_N: float, wing_area_m2: float) -> float:
    """Ratio of the aircraft's speed at C_L = 1 to the reference speed."""
    return math.sqrt(2 * (weight_N / wing_area_m2) / SEA_LEVEL_DENSITY) / AIRCRAFT_SIZE.reference_mps


def speed_scale(weight_N: float, wing_area_m2: float) -> float:
    """Return `speed_ratio`, limited to 1."""
    return min(1.0, speed_ratio(weight_N, wing_area_m2))


def larger(scale: float) -> float:
    """The factor on upper limits: 1 up to twice the reference speed. scale: the aircraft's `speed_ratio`."""
    return max(1.0, scale / 2)


def noise_share(noise_mps: float, step_s: float) -> float:
    """Noise of the speed divided by LEVEL_RUN.noise_mps, at most 1, and not below a limit that `turning_share` sets.

    noise_mps: noise of one sample of the speed. step_s: time between samples; the error of a slope falls with the
    square root of the rate.
    """
    least = LEVEL_RUN.turning_share / 2 / LEVEL_RUN.smallest_speed_change
    return min(1.0, max(least, noise_mps * math.sqrt(25 * step_s) / LEVEL_RUN.noise_mps))


def flying_Pa(scale: float) -> float:
    """Dynamic pressure [Pa] above which an aircraft flies and its flow angles are defined. scale: its `speed_scale`."""
    return max(AIRCRAFT_SIZE.least_flying_Pa, AIRCRAFT_SIZE.flying_Pa * min(1.0, scale) ** 2)


class Leg(NamedTuple):
    """A leg from one turning point of speed to the next, by index. sign: 1 (acceleration) or -1 (deceleration)."""

    sign: int
    first: int
    last: int

    @property
    def kind(self) -> str:
        return ACCELERATION if self.sign > 0 else DECELERATION


class _Point(NamedTuple):
    row: int
    V: float


class Legs:
    """The legs of a speed history, found while speeds [m/s] are added one by one."""

    def __init__(self) -> None:
        self._count, self._sign = 0, 0
        self._first = self._lowest = self._highest = _Point(0, math.nan)

    @property
    def last_point(self) -> _Point:
        """The furthest point of the current leg: the highest speed of an acceleration, the lowest of a deceleration."""
        return self._highest if self._sign > 0 else self._lowest

    def add(self, V: float) -> Leg | None:
        """Adds a speed. Returns the leg that ended with it."""
        point = _Point(self._count, V)
        self._count += 1
        if point.row == 0:
            self._first = self._lowest = self._highest = point
        self._highest = point if V > self._highest.V else self._highest
        self._lowest = point if V < self._lowest.V else self._lowest
        if self._sign == 0:
            if self._highest.V - self._lowest.V > LEVEL_RUN.turning_share * self._highest.V:
                self._sign = 1 if self._highest.row > self._lowest.row else -1
                self._first = self._lowest if self._sign > 0 else self._highest
            return None
        furthest = self.last_point
        gained = abs(furthest.V - self._first.V)
        if abs(furthest.V - V) <= max(LEVEL_RUN.turning_share * furthest.V, LEVEL_RUN.turning_share_of_gain * gained):
            return None
        ended = self.current()
        self._sign, self._first, self._lowest, self._highest = -self._sign, furthest, point, point
        return ended

    def current(self) -> Leg | None:
        """The leg that has not ended; None if speed never changed by `LEVEL_RUN.turning_share`."""
        return Leg(self._sign, self._first.row, self.last_point.row) if self._sign else None


def legs_of(speeds: Sequence[float]) -> list[Leg]:
    """All legs of a complete speed history [m/s]; empty if speed never changes by `LEVEL_RUN.turning_share`."""
    legs = Legs()
    ended = [leg for V in speeds if (leg := legs.add(V))]
    last = legs.current()
    return [*ended, last] if last else ended


def changing_part(speeds: Sequence[float], changing: Sequence[bool]) -> slice:
    """The rows of a leg in which speed changes, without the rows at either end in which it is held.

    speeds: speeds of the leg [m/s]. changing: whether speed changes in the leg's direction, faster than
    `changing_mps2`. The part extends from the last row near the first speed to the first row near the last speed, and
    further while speed continues to change.
    """
    first, last, end_row = speeds[0], speeds[-1], len(speeds) - 1
    begin = max(i for i, V in enumerate(speeds) if abs(V - first) <= LEVEL_RUN.held_share * first)
    end = next((i for i in range(begin, end_row) if abs(speeds[i] - last) <= LEVEL_RUN.held_share * last), end_row)
    while begin > 0 and changing[begin - 1]:
        begin -= 1
    while end < end_row and changing[end + 1]:
        end += 1
    return slice(begin, end + 1)


class RunRejected(StrEnum):
    """Reasons why a stretch in which speed changes is no run."""

    TOO_GENTLE = "too gentle"
    TOO_SHORT = "too short"
    TOO_LONG = "too long"
    SPEED_CHANGED_LITTLE = "speed changed little"
    HEIGHT_UNKNOWN = "height unknown"
    TOO_LOW = "too low"
    CLIMBED = "climbed"
    HEIGHT_VARIED = "height varied"
    BANKED = "banked"
    DATA_MISSING = "data missing"


class Rejection(NamedTuple):
    """The reason why a stretch is no maneuver of its kind, as a code, and the figures for a message.

    reason: `RunRejected`, or the enum of another kind of maneuver. measured, limit: values of the quantity that the
    reason names, in SI units, or as fractions of 1. quantity: the name of a quantity that was not measured.
    """

    reason: StrEnum
    measured: float = math.nan
    limit: float = math.nan
    quantity: str = ""


class RunMeasures(NamedTuple):
    """The measures by which the changing part of a leg is judged. Height and climb are NaN if no height was
    measured."""

    rows: int
    step_s: float
    seconds: float  # from the first row to the last
    peak_mps2: float  # largest acceleration in the leg's direction
    speed_change: float  # (largest - smallest)/mean speed
    lowest_m: float  # height above the ground; infinite if the ground's pressure is unknown
    mean_climb_mps: float
    height_range_m: float
    largest_bank_rad: float
    missing: tuple[str, float]  # a needed quantity, and the share of rows without it
    noise_share: float = 1.0

    @property
    def _least_change(self) -> float:
        return LEVEL_RUN.smallest_speed_change * self.noise_share

    def _clearly_changing_mps2(self, scale: float) -> float:
        return LEVEL_RUN.clearly_changing_mps2 * min(1.0, scale) * self.noise_share

    def negligible(self, scale: float) -> bool:
        """Whether speed was held, or the stretch is too short to be mentioned. scale: the aircraft's `speed_ratio`."""
        is_steady = self._gentle(scale) and self.speed_change < self._least_change
        return is_steady or self.rows < LEVEL_RUN.mentioned_s * min(1.0, scale) / self.step_s

    def _gentle(self, scale: float) -> bool:
        return self.peak_mps2 < self._clearly_changing_mps2(scale)

    def rejection(self, scale: float) -> Rejection | None:
        """Why this is no run; None if it is one. scale: the aircraft's `speed_ratio`."""
        limits, reasons = LEVEL_RUN, RunRejected
        shortest_s, longest_s = limits.shortest_s * min(1.0, scale), limits.longest_s * larger(scale)
        if self._gentle(scale):
            return Rejection(reasons.TOO_GENTLE, self.peak_mps2, self._clearly_changing_mps2(scale))
        if self.seconds < shortest_s:
            return Rejection(reasons.TOO_SHORT, self.seconds, shortest_s)
        if self.seconds > longest_s:
            return Rejection(reasons.TOO_LONG, self.seconds, longest_s)
        if self.speed_change < self._least_change:
            return Rejection(reasons.SPEED_CHANGED_LITTLE, self.speed_change, self._least_change)
        if low := too_low(self.lowest_m, scale):
            return low
        largest_climb_mps = limits.largest_climb_mps * min(1.0, scale) * larger(scale)
        if abs(self.mean_climb_mps) > largest_climb_mps:
            return Rejection(reasons.CLIMBED, self.mean_climb_mps, largest_climb_mps)
        if self.height_range_m > limits.largest_height_change_m * larger(scale):
            return Rejection(reasons.HEIGHT_VARIED, self.height_range_m, limits.largest_height_change_m * larger(scale))
        if self.largest_bank_rad > limits.largest_bank_rad:
            return Rejection(reasons.BANKED, self.largest_bank_rad, limits.largest_bank_rad)
        return missing_data(*self.missing)

    def seconds_more(self, scale: float) -> float | None:
        """How much longer the stretch being flown must last to become a run if its speed keeps changing as before [s].

        0 if it already is a run. None if speed is nearly held, or if a longer stretch would still be rejected.
        """
        if self._gentle(scale) or self.speed_change <= 0:
            return None
        shortest_s = LEVEL_RUN.shortest_s * min(1.0, scale)
        seconds = max(shortest_s, self.seconds * self._least_change / self.speed_change)
        completed = self._replace(
            seconds=max(seconds, self.seconds), speed_change=max(self.speed_change, self._least_change)
        )
        return completed.seconds - self.seconds if completed.rejection(scale) is None else None


def too_low(lowest_m: float, scale: float) -> Rejection | None:
    """The rejection of a stretch that is too close to the ground, or whose height [m] is NaN; otherwise None."""
    if math.isnan(lowest_m):
        return Rejection(RunRejected.HEIGHT_UNKNOWN)
    least_m = AIRCRAFT_SIZE.least_height_m * min(1.0, scale)
    return None if lowest_m >= least_m else Rejection(RunRejected.TOO_LOW, lowest_m, least_m)


def missing_data(quantity: str, share: float) -> Rejection | None:
    """The rejection of a stretch if a needed quantity is missing in too large a share of it; otherwise None."""
    if share <= LEVEL_RUN.largest_gap_share:
        return None
    return Rejection(RunRejected.DATA_MISSING, share, LEVEL_RUN.largest_gap_share, quantity)
