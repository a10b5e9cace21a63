"""The laws of mechanics by which one quantity of a flight reveals another, shared by tables and logs of the daemon.

With them `laws` judges the units, signs and delays of a table's columns, and `axes` the signs and axes of daemon logs.
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
    """Laws of motion, each with a description."""

    LIFT_BY_ANGLE_OF_ATTACK = "lift rises with the angle of attack"
    FORCE_ALONG_PATH = "the force along the path gains speed and height"
    CLIMB = "a receiver's vertical velocity is the climb"
    COURSE_IN_TURN = "the course turns as the nose does"
    PULL_UP = "a pull-up takes lift"
    SIDE_FORCE = "air from the right pushes to the left"
    BANK_OF_TURN = "a roll changes the bank of a turn without sideslip"


class Signals(Protocol):
    """Quantities in SI units on one grid, (n,) each; NaN where one is not known or the aircraft is not flying."""

    def __getitem__(self, quantity: Quantity) -> Array | None:
        """Return the quantity (n,); None if there is none."""
        ...

    def true_airspeed(self) -> Array: ...

    def pressure_of_flight(self) -> Array:
        """Return dynamic pressure, or a quantity proportional to it; forces are divided by it."""
        ...

    def climb(self) -> Array:
        """Return the rate of climb from pressure or height [m/s]."""
        ...

    def turn_rate(self) -> Array:
        """Return the rate of the course over ground [rad/s]."""
        ...

    def rate(self, value: Array) -> Array:
        """Return the derivative with respect to time."""
        ...

    def change(self, value: Array, samples: int = 1) -> Array:
        """Return the change over this many samples."""
        ...


def quantity(signals: Signals, quantity: Quantity) -> Array:
    """Return the quantity (n,). Raises KeyError if there is none."""
    value = signals[quantity]
    if value is None:
        raise KeyError(quantity)
    return value


def _lift(s: Signals) -> tuple[Array, Array]:
    return quantity(s, Q.ANGLE_OF_ATTACK), -quantity(s, Q.FORCE_DOWN) / s.pressure_of_flight()


def _along_path(s: Signals) -> tuple[Array, Array]:
    """Compare the force along the path with the rate of speed plus g times the sine of the climb angle."""
    alpha, V = quantity(s, Q.ANGLE_OF_ATTACK), s.true_airspeed()
    force = quantity(s, Q.FORCE_FORWARD) * np.cos(alpha) + quantity(s, Q.FORCE_DOWN) * np.sin(alpha)
    return force, s.rate(V) + g * s.climb() / np.maximum(V, 1.0)


def _side_force(s: Signals) -> tuple[Array, Array]:
    """Compare changes rather than values, so that offsets of both sensors drop out."""
    sideways = quantity(s, Q.SIDESLIP) * s.pressure_of_flight()
    return s.change(sideways), -s.change(quantity(s, Q.FORCE_RIGHT))


def _bank(s: Signals) -> tuple[Array, Array]:
    """Compare the roll rate with the change of bank, whose sine is V r/g in a turn without sideslip."""
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
