"""The equations of the reconstruction: how states follow one another, and what each sensor shows of them.

States at each instant: Euler angles, inertial velocity north-east-down, height, the slow wind and gusts (those across
the flight with what their filters remember). Shared by the whole flight: biases and scales of the sensors, how late
they are. Functions are written with NumPy and evaluated by CasADi over all instants at once, with exact
derivatives.

The aircraft answers to gusts. It heaves with them within a second and turns its nose into them within two; only its
speed is slow to follow. What a gust and the answer to it have in common would be taken for an error of a sensor, were
it free to enter beside one (docs/estimators.md has the figures). Hence gusts are along the aircraft's own axes, their
effect on the flow depends on the slow flow alone, a scale stands beside what the past foretells (given for each step),
and what is shown is differentiated where the past foretells the aircraft to be: residuals are exact, only their weights
know nothing of the gust of the moment. In other words, instrumental variables.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from analysis.trajectory.smoother import Linearised
from flight import motion
from flight.atmosphere import GRAVITY_MPS2 as g

if hasattr(ca.GlobalOptions, "setNumpyMode"):  # from 3.8 on: keep NumPy functions on symbols as they always were
    ca.GlobalOptions.setNumpyMode(-1)

Array = NDArray[np.float64]

WITHIN = ("gust_v_twice", "gust_w_twice")  # what the filters that make gusts across the flight remember
STATES = ("phi", "theta", "psi", "v_north", "v_east", "v_down", "height",
          "wind_north", "wind_east", "gust_u", "gust_v", "gust_w", *WITHIN)  # fmt: skip
SENSOR_ERRORS = ("p_bias", "q_bias", "r_bias", "ax_bias", "ay_bias", "az_bias", "alpha_bias", "alpha_scale",
                 "beta_bias", "V_scale", "air_data_lag", "gps_latency", "heading_bias")  # fmt: skip
# Means between two instants; what they leave out of the change of angles and velocity; by how much wind grows with
# height; how much of gusts stays.
MOVE = ("p", "q", "r", "ax", "ay", "az", "dt", "more_phi", "more_theta", "more_psi",
        "more_north", "more_east", "more_down", "sheared", "stays_u", "stays_v", "stays_w")  # fmt: skip
SHOWN = ("V", "alpha", "beta", "height", "gps_north", "gps_east", "gps_down", "v_north", "v_east", "v_down", "compass")
# The flow as the past foretells it; variance of gusts, (m/s)^2; d ln V/d ln(pressure of the pair for angle of attack).
PREDICTED_FLOW = ("slow_V", "slow_alpha", "gusts_across", "V_per_pair")
FIELD = ("field_ahead", "field_right")  # of the earth, measured, and levelled by the attitude as it is known by now [T]
# The angle that the slope multiplies, its derivative, and by how much its mean over a block is beside its middle.
ANGLE = ("alpha", "slope_alpha", "bent_alpha")
GIVEN = ("ax", "ay", "az", "slope_V", *ANGLE, *PREDICTED_FLOW, *FIELD)


def process(a: Any, b: Any, c: Any, u: Any) -> Sequence[Any]:
    """State b minus what state a and the mean rates and specific forces u between them lead to; errors c.

    Mean rates and forces at the mean attitude are not the mean of their effect: u's `more_` are what is missing.
    """
    phi, theta, psi = (a.phi + b.phi) / 2, (a.theta + b.theta) / 2, (a.psi + b.psi) / 2
    turning = motion.attitude_derivative(phi, theta, u.p - c.p_bias, u.q - c.q_bias, u.r - c.r_bias)
    force = motion.earth_from_body(u.ax - c.ax_bias, u.ay - c.ay_bias, u.az - c.az_bias, phi, theta, psi)
    v_once, v_twice = _swaying(a.gust_v, a.gust_v_twice, b.gust_v, b.gust_v_twice, u.stays_v)
    w_once, w_twice = _swaying(a.gust_w, a.gust_w_twice, b.gust_w, b.gust_w_twice, u.stays_w)
    return (
        b.phi - a.phi - u.dt * turning[0] - u.more_phi,
        b.theta - a.theta - u.dt * turning[1] - u.more_theta,
        b.psi - a.psi - u.dt * turning[2] - u.more_psi,
        b.v_north - a.v_north - u.dt * force[0] - u.more_north,
        b.v_east - a.v_east - u.dt * force[1] - u.more_east,
        b.v_down - a.v_down - u.dt * (force[2] + g) - u.more_down,
        b.height - a.height + u.dt * (a.v_down + b.v_down) / 2,
        b.wind_north - u.sheared * a.wind_north,
        b.wind_east - u.sheared * a.wind_east,
        b.gust_u - u.stays_u * a.gust_u,
        v_once,
        w_once,
        v_twice,
        w_twice,
    )


def _swaying(gust_a: Any, twice_a: Any, gust_b: Any, twice_b: Any, stays: Any) -> tuple[Any, Any]:
    """What is new between two instants in a gust's noise filtered once, and twice (gusts.Swaying)."""
    once_a, once_b = (twice + (gust - twice) / np.sqrt(3) for gust, twice in ((gust_a, twice_a), (gust_b, twice_b)))
    return once_b - stays * once_a, twice_b - stays * twice_a - (1 - stays) * (once_a + once_b) / 2


