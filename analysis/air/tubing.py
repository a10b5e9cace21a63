"""The frequency response of pneumatic tubes: pressure at the transducer over pressure at the mouth.

H. Bergh and H. Tijdeman, Theoretical and Experimental Results for the Dynamic Response of Pressure Measuring Systems,
NLR-TR F.238, 1965. Assumptions: laminar flow, small disturbances, tube radius small against the wavelength, walls at a
constant temperature. Their recursion is written here for the admittance Y = U/p (volume flow over pressure), from the
last tube to the first. The results are the same, and this form also holds for a tube without a volume at its end.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import jve

from flightpower.flight.aircraft import PneumaticLine
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import density, viscosity

ComplexArray = NDArray[np.complex128]


class Gas(NamedTuple):
    """The gas in the tubes."""

    pressure_Pa: float
    density_kgpm3: float
    viscosity_Pas: float
    gamma: float = 1.4  # ratio of specific heats
    prandtl: float = 0.707  # air at 20 degC


def air(static_Pa: float, temperature_K: float) -> Gas:
    """Air of that pressure and temperature."""
    rho, mu = density(static_Pa, temperature_K), viscosity(temperature_K)
    return Gas(static_Pa, float(rho), float(mu))


def response(
    tubes: Sequence[PneumaticLine], frequency_Hz: Array, gas: Gas, *, polytropic: float = 1.0, stretch: float = 0.0
) -> ComplexArray:
    """Pressure in the last cavity over pressure at the first tube's mouth, as a complex number at each frequency.

    tubes: from the mouth on. Each ends in its cavity (volume 0 for none), where the next one begins.
    frequency_Hz: (n,), zero or more.
    polytropic: exponent k of the gas in the cavities. In a transducer's few cubic millimeters the gas is isothermal up
    to about 10 Hz (k = 1) and adiabatic at 100 Hz (k = 1.4).
    stretch: sigma, the relative increase of a cavity's volume by the diaphragm's deflection when the pressure doubles.
    """
    f = np.atleast_1d(np.asarray(frequency_Hz, dtype=float))
    omega = 2 * np.pi * np.where(f > 0, f, 1.0)  # the response at zero frequency is set to one below
    H: ComplexArray = np.ones(len(f), dtype=complex)
    Y: ComplexArray = np.zeros(len(f), dtype=complex)  # admittance of all that follows
    for tube in reversed(tubes):
        Y = Y + 1j * omega * tube.cavity_m3 * (stretch + 1 / polytropic) / gas.pressure_Pa
        phi, characteristic = _wave(tube, omega, gas)
        cosh, sinh = np.cosh(phi * tube.length_m), np.sinh(phi * tube.length_m)
        through = cosh + Y / characteristic * sinh
        H = H / through
        Y = (Y * cosh + characteristic * sinh) / through
    return np.where(f > 0, H, 1.0)


def _wave(tube: PneumaticLine, omega: Array, gas: Gas) -> tuple[ComplexArray, ComplexArray]:
    """Propagation constant phi [1/m] (their eq. 10) and characteristic admittance [m^3/(s Pa)] of a tube."""
    R = tube.diameter_m / 2
    alpha = 1j**1.5 * R * np.sqrt(omega * gas.density_kgpm3 / gas.viscosity_Pas)  # shear wave number
    slip = _J2_over_J0(alpha)
    n = 1 / (1 + (gas.gamma - 1) / gas.gamma * _J2_over_J0(alpha * np.sqrt(gas.prandtl)))  # polytropic, in the tube
    sound = np.sqrt(gas.gamma * gas.pressure_Pa / gas.density_kgpm3)
    phi = omega / sound * np.sqrt(gas.gamma / n / slip)
    # Mean velocity u = (i / omega rho) (-J2/J0) dp/dx, and dp/dx = -phi p in a wave that runs inwards.
    return phi, 1j / (omega * gas.density_kgpm3) * slip * phi * np.pi * R**2


def _J2_over_J0(x: ComplexArray) -> ComplexArray:
    """Ratio of Bessel functions. Both are scaled: the common factor cancels, and wide tubes do not overflow."""
    return np.asarray(jve(2, x) / jve(0, x))


def low_frequency_lag_s(tubes: Sequence[PneumaticLine], gas: Gas) -> float:
    """Lag of tubes and cavities for slow changes: the limit of `response` with k = 1 [s].

    For one tube tau = 128 mu L (V_cavity + V_tube/2) / (pi d^4 p): laminar flow through the tube into the cavity and
    half of the tube's own volume. In a series each tube also feeds all that follows.
    """
    lag_s, beyond_m3 = 0.0, 0.0
    for tube in reversed(tubes):
        beyond_m3 += tube.cavity_m3
        if tube.length_m > 0:
            resistance = 128 * gas.viscosity_Pas * tube.length_m / (math.pi * tube.diameter_m**4)
            lag_s += resistance * (beyond_m3 + tube_m3(tube) / 2) / gas.pressure_Pa
            beyond_m3 += tube_m3(tube)
    return lag_s


def tube_m3(line: PneumaticLine) -> float:
    """Volume of the tube alone."""
    return math.pi / 4 * line.diameter_m**2 * line.length_m


def remainder_of(line: PneumaticLine, gas: Gas) -> Callable[[Array], ComplexArray]:
    """A line's response without its lag for slow changes, as a function of frequency [Hz]."""
    lag_s = low_frequency_lag_s([line], gas)
    return lambda f: response([line], f, gas) * np.exp(2j * np.pi * f * lag_s)
