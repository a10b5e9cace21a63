"""Equations of motion of a rigid aircraft over a flat, non-rotating earth (3.6-3.23).

Simulator, trim and estimators all use these functions, which accept floats, arrays and CasADi symbols. Misprints of
the source are corrected, such as signs in (3.10) and (3.11). Body axes: x forward, y right, z down, origin at the
center of gravity. A vector is a tuple of three components; an attitude is the tuple (phi, theta, psi); rates are (p, q,
r). qS is dynamic pressure times reference area, a force [N]; T thrust [N]; V airspeed [m/s]; g standard gravity
[m/s^2]. In function bodies c and s are cosine and sine; a, b, f, t, p stand for alpha, beta, phi, theta, psi.
"""

from typing import Any, NamedTuple

import numpy as np

from flightpower.flight.atmosphere import GRAVITY_MPS2 as g
from flightpower.flight.number import Number, Vector


class Inertia(NamedTuple):
    """Moments and product of inertia about body axes, and the propeller's inertia about its own axis [kg m^2]."""

    Ix: float
    Iy: float
    Iz: float
    Ixz: float = 0.0
    Ip: float = 0.0


class Airflow(NamedTuple):
    """Airspeed [m/s] and flow angles [rad]."""

    V: Any
    alpha: Any
    beta: Any


def flow_of(u: Number, v: Number, w: Number) -> Airflow:
    """Airspeed and flow angles from the velocity relative to the air in body axes (3.18-3.20)."""
    V = np.sqrt(u**2 + v**2 + w**2)
    return Airflow(V, np.arctan2(w, u), np.arcsin(v / V))


def velocity_of(V: Number, alpha: Number, beta: Number) -> tuple[Number, Number, Number]:
    """Body-axis velocity (u, v, w) [m/s] relative to the air (3.15-3.17)."""
    return V * np.cos(alpha) * np.cos(beta), V * np.sin(beta), V * np.sin(alpha) * np.cos(beta)


def velocity_derivative(
    velocity: Vector, rates: Vector, phi: Number, theta: Number, specific_force: Vector
) -> tuple[Number, Number, Number]:
    """(udot, vdot, wdot) [m/s^2] from velocity (u, v, w), rates, specific force (ax, ay, az) and gravity (3.6-3.8).

    specific_force: aerodynamic force plus thrust, divided by mass, as measured by an accelerometer at the center of
    gravity [m/s^2].
    """
    (u, v, w), (p, q, r), (ax, ay, az) = velocity, rates, specific_force
    return (
        r * v - q * w + ax - g * np.sin(theta),
        p * w - r * u + ay + g * np.cos(theta) * np.sin(phi),
        q * u - p * v + az + g * np.cos(theta) * np.cos(phi),
    )


def rate_derivative(
    rates: Vector, moment: Vector, inertia: Inertia, propeller_radps: Number = 0.0
) -> tuple[Number, Number, Number]:
    """(pdot, qdot, rdot) [rad/s^2] from the moment (L, M, N) [N m] about body axes (3.9-3.11).

    `propeller_radps`: angular speed of the propeller about +x (clockwise seen from behind). Its angular momentum adds
    omega x h = (0, rH, -qH) to the rate of change of momentum; (3.10) and (3.11) print these terms with the signs of
    a propeller that turns about -x.
    """
    (p, q, r), (L, M, N) = rates, moment
    Ix, Iy, Iz, Ixz, Ip = inertia
    H = Ip * propeller_radps
    roll = L - (Iz - Iy) * q * r + Ixz * q * p
    pitch = M - (Ix - Iz) * p * r - Ixz * (p**2 - r**2) - H * r
    yaw = N - (Iy - Ix) * p * q - Ixz * q * r + H * q
    # (3.9) and (3.11) are coupled by Ixz: solve the 2 x 2 system.
    determinant = Ix * Iz - Ixz**2
    return (Iz * roll + Ixz * yaw) / determinant, pitch / Iy, (Ix * yaw + Ixz * roll) / determinant


