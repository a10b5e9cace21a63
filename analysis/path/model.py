"""The equations of the reconstruction: how states follow one another, and what each sensor shows of them.

States at each instant: Euler angles, inertial velocity north-east-down, height and the wind, gusts included. Shared by
the whole flight: the mean wind, biases and scales of the sensors. Functions are written with NumPy and evaluated by
CasADi over all instants at once, exact derivatives included.

The aircraft answers to gusts: within a second it drifts along with them, and its motion then shows the gust, the flow
at its nose does not. A scale error multiplies that flow, so what stands beside a scale has to be the flow at its nose as
speed and lift dictate it, slow and free of gusts; beside the motion it would be a fit to what gusts do, and come out far
off (docs/estimators.md has the figures). Hence `slow_V` and `slow_alpha`, given for each step from the path so far.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from analysis.path.batch import Linearised
from flight import motion
from flight.atmosphere import GRAVITY_MPS2 as g

Array = NDArray[np.float64]

STATES = ("phi", "theta", "psi", "v_north", "v_east", "v_down", "height",
          "wind_north", "wind_east", "wind_down")  # fmt: skip
SHARED = ("p_bias", "q_bias", "r_bias", "ax_bias", "ay_bias", "az_bias", "alpha_bias", "alpha_scale", "beta_bias",
          "V_scale", "air_data_lag", "gps_latency", "wind_north_mean", "wind_east_mean")  # fmt: skip
MOVE = ("p", "q", "r", "ax", "ay", "az", "dt", "stays", "stays_down")  # means between two instants; of gusts
SHOWN = ("V", "alpha", "beta", "height", "gps_north", "gps_east", "gps_down", "v_north", "v_east", "v_down")
GIVEN = ("ax", "ay", "az", "slow_V", "slow_alpha", "slope_V", "slope_alpha")


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
        b.wind_north - c.wind_north_mean - u.stays * (a.wind_north - c.wind_north_mean),
        b.wind_east - c.wind_east_mean - u.stays * (a.wind_east - c.wind_east_mean),
        b.wind_down - u.stays_down * a.wind_down,
    )


def shown(x: Any, c: Any, v: Any) -> Sequence[Any]:
    """What each of SHOWN would be at state x, with the sensors' errors c and what is given, v.

    An airspeed that reads high by a fraction has a dynamic pressure high by twice that, and angles are pressures over
    dynamic pressure: they then read low by as much. Pressures that come late are behind by their slope.
    """
    air = x.v_north - x.wind_north, x.v_east - x.wind_east, x.v_down - x.wind_down
    u, side, w = motion.body_from_earth(*air, x.phi, x.theta, x.psi)
    V = np.sqrt(u**2 + side**2 + w**2 + 1e-6)  # never zero, for the derivative at rest
    alpha, beta = np.arctan2(w, np.sqrt(u**2 + 1e-6)), np.arcsin(side / V)
    bias_free = v.ax - c.ax_bias, v.ay - c.ay_bias, v.az - c.az_bias
    force = motion.earth_from_body(*bias_free, x.phi, x.theta, x.psi)
    return (
        V + c.V_scale * v.slow_V - c.air_data_lag * v.slope_V,
        alpha + (c.alpha_scale - 2 * c.V_scale) * v.slow_alpha - c.air_data_lag * v.slope_alpha + c.alpha_bias,
        beta * (1 - 2 * c.V_scale) + c.beta_bias,
        x.height,
        x.v_north - c.gps_latency * force[0],
        x.v_east - c.gps_latency * force[1],
        x.v_down - c.gps_latency * (force[2] + g),
        x.v_north,
        x.v_east,
        x.v_down,
    )


class _Named:
    def __init__(self, names: Sequence[str], vector: Any):
        self.__dict__.update(zip(names, ca.vertsplit(vector), strict=True))


class Equations:
    """The equations over `n` instants: residuals in standard deviations, and exact derivatives."""

    def __init__(self, n: int):
        self.n, nx, m = n, len(STATES), len(SHARED)
        a, b, c = ca.SX.sym("a", nx), ca.SX.sym("b", nx), ca.SX.sym("c", m)
        u, weight_p = ca.SX.sym("u", len(MOVE)), ca.SX.sym("w", nx)
        moved = ca.vertcat(*process(_Named(STATES, a), _Named(STATES, b), _Named(SHARED, c), _Named(MOVE, u)))
        r = moved * weight_p
        jacobian = ca.jacobian(r, ca.vertcat(a, b, c))
        self._process = _Mapped([a, b, c, u, weight_p], r, jacobian, n - 1)

        z, weight_z, v = ca.SX.sym("z", len(SHOWN)), ca.SX.sym("w", len(SHOWN)), ca.SX.sym("v", len(GIVEN))
        r = (ca.vertcat(*shown(_Named(STATES, a), _Named(SHARED, c), _Named(GIVEN, v))) - z) * weight_z
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
        self._buffer: Any
        self._buffer, self._run = function.buffer()
        self._r, self._nonzeros = np.empty((n, r.shape[0])), np.empty((n, sparsity.nnz()))
        self._buffer.set_res(0, self._r.data)
        self._buffer.set_res(1, self._nonzeros.data)

    def __call__(self, *arguments: Array) -> tuple[Array, Array]:
        kept = [np.ascontiguousarray(argument, dtype=float) for argument in arguments]
        for i, argument in enumerate(kept):
            self._buffer.set_arg(i, argument.data)
        self._run()
        jacobian = np.zeros(self._shape)
        jacobian[:, self._rows, self._columns] = self._nonzeros
        return self._r.copy(), jacobian
