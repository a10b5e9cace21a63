"""How far a pressure at the end of a tube lags behind the one at its mouth."""

import math

from flight.aircraft import Line
from flight.atmosphere import viscosity


def low_frequency_lag_s(line: Line, *, static_Pa: float, temperature_K: float) -> float:
    """Lag of tube and cavity for slow changes (the limit of Bergh & Tijdeman 1965, polytropic exponent 1) [s].

    tau = 128 mu L (V_cavity + V_tube/2) / (pi d^4 p): laminar flow through the tube into the cavity and half of the
    tube's own volume.
    """
    tube_m3 = math.pi / 4 * line.diameter_m**2 * line.length_m
    resistance = 128 * viscosity(temperature_K) * line.length_m / (math.pi * line.diameter_m**4)
    return resistance * (line.cavity_m3 + tube_m3 / 2) / static_Pa
