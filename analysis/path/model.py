"""The equations of the reconstruction: how states follow one another, and what each sensor shows of them.

States at each instant: Euler angles, inertial velocity north-east-down, height, horizontal wind, and three components
of the gust at the probe. Shared by the whole flight: biases and scales of the sensors and, where the aerodynamics are
estimated along, lift, drag and thrust. Functions are written with NumPy and evaluated by CasADi over all instants at
once, exact derivatives included.

The gust is added to airspeed and, divided by a reference speed from outside, to the angles (method section 8): entered
in the velocity itself, the gusts' variance would be taken for knowledge of the airspeed's scale.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from analysis.path.batch import Linearised
from flight import motion
from flight.aerodynamics import body_axes
from flight.atmosphere import GRAVITY_MPS2 as g

Array = NDArray[np.float64]

STATES = (
    "phi", "theta", "psi", "v_north", "v_east", "v_down", "height", "wind_north", "wind_east", "gust_u", "gust_v", "gust_w",
)  # fmt: skip
ERRORS = ("p_bias", "q_bias", "r_bias", "ax_bias", "ay_bias", "az_bias",
          "alpha_bias", "alpha_scale", "beta_bias", "V_scale", "gps_latency")  # fmt: skip
AERODYNAMICS = ("CL0", "CLa", "CLde", "CLq", "A0", "A1", "A2", "thrust_scale", "thrust_slope")
SHARED = (*ERRORS, *AERODYNAMICS)
MOVE = ("p", "q", "r", "ax", "ay", "az", "dt", "keep_u", "keep_v", "keep_w")  # means between two instants
SHOWN = ("V", "alpha", "beta", "height", "gps_north", "gps_east", "gps_down", "v_north", "v_east", "v_down", "ax", "az")
GIVEN = ("V_reference", "thrust", "thrust_per_speed", "V_of_thrust", "J", "elevator", "rho", "q", "ax", "ay", "az")
J_REFERENCE = 0.5


@dataclass(frozen=True)
class Airframe:
    m: float  # kg
    S: float  # m^2
    chord: float  # m


def process(a: Any, b: Any, c: Any, u: Any) -> Sequence[Any]:
    """State b minus what state a and the mean rates and specific forces u between them lead to; errors c."""
    phi, theta, psi = (a.phi + b.phi) / 2, (a.theta + b.theta) / 2, (a.psi + b.psi) / 2
    turning = motion.attitude_derivative(phi, theta, u.p - c.p_bias, u.q - c.q_bias, u.r - c.r_bias)
    force = motion.earth_from_body(u.ax - c.ax_bias, u.ay - c.ay_bias, u.az - c.az_bias, phi, theta, psi)
    return (
        b.phi - a.phi - u.dt * turning[0],
        b.theta - a.theta - u.dt * turning[1],
        b.psi - a.psi - u.dt * turning[2],
        b.v_north - a.v_north - u.dt * force[0],
        b.v_east - a.v_east - u.dt * force[1],
        b.v_down - a.v_down - u.dt * (force[2] + g),
        b.height - a.height + u.dt * (a.v_down + b.v_down) / 2,
        b.wind_north - a.wind_north,
        b.wind_east - a.wind_east,
        b.gust_u - u.keep_u * a.gust_u,
        b.gust_v - u.keep_v * a.gust_v,
        b.gust_w - u.keep_w * a.gust_w,
    )


def shown(x: Any, c: Any, v: Any, frame: Airframe) -> Sequence[Any]:
    """What each of SHOWN would be at state x, with the errors and aerodynamics c and what is given, v."""
    u, side, w = motion.body_from_earth(
        x.v_north - x.wind_north, x.v_east - x.wind_east, x.v_down, x.phi, x.theta, x.psi
    )
    V0 = np.sqrt(u**2 + side**2 + w**2 + 1e-6)  # never zero, for the derivative at rest
    alpha0, beta0 = np.arctan2(w, np.sqrt(u**2 + 1e-6)), np.arcsin(side / V0)
    V, alpha = V0 + x.gust_u, alpha0 + x.gust_w / v.V_reference
    bias_free = v.ax - c.ax_bias, v.ay - c.ay_bias, v.az - c.az_bias
    force = motion.earth_from_body(*bias_free, x.phi, x.theta, x.psi)
    ax, az = specific_force(V, alpha, c, v, frame)
    return (
        V0 * (1 + c.V_scale) + x.gust_u,
        alpha0 * (1 + c.alpha_scale) + c.alpha_bias + x.gust_w / v.V_reference,
        beta0 + c.beta_bias + x.gust_v / v.V_reference,
        x.height,
        x.v_north - c.gps_latency * force[0],
        x.v_east - c.gps_latency * force[1],
        x.v_down - c.gps_latency * (force[2] + g),
        x.v_north,
        x.v_east,
        x.v_down,
        ax + c.ax_bias,
        az + c.az_bias,
    )


def specific_force(V: Any, alpha: Any, c: Any, v: Any, frame: Airframe) -> tuple[Any, Any]:
    """(ax, az) [m/s^2] at the centre of gravity (3.39, 3.40), with C_D = A0 + A1 C_L + A2 C_L^2.

    Thrust was computed from the measured speed, `V_of_thrust`; it is corrected to the true one by its slope.
    """
    q_hat = (v.q - c.q_bias) * frame.chord / (2 * v.V_reference)
    CL = c.CL0 + c.CLa * alpha + c.CLde * v.elevator + c.CLq * q_hat  # (3.35)
    CD = c.A0 + c.A1 * CL + c.A2 * CL**2
    CX, CZ = body_axes(CL, CD, alpha)
    qS = v.rho * V**2 / 2 * frame.S
    thrust = v.thrust + v.thrust_per_speed * (V - v.V_of_thrust)
    thrust = thrust * (1 + c.thrust_scale + c.thrust_slope * (v.J - J_REFERENCE))
    return (qS * CX + thrust) / frame.m, qS * CZ / frame.m


class _Named:
    def __init__(self, names: Sequence[str], vector: Any):
        self.__dict__.update(zip(names, ca.vertsplit(vector), strict=True))


class Equations:
    """The equations of one airframe over `n` instants: residuals in standard deviations, and exact derivatives."""

    def __init__(self, frame: Airframe, n: int):
        self.n, nx, m = n, len(STATES), len(SHARED)
        a, b, c = ca.SX.sym("a", nx), ca.SX.sym("b", nx), ca.SX.sym("c", m)
        u, weight_p = ca.SX.sym("u", len(MOVE)), ca.SX.sym("w", nx)
        moved = ca.vertcat(*process(_Named(STATES, a), _Named(STATES, b), _Named(SHARED, c), _Named(MOVE, u)))
        r = moved * weight_p
        jacobian = ca.jacobian(r, ca.vertcat(a, b, c))
        self._process = _Mapped([a, b, c, u, weight_p], r, jacobian, n - 1)

        z, weight_z, v = ca.SX.sym("z", len(SHOWN)), ca.SX.sym("w", len(SHOWN)), ca.SX.sym("v", len(GIVEN))
        r = (ca.vertcat(*shown(_Named(STATES, a), _Named(SHARED, c), _Named(GIVEN, v), frame)) - z) * weight_z
        self._shown = _Mapped([a, c, z, weight_z, v], r, ca.jacobian(r, ca.vertcat(a, c)), n)

    def at(self, x: Array, shared: Array, data: "Data") -> Linearised:
        """Linearise at states x (n, nx) and shared numbers (m,)."""
        every = np.broadcast_to(shared, (self.n, len(shared)))
        moved = self._process(x[:-1], x[1:], every[:-1], data.move, data.process_weight)
        seen = self._shown(x, every, data.shown, data.weight, data.given)
        return Linearised(*moved, *seen)


@dataclass(frozen=True)
class Data:
    """What goes into the equations; columns as in MOVE, STATES, SHOWN and GIVEN. Weights are 1/sigma, 0 for nothing."""

    move: Array  # (n-1, ·)
    process_weight: Array  # (n-1, nx)
    shown: Array  # (n, ny)
    weight: Array  # (n, ny)
    given: Array  # (n, ·)


class _Mapped:
    """A vector function and its Jacobian over n rows at once, through memory that CasADi writes to directly."""

    def __init__(self, arguments: list[Any], r: Any, jacobian: Any, n: int):
        sparsity = jacobian.sparsity()
        self._rows, self._columns = (np.array(i) for i in sparsity.get_triplet())
        self._shape = (n, *jacobian.shape)
        # get_triplet lists nonzeros as CasADi stores them: column by column.
        function = ca.Function("f", arguments, [r, ca.vertcat(*jacobian.nonzeros())]).map(n)
        self._buffer, self._run = function.buffer()
        self._r, self._nonzeros = np.empty((n, r.shape[0])), np.empty((n, sparsity.nnz()))
        self._buffer.set_res(0, memoryview(self._r))
        self._buffer.set_res(1, memoryview(self._nonzeros))

    def __call__(self, *arguments: Array) -> tuple[Array, Array]:
        kept = [np.ascontiguousarray(argument, dtype=float) for argument in arguments]
        for i, argument in enumerate(kept):
            self._buffer.set_arg(i, memoryview(argument))
        self._run()
        jacobian = np.zeros(self._shape)
        jacobian[:, self._rows, self._columns] = self._nonzeros
        return self._r.copy(), jacobian
