"""The laws of mechanics by which one quantity of a flight shows another, once for tables and for logs of the daemon.

`laws` judges with them the units, signs and delays of a table's columns, `axes` the signs and axes of a daemon's log.
"""

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Protocol

import numpy as np

from flightpower.analysis.sources.quantities import Quantity
from flightpower.flight.arrays import Array
from flightpower.flight.units import GRAVITY_MPS2 as g

Q = Quantity


class Motion(StrEnum):
    """Laws, each named after the quantity that it shows."""

    LIFT_BY_ANGLE_OF_ATTACK = "lift rises with the angle of attack"
    FORCE_ALONG_PATH = "the force along the path gains speed and height"
    CLIMB = "a receiver's vertical velocity is the climb"
    COURSE_IN_TURN = "the course turns as the nose does"
    PULL_UP = "a pull-up takes lift"
    SIDE_FORCE = "air from the right pushes to the left"
    BANK_OF_TURN = "a roll changes the bank of a turn without sideslip"


class Signals(Protocol):
    """Quantities in SI units on one grid, (n,) each; NaN where one is not known, or the aircraft does not fly."""

    def __getitem__(self, quantity: Quantity) -> Array | None:
        """None where there is none."""
        ...

    def true_airspeed(self) -> Array: ...

    def pressure_of_flight(self) -> Array:
        """The divisor of lift: dynamic pressure, or a quantity proportional to it."""
        ...

    def climb(self) -> Array:
        """Rate of climb from pressure [m/s]."""
        ...

    def turn_rate(self) -> Array:
        """Rate of the course over ground [rad/s]."""
        ...

    def rate(self, value: Array) -> Array:
        """Derivative by time."""
        ...

    def change(self, value: Array, samples: int = 1) -> Array:
        """Difference between values so many samples apart."""
        ...


def quantity(signals: Signals, quantity: Quantity) -> Array:
    """Raises KeyError where there is none."""
    value = signals[quantity]
    if value is None:
        raise KeyError(quantity)
    return value


def _lift(s: Signals) -> tuple[Array, Array]:
    return quantity(s, Q.ANGLE_OF_ATTACK), -quantity(s, Q.FORCE_DOWN) / s.pressure_of_flight()


def _along_path(s: Signals) -> tuple[Array, Array]:
    """The gain is that of speed, and the share of gravity in a climb."""
    alpha, V = quantity(s, Q.ANGLE_OF_ATTACK), s.true_airspeed()
    force = quantity(s, Q.FORCE_FORWARD) * np.cos(alpha) + quantity(s, Q.FORCE_DOWN) * np.sin(alpha)
    return force, s.rate(V) + g * s.climb() / np.maximum(V, 1.0)


def _side_force(s: Signals) -> tuple[Array, Array]:
    """Changes are compared: offsets of both sensors drop out."""
    sideways = quantity(s, Q.SIDESLIP) * s.pressure_of_flight()
    return s.change(sideways), -s.change(quantity(s, Q.FORCE_RIGHT))


def _bank(s: Signals) -> tuple[Array, Array]:
    """The sine of the bank of a turn without sideslip is V r/g."""
    bank = np.arcsin(np.clip(s.true_airspeed() * quantity(s, Q.YAW_RATE) / g, -1, 1))
    return quantity(s, Q.ROLL_RATE), s.change(bank, 2)


# For each law, two signals (n,) that rise together. Each raises KeyError where a quantity is missing.
SIDES: Mapping[Motion, Callable[[Signals], tuple[Array, Array]]] = {
    Motion.LIFT_BY_ANGLE_OF_ATTACK: _lift,
    Motion.FORCE_ALONG_PATH: _along_path,
    Motion.CLIMB: lambda s: (s.climb(), -quantity(s, Q.VELOCITY_DOWN)),
    Motion.COURSE_IN_TURN: lambda s: (quantity(s, Q.YAW_RATE), s.turn_rate()),
    Motion.PULL_UP: lambda s: (s.true_airspeed() * quantity(s, Q.PITCH_RATE), -quantity(s, Q.FORCE_DOWN)),
    Motion.SIDE_FORCE: _side_force,
    Motion.BANK_OF_TURN: _bank,
}
