"""Lag of a pneumatic line: a tube with a transducer's cavity at its end, as a first-order system."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, lfiltic

from flight.aircraft import PneumaticLine
from flight.atmosphere import viscosity

Array = NDArray[np.float64]


def time_constant_s(line: PneumaticLine, pressure_Pa: float, temperature_K: float) -> float:
    """Low-frequency limit of the response (Bergh & Tijdeman 1965, k = 1).

    Poiseuille's resistance times the compliance of the cavity and of half the tube.
    """
    d = line.diameter_m
    tube = np.pi / 4 * d**2 * line.length_m
    resistance = 128 * viscosity(temperature_K) * line.length_m / (np.pi * d**4)
    return float(resistance * (line.cavity_m3 + tube / 2) / pressure_Pa)


def first_order_lag(x: Array, dt: float, tau_s: float) -> Array:
    """Response of a first-order lag to x (n,), linear between its samples; exact, starting in equilibrium."""
    if tau_s <= 0 or len(x) == 0:
        return x
    a = np.exp(-dt / tau_s)
    mean = tau_s / dt * (1 - a)
    b0, b1 = 1 - mean, mean - a
    start = lfiltic([b0, b1], [1.0, -a], y=[x[0]], x=[x[0]])
    return np.asarray(lfilter([b0, b1], [1.0, -a], x, zi=start)[0])
