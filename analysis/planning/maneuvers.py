"""The pieces that a flight plan is made of. Speeds are true airspeeds [m/s], angles in rad, times in s."""

from dataclasses import dataclass
from math import pi, tan

from flight.units import GRAVITY_MPS2


@dataclass(frozen=True)
class Stand:
    """Stand still on the ground, motor off."""

    duration_s: float


@dataclass(frozen=True)
class TakeOff:
    """Take off and climb to the height of the flight."""

    speed_mps: float


@dataclass(frozen=True)
class Hold:
    """Hold height, heading and speed; the change to this speed is part of the duration."""

    duration_s: float
    speed_mps: float


@dataclass(frozen=True)
class Turn:
    """A level turn at a bank and a speed, then wings level; angle positive to the right."""

    speed_mps: float
    angle_rad: float = pi
    bank_rad: float = 0.6

    @property
    def width_m(self) -> float:
        """Across the flight path before it, in still air: two radii V^2/(g tan(bank))."""
        return 2 * self.speed_mps**2 / (GRAVITY_MPS2 * tan(self.bank_rad))


@dataclass(frozen=True)
class Run:
    """An acceleration or deceleration: the throttle moves to `throttle` over `ramp_s`, until `until_mps` is reached."""

    throttle: float
    ramp_s: float
    until_mps: float
    longest_s: float = 20.0


@dataclass(frozen=True)
class Porpoise:
    """Stick fore and aft about level flight: the load factor swings by `load` to each side of 1."""

    duration_s: float
    speed_mps: float
    load: float
    first_period_s: float = 1.8
    last_period_s: float = 1.3


@dataclass(frozen=True)
class Land:
    """Descend, approach, land."""

    speed_mps: float


Maneuver = Stand | TakeOff | Hold | Turn | Run | Porpoise | Land