def attitude_derivative(phi: Number, theta: Number, p: Number, q: Number, r: Number) -> tuple[Number, Number, Number]:
    """(phidot, thetadot, psidot) [rad/s] (3.12-3.14)."""
    psidot = (q * np.sin(phi) + r * np.cos(phi)) / np.cos(theta)
    return p + psidot * np.sin(theta), q * np.cos(phi) - r * np.sin(phi), psidot


def earth_from_body(vector: Vector, attitude: Vector) -> tuple[Number, Number, Number]:
    """North, east and down components of a vector given in body axes (3-2-1 Euler angles)."""
    (x, y, z), (phi, theta, psi) = vector, attitude
    cf, sf, ct, st, cp, sp = np.cos(phi), np.sin(phi), np.cos(theta), np.sin(theta), np.cos(psi), np.sin(psi)
    return (
        ct * cp * x + (sf * st * cp - cf * sp) * y + (cf * st * cp + sf * sp) * z,
        ct * sp * x + (sf * st * sp + cf * cp) * y + (cf * st * sp - sf * cp) * z,
        -st * x + sf * ct * y + cf * ct * z,
    )


def body_from_earth(vector: Vector, attitude: Vector) -> tuple[Number, Number, Number]:
    """Body-axis components of a vector given by its north, east and down components; inverse of `earth_from_body`."""
    (n, e, d), (phi, theta, psi) = vector, attitude
    cf, sf, ct, st, cp, sp = np.cos(phi), np.sin(phi), np.cos(theta), np.sin(theta), np.cos(psi), np.sin(psi)
    return (
        ct * cp * n + ct * sp * e - st * d,
        (sf * st * cp - cf * sp) * n + (sf * st * sp + cf * cp) * e + sf * ct * d,
        (cf * st * cp + sf * sp) * n + (cf * st * sp - sf * cp) * e + cf * ct * d,
    )


def wind_axis_derivative(
    flow: Vector, attitude: Vector, rates: Vector, *, coefficients: Vector, T: Number, m: Number, qS: Number
) -> tuple[Number, Number, Number]:
    """(Vdot, alphadot, betadot) [m/s^2, rad/s, rad/s] of the flow (V, alpha, beta) (3.21-3.23).

    coefficients: (CL, CD, CY) as in `aerodynamics.Coefficients`; T: thrust along body x [N]; m: mass [kg]; qS: dynamic
    pressure times reference area, a force [N].
    """
    (V, alpha, beta), (phi, theta, _), (p, q, r), (CL, CD, CY) = flow, attitude, rates, coefficients
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    ct, st, cf, sf = np.cos(theta), np.sin(theta), np.cos(phi), np.sin(phi)
    CD_W = CD * cb - CY * sb
    CY_W = CY * cb + CD * sb
    Vdot = -qS / m * CD_W + T / m * ca * cb + g * (cf * ct * sa * cb + sf * ct * sb - st * ca * cb)
    alphadot = (
        -qS * CL / (m * V * cb)
        + q
        - sb / cb * (p * ca + r * sa)
        - T * sa / (m * V * cb)
        + g / (V * cb) * (cf * ct * ca + st * sa)
    )
    betadot = (
        qS / (m * V) * CY_W
        + p * sa
        - r * ca
        + g / V * cb * sf * ct
        + sb / V * (g * ca * st - g * sa * cf * ct - T * ca / m)
    )
    return Vdot, alphadot, betadot


def specific_force_at(
    specific_force: Vector, rates: Vector, angular_acceleration: Vector, position_m: Vector
) -> tuple[Number, Number, Number]:
    """Specific force [m/s^2] at `position_m` (x, y, z from the center of gravity), given its value at the center of
    gravity.

    a + omegadot x r + omega x (omega x r), in body axes.
    """
    (ax, ay, az), (p, q, r), (pdot, qdot, rdot) = specific_force, rates, angular_acceleration
    x, y, z = position_m
    return (
        ax + qdot * z - rdot * y + p * (q * y + r * z) - x * (q**2 + r**2),
        ay + rdot * x - pdot * z + q * (p * x + r * z) - y * (p**2 + r**2),
        az + pdot * y - qdot * x + r * (p * x + q * y) - z * (p**2 + q**2),
    )
