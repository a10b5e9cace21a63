"""Computes the lag of a pneumatic line: a tube with a transducer's cavity at its end, as a first-order system."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh
from scipy.signal import lfilter, lfiltic

from flightpower.flight.aircraft import PneumaticLine
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import density, viscosity

CELLS, GRID_S = 40, 2.5e-4  # division of a tube, and step of time, in `step_response`


def time_constant_s(line: PneumaticLine, pressure_Pa: float, temperature_K: float) -> float:
    """Low-frequency limit of the response (Bergh & Tijdeman 1965, k = 1).

    It is Poiseuille's resistance times the compliance of the cavity and of half the tube.
    """
    d = line.diameter_m
    tube = np.pi / 4 * d**2 * line.length_m
    resistance = 128 * viscosity(temperature_K) * line.length_m / (np.pi * d**4)
    return float(resistance * (line.cavity_m3 + tube / 2) / pressure_Pa)


class StepResponse(NamedTuple):
    """Pressure at the end of a line after a unit step at its mouth, at times t [s] since the step, (m,)."""

    t_s: Array
    value: Array

    def step(self, t: Array) -> Array:
        """The response at times t (n,) since the step."""
        return np.asarray(np.interp(t, self.t_s, self.value, left=0.0, right=1.0))

    def ramp(self, t: Array) -> Array:
        """The response to a ramp of slope one, which is the integral of the step response."""
        dt = self.t_s[1] - self.t_s[0]
        integral = np.concatenate([[0.0], np.cumsum((self.value[1:] + self.value[:-1]) / 2) * dt])
        return np.asarray(np.interp(t, self.t_s, integral) + np.maximum(t - self.t_s[-1], 0.0))


def step_response(
    line: PneumaticLine, pressure_Pa: float, temperature_K: float, more_lag_s: float = 0.0
) -> StepResponse:
    """The step response of a line, and of a first-order lag behind it.

    The tube is divided into CELLS of equal length, each with Poiseuille's resistance, the inertia of a parabolic
    profile (4/3 of the gas) and the compliance of its gas; the cavity is at the end. Its mean delay is
    `time_constant_s`. The response is within 3 % of Bergh & Tijdeman for lags of 15 ms or more; a shorter tube rings,
    and its resistance then depends on frequency.
    """
    lag_s = time_constant_s(line, pressure_Pa, temperature_K) + more_lag_s
    t: Array = np.arange(0.0, 12 * lag_s + 0.02, GRID_S)
    if line.length_m <= 0:
        return StepResponse(t, first_order_lag(np.r_[0.0, np.ones(len(t) - 1)], GRID_S, more_lag_s))
    d, length, mu = line.diameter_m, line.length_m / CELLS, viscosity(temperature_K)
    conductance = np.pi * d**4 / (128 * mu * length)
    # Each cell has a node at its end; the volume between two nodes is split equally between them.
    volume = np.full(CELLS, np.pi / 4 * d**2 * length)
    volume[-1] = volume[-1] / 2 + line.cavity_m3
    flow = conductance * (2 * np.eye(CELLS) - np.eye(CELLS, k=1) - np.eye(CELLS, k=-1))
    flow[-1, -1] = conductance
    rates, modes = eigh(flow, np.diag(volume / pressure_Pa))
    shares = modes[-1] * (modes.T @ (volume / pressure_Pa))
    # Without inertia each mode decays at its rate; with it T s^2 + s + rate = 0, T being inertia over resistance.
    T = density(pressure_Pa, temperature_K) * d**2 / (24 * mu)
    root = np.sqrt(1 - 4 * T * rates + 0j)
    s1, s2 = (-1 + root) / (2 * T), (-1 - root) / (2 * T)
    decay = (s2 * np.exp(np.outer(t, s1)) - s1 * np.exp(np.outer(t, s2))) / (s2 - s1)
    return StepResponse(t, first_order_lag(1 - np.real(decay @ shares), GRID_S, more_lag_s))


def first_order_lag(x: Array, dt: float, tau_s: float) -> Array:
    """Exact response of a first-order lag to x (n,), which is linear between its samples; it starts in equilibrium."""
    if tau_s <= 0 or len(x) == 0:
        return x
    a = np.exp(-dt / tau_s)
    mean = tau_s / dt * (1 - a)
    b0, b1 = 1 - mean, mean - a
    start = lfiltic([b0, b1], [1.0, -a], y=[x[0]], x=[x[0]])
    return np.asarray(lfilter([b0, b1], [1.0, -a], x, zi=start)[0])
