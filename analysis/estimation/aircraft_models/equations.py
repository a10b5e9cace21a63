"""Forces, equations of motion and measurement equations that several aircraft models share.

Arguments are floats, arrays or CasADi symbols: airspeed V [m/s], alpha and theta [rad], pitch rate q [rad/s], inputs u
and parameters p by name (see the package's docstring), advance ratio J_ref at which `thrust_slope` has no effect.
"""

from typing import Any

from analysis.estimation.aircraft_models.parameters import Constants
from analysis.estimation.model import NamedValues
from flight import motion
from flight.aerodynamics import body_axes


def reduced_pitch_rate(c: Constants, q: Any, V: Any) -> Any:
    """q c/(2 V)."""
    return q * c.chord / (2 * V)


def lift_and_drag(c: Constants, V: Any, alpha: Any, q: Any, u: NamedValues, p: NamedValues) -> tuple[Any, Any]:
    """CL (3.35) and CD (3.36)."""
    CL = p.CL0 + p.CLa * alpha + p.CLde * u.elevator + p.CLq * reduced_pitch_rate(c, q, V)
    return CL, p.A0 + p.A1 * CL + p.A2 * CL**2


def corrected_thrust(u: NamedValues, p: NamedValues, J_ref: float) -> Any:
    """Thrust of the table [N] with its estimated errors."""
    return u.thrust * (1 + p.thrust_scale + p.thrust_slope * (u.J - J_ref))


def wind_axis_derivative(
    c: Constants, V: Any, alpha: Any, theta: Any, q: Any, u: NamedValues, p: NamedValues, J_ref: float
) -> tuple[Any, Any]:
    """Vdot [m/s^2] and alphadot [rad/s] in still air."""
    CL, CD = lift_and_drag(c, V, alpha, q, u, p)
    Vdot, alphadot, _ = motion.wind_axis_derivative(
        V, alpha, u.beta, u.phi, theta, u.p, q, u.r,
        CL=CL, CD=CD, CY=0.0, T=corrected_thrust(u, p, J_ref), m=c.m, qS=u.rho * V**2 / 2 * c.S,
    )  # fmt: skip
    return Vdot, alphadot


def specific_force(
    c: Constants, V: Any, alpha: Any, q: Any, u: NamedValues, p: NamedValues, J_ref: float
) -> tuple[Any, Any]:
    """ax, az [m/s^2] in body axes (3.39), (3.40)."""
    CX, CZ = body_axes(*lift_and_drag(c, V, alpha, q, u, p), alpha)
    qS = u.rho * V**2 / 2 * c.S
    return (qS * CX + corrected_thrust(u, p, J_ref)) / c.m, qS * CZ / c.m


def measured_specific_force(
    c: Constants, V: Any, alpha: Any, q: Any, u: NamedValues, p: NamedValues, J_ref: float
) -> tuple[Any, Any]:
    """ax, az [m/s^2] with the biases of the accelerometers."""
    ax, az = specific_force(c, V, alpha, q, u, p, J_ref)
    return ax + p.ax_bias, az + p.az_bias


def measured_air_data(x: NamedValues, p: NamedValues) -> tuple[Any, Any]:
    """V and alpha with scale and bias (3.43)."""
    return x.V * (1 + p.V_scale) + p.V_bias, x.alpha * (1 + p.alpha_scale) + p.alpha_bias


def climb_rate(V: Any, alpha: Any, theta: Any, u: NamedValues) -> Any:
    """hdot [m/s] in still air."""
    forward, right, down = motion.velocity_of(V, alpha, u.beta)
    return -motion.earth_from_body(forward, right, down, u.phi, theta, 0.0)[2]