def flow(x: Any, s: Any) -> motion.Airflow:
    """Airspeed [m/s] and flow angles [rad] at state x; s: PREDICTED_FLOW.

    What a gust does to the flow is its part along and across the slow flow, and on average what its square does to the
    speed. Along and across the quick flow, the gusts' own squares would look like an offset of angle of attack.
    """
    steady = x.v_north - x.wind_north, x.v_east - x.wind_east, x.v_down
    u, v, w = motion.body_from_earth(*steady, x.phi, x.theta, x.psi)
    V = np.sqrt(u**2 + v**2 + w**2 + 1e-6)  # never zero, for the derivative at rest
    ca, sa = np.cos(s.slow_alpha), np.sin(s.slow_alpha)
    return motion.Airflow(
        V - x.gust_u * ca - x.gust_w * sa - s.gusts_across / (2 * s.slow_V),
        np.arctan2(w, np.sqrt(u**2 + 1e-6)) + (x.gust_u * sa - x.gust_w * ca) / s.slow_V,
        np.arcsin(v / V) - x.gust_v / s.slow_V,
    )


def shown(x: Any, c: Any, v: Any) -> Sequence[Any]:
    """What each of SHOWN would be at state x, with the sensors' errors c and what is given, v.

    An airspeed that reads high by a fraction has a dynamic pressure high by twice that, and angles are pressures over
    dynamic pressure: they then read low by as much. An angle that reads low takes the wrong q_c/qbar from the probe's
    calibration, and speed with it. Pressures that come late are behind by their slope.

    Across magnetic north the earth has no field. How it was levelled is given: residuals know of the attitude, and
    change with it more than with the heading where the field is steep, but they show the heading alone. Else what iron
    leaves in the field would bank the aircraft.
    """
    V, alpha, beta = flow(x, v)
    slope = c.alpha_scale - 2 * c.V_scale
    bias_free = v.ax - c.ax_bias, v.ay - c.ay_bias, v.az - c.az_bias
    force = motion.earth_from_body(*bias_free, x.phi, x.theta, x.psi)
    return (
        V + (c.V_scale + v.V_per_pair * slope) * v.slow_V - c.air_data_lag * v.slope_V,
        alpha + v.bent_alpha + slope * v.alpha - c.air_data_lag * v.slope_alpha + c.alpha_bias,
        beta + c.beta_bias,
        x.height,
        x.v_north - c.gps_latency * force[0],
        x.v_east - c.gps_latency * force[1],
        x.v_down - c.gps_latency * (force[2] + g),
        x.v_north,
        x.v_east,
        x.v_down,
        v.field_ahead * np.sin(x.psi + c.heading_bias) + v.field_right * np.cos(x.psi + c.heading_bias),
    )


class Named:
    """Values by name: `x.theta`."""

    def __init__(self, names: Sequence[str], values: Iterable[Any]):
        self.__dict__.update(zip(names, values, strict=True))

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"no value is named {name!r}")


