"""Models the five-port probe: pressures at its ports by potential flow over a hemisphere.

One port is at the tip, two pairs are at 45 deg above, below, right and left. Cp = 1 - (9/4) sin^2 of the angle from
the stagnation point. The ring of static ports further back reads low in cross-flow.
"""

from typing import NamedTuple

import numpy as np

from flightpower.flight.aircraft import Position
from flightpower.flight.arrays import Array
from flightpower.flight.motion import Airflow
from flightpower.flight.number import Number, Vector

PORT_ANGLE_RAD = np.pi / 4
# A ring of four to eight static holes at angle s to the flow reads about -0.2 sin^2 s of the dynamic pressure (Gracey,
# NASA RP-1046, ch. 5, shapes of his curves); the tunnel calibration removes this error.
STATIC_CROSSFLOW = -0.2


class PortPressures(NamedTuple):
    """Pressures at the ports relative to the static pressure of the free stream [Pa], each (n,)."""

    center: Array
    lower_minus_upper: Array
    right_minus_left: Array
    static: Array


def hemisphere_Cp(cosine: Number) -> Number:
    """Pressure coefficient on the windward side, where the angle between surface normal and flow has this cosine."""
    return 1 - 9 / 4 * (1 - np.maximum(cosine, 0.0) ** 2)


def port_pressures(dynamic_pressure_Pa: Number, alpha_rad: Number, beta_rad: Number) -> PortPressures:
    """Port pressures from dynamic pressure [Pa] and flow angles at the probe [rad]; elementwise."""
    q = np.asarray(dynamic_pressure_Pa)
    x = np.cos(alpha_rad) * np.cos(beta_rad)
    y = np.sin(beta_rad)
    z = np.sin(alpha_rad) * np.cos(beta_rad)
    c, s = np.cos(PORT_ANGLE_RAD), np.sin(PORT_ANGLE_RAD)
    return PortPressures(
        center=q * hemisphere_Cp(x),
        lower_minus_upper=q * (hemisphere_Cp(c * x + s * z) - hemisphere_Cp(c * x - s * z)),
        right_minus_left=q * (hemisphere_Cp(c * x + s * y) - hemisphere_Cp(c * x - s * y)),
        static=q * STATIC_CROSSFLOW * (y**2 + z**2),
    )


def flow_at_probe(velocity: Vector, rates: Vector, position_m: Position, upwash_rad: Number) -> Airflow:
    """The flow at the probe's tip, from the velocity (u, v, w) [m/s] relative to the air at the center of gravity, body
    rates [rad/s] and upwash [rad]."""
    x, y, z = position_m
    p, q, r = rates
    u, v, w = velocity[0] + q * z - r * y, velocity[1] + r * x - p * z, velocity[2] + p * y - q * x
    V_probe = np.sqrt(u**2 + v**2 + w**2)
    return Airflow(V_probe, np.arctan2(w, u) + upwash_rad, np.arcsin(v / np.maximum(V_probe, 1e-12)))
