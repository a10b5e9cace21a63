"""Standing, take-off and landing as smooth prescribed motion, without wheels.

Position and attitude are polynomials of degree five in time that match velocity and acceleration at both ends.
Velocity, rates and specific force are their derivatives, so that IMU, barometer and GPS are consistent.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import GRAVITY_MPS2
from flightpower.flight.motion import body_from_earth


@dataclass(frozen=True)
class EndState:
    """One end of a prescribed motion.

    position: north, east, down [m], with its first two derivatives; attitude: roll, pitch, yaw [rad], with its rate.
    """

    position: Array
    velocity: Array
    acceleration: Array
    attitude: Array
    attitude_rate: Array

    @classmethod
    def at_rest(cls, position: Array, attitude: Array) -> "EndState":
        return cls(position, np.zeros(3), np.zeros(3), attitude, np.zeros(3))


@dataclass(frozen=True)
class Motion:
    """Motion at n times; arrays (n, 3)."""

    position: Array
    velocity: Array
    attitude: Array
    rates: Array  # body rates [rad/s]
    angular_acceleration: Array  # [rad/s^2]
    specific_force: Array  # [m/s^2], body axes

    @property
    def body_velocity(self) -> Array:
        return np.column_stack(body_from_earth(self.velocity.T, self.attitude.T))


def quintic(duration_s: float, start: tuple[float, float, float], end: tuple[float, float, float]) -> Polynomial:
    """The polynomial of degree five that has the given value and first and second derivatives at both ends."""
    T = duration_s
    x0, v0, a0 = start
    x1, v1, a1 = end
    rest = np.array([x1 - x0 - v0 * T - a0 * T**2 / 2, v1 - v0 - a0 * T, a1 - a0])
    matrix = np.array([[T**3, T**4, T**5], [3 * T**2, 4 * T**3, 5 * T**4], [6 * T, 12 * T**2, 20 * T**3]])
    return Polynomial([x0, v0, a0 / 2, *np.linalg.solve(matrix, rest)])


def move(start: EndState, end: EndState, duration_s: float, t: Array) -> Motion:
    """The motion from `start` to `end` at times t (n,) since its start."""
    positions = [
        quintic(
            duration_s,
            (start.position[i], start.velocity[i], start.acceleration[i]),
            (end.position[i], end.velocity[i], end.acceleration[i]),
        )
        for i in range(3)
    ]
    angles = [
        quintic(
            duration_s, (start.attitude[i], start.attitude_rate[i], 0.0), (end.attitude[i], end.attitude_rate[i], 0.0)
        )
        for i in range(3)
    ]

    def with_derivatives(curves: list[Polynomial]) -> tuple[Array, Array, Array]:
        x, v, a = (np.column_stack([c.deriv(k)(t) if k else c(t) for c in curves]) for k in range(3))
        return x, v, a

    return motion_of(with_derivatives(positions), with_derivatives(angles))


def smooth_step(x: Array) -> Array:
    """A step from 0 to 1 with zero slope and curvature at both ends."""
    return x**3 * (10 - 15 * x + 6 * x**2)


def motion_of(position: tuple[Array, Array, Array], attitude: tuple[Array, Array, Array]) -> Motion:
    """The motion with these positions and attitudes, each with its first two derivatives, (n, 3)."""
    (x, v, a), (angle, rate, rate_dot) = position, attitude
    phi, theta, _ = angle.T
    # The inverse of (3.12-3.14), and its derivative.
    (f1, t1, s1), (f2, t2, s2) = rate.T, rate_dot.T
    sf, cf, st, ct = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    p = f1 - s1 * st
    q = t1 * cf + s1 * sf * ct
    r = -t1 * sf + s1 * cf * ct
    pdot = f2 - s2 * st - s1 * ct * t1
    qdot = t2 * cf - t1 * sf * f1 + s2 * sf * ct + s1 * (cf * f1 * ct - sf * st * t1)
    rdot = -t2 * sf - t1 * cf * f1 + s2 * cf * ct + s1 * (-sf * f1 * ct - cf * st * t1)
    north, east, down = a.T
    force = body_from_earth((north, east, down - GRAVITY_MPS2), angle.T)
    return Motion(x, v, angle, np.column_stack([p, q, r]), np.column_stack([pdot, qdot, rdot]), np.column_stack(force))


def stand(position: Array, attitude: Array, n: int) -> Motion:
    """The motion of standing still, at n times."""
    zeros = np.zeros((n, 3))
    force = np.array(body_from_earth((0.0, 0.0, -GRAVITY_MPS2), attitude))
    return Motion(np.tile(position, (n, 1)), zeros, np.tile(attitude, (n, 1)), zeros, zeros, np.tile(force, (n, 1)))