def _symbols(names: Sequence[str], vector: Any) -> Named:
    return Named(names, ca.vertsplit(vector))


class Equations:
    """The equations over `n` instants: residuals in standard deviations, and exact derivatives."""

    def __init__(self, n: int):
        self.n, nx, m = n, len(STATES), len(SENSOR_ERRORS)
        a, b, c = ca.SX.sym("a", nx), ca.SX.sym("b", nx), ca.SX.sym("c", m)
        u, weight_p = ca.SX.sym("u", len(MOVE)), ca.SX.sym("w", nx)
        moved = ca.vertcat(
            *process(_symbols(STATES, a), _symbols(STATES, b), _symbols(SENSOR_ERRORS, c), _symbols(MOVE, u))
        )
        r = moved * weight_p
        jacobian = ca.jacobian(r, ca.vertcat(a, b, c))
        self._process = _Mapped([a, b, c, u, weight_p], r, jacobian, n - 1)

        z, weight_z, v = ca.SX.sym("z", len(SHOWN)), ca.SX.sym("w", len(SHOWN)), ca.SX.sym("v", len(GIVEN))
        r = (ca.vertcat(*shown(_symbols(STATES, a), _symbols(SENSOR_ERRORS, c), _symbols(GIVEN, v))) - z) * weight_z
        w = ca.SX.sym("v'", len(GIVEN))
        foreseen = ca.substitute(ca.jacobian(r, ca.vertcat(a, c)), ca.vertcat(a, v), ca.vertcat(b, w))
        self._shown = _Mapped([a, b, c, z, weight_z, v, w], r, foreseen, n)

    def at(self, x: Array, shared: Array, data: "Data") -> Linearised:
        """Linearise at states x (n, nx) and shared numbers (m,)."""
        every = np.broadcast_to(shared, (self.n, len(shared)))
        moved = self._process(x[:-1], x[1:], every[:-1], data.move, data.process_weight)
        seen = self._shown(x, data.foreseen, every, data.shown, data.weight, data.given, data.given_foreseen)
        return Linearised(*moved, *seen)


@dataclass(frozen=True)
class Data:
    """What goes into the equations; columns as in MOVE, STATES, SHOWN and GIVEN. Weights are 1/sigma, 0 for nothing."""

    move: Array  # (n-1, ·)
    process_weight: Array  # (n-1, nx)
    shown: Array  # (n, ny)
    weight: Array  # (n, ny)
    given: Array  # (n, ·)
    foreseen: Array  # (n, nx), states at which what is shown is differentiated,
    given_foreseen: Array  # (n, ·), and what is given there


class _Mapped:
    """A vector function and its Jacobian over n rows at once, through memory that CasADi writes to directly."""

    def __init__(self, arguments: list[Any], r: Any, jacobian: Any, n: int):
        sparsity = jacobian.sparsity()
        rows, columns = (np.array(i) for i in sparsity.get_triplet())  # in the order in which CasADi stores nonzeros
        outputs = ca.cse([r, ca.vertcat(*jacobian.nonzeros())])
        self._buffer: Any
        self._buffer, self._run = ca.Function("f", arguments, outputs).map(n).buffer()
        self._r, self._nonzeros = np.empty((n, r.shape[0])), np.empty((n, sparsity.nnz()))
        self._buffer.set_res(0, self._r.data)
        self._buffer.set_res(1, self._nonzeros.data)
        self._shape, self._filled = (n, *jacobian.shape), rows * jacobian.shape[1] + columns

    def __call__(self, *arguments: Array) -> tuple[Array, Array]:
        """Residuals (n, rows), and derivatives (n, rows, columns)."""
        kept = [np.ascontiguousarray(argument, dtype=float) for argument in arguments]
        for i, argument in enumerate(kept):
            self._buffer.set_arg(i, argument.data)
        self._run()
        jacobian = np.zeros(self._shape)
        jacobian.reshape(self._shape[0], -1)[:, self._filled] = self._nonzeros
        return self._r.copy(), jacobian
