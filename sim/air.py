"""Models the air of a flight: pressure, temperature, wind with shear and veer, updrafts, Dryden or von Karman
turbulence.

The functions accept floats, arrays and CasADi symbols.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.atmosphere import density, pressure_at, temperature_at
from flightpower.flight.errors import InputError
from flightpower.flight.number import Number, Vector

FOOT_M = 0.3048
# MIL-F-8785C sec. 3.7.3.4: the wind is given at 20 ft; the roughness length is 0.15 ft for all but the terminal phase.
WIND_HEIGHT_M = 20 * FOOT_M
ROUGHNESS_M = 0.15 * FOOT_M
# The boundary layer of the low-altitude model, 10 ft to 1,000 ft.
LOWEST_M, HIGHEST_M = 10 * FOOT_M, 1000 * FOOT_M
# Vertical wind is zero at the ground; a steady updraft grows linearly to its full speed over the first 20 m.
UPDRAFT_DEPTH_M = 20.0
VEER_DEPTH_M = 100.0
DRYDEN, VON_KARMAN = "dryden", "von-karman"


@dataclass(frozen=True, kw_only=True)
class Air:
    """The section [air] of a plan."""

    ground_pressure_Pa: float = 100_000.0
    ground_temperature_K: float = 290.15
    ground_elevation_m: float = 110.0
    wind_mps: float = 0.0  # wind at 20 ft; other heights follow the logarithmic profile
    wind_from_rad: float = 0.0
    veer_rad: float = 0.0  # the wind's turn to the right from the ground to VEER_DEPTH_M; linear in height
    turbulence_mps: float = 0.0  # W20, the wind at 20 ft that sets the turbulence
    gust_spectrum: str = DRYDEN
    gust_length_factor: float = 1.0  # scale lengths are this many times those of the standard
    convection_mps: float = 0.0  # rms of updrafts and downdrafts that vary from place to place
    convection_length_m: float = 200.0
    convection_seed: int = 0
    time_of_day_s: float = 34_200.0  # UTC at the start; the sun rises at 10:09 where the simulator flies
    thermal_mps: float = 0.0  # updraft in the core of one thermal
    thermal_radius_m: float = 60.0
    thermal_north_m: float = 0.0
    thermal_east_m: float = 0.0

    def __post_init__(self) -> None:
        if self.gust_spectrum not in (DRYDEN, VON_KARMAN):
            raise InputError(f"air: gust_spectrum: {self.gust_spectrum!r} is neither {DRYDEN} nor {VON_KARMAN}")


class Ambient(NamedTuple):
    """Static pressure [Pa], temperature [K] and density [kg/m^3]."""

    pressure: Any
    temperature: Any
    density: Any


def ambient(air: Air, height_m: Number) -> Ambient:
    """Pressure, temperature and density at a height above the ground [m]."""
    T = temperature_at(height_m, air.ground_temperature_K)
    p = pressure_at(height_m, ground_pressure_Pa=air.ground_pressure_Pa, ground_temperature_K=air.ground_temperature_K)
    return Ambient(p, T, density(p, T))


def mean_wind(
    air: Air, north_m: Number, east_m: Number, height_m: Number, updraft_mps: Number = 0.0
) -> tuple[Number, Number, Number]:
    """Mean wind (north, east, down) [m/s]: logarithmic profile (MIL-F-8785C sec. 3.7.3.4), updrafts, and one thermal.

    It is zero at the ground. The thermal is a Gaussian column. A wind that turns to the right with height occurs in the
    Ekman layer of the northern hemisphere (Stull, Boundary Layer Meteorology, sec. 6.6).
    """
    profile = np.log(np.maximum(height_m, ROUGHNESS_M) / ROUGHNESS_M) / np.log(WIND_HEIGHT_M / ROUGHNESS_M)
    speed = air.wind_mps * profile
    r2 = (north_m - air.thermal_north_m) ** 2 + (east_m - air.thermal_east_m) ** 2
    rising = updraft_mps + air.thermal_mps * np.exp(-r2 / (2 * air.thermal_radius_m**2))
    if air.convection_mps:
        rising = rising + air.convection_mps * updraft(
            north_m, east_m, length_m=air.convection_length_m, seed=air.convection_seed
        )
    depth = np.clip(height_m / UPDRAFT_DEPTH_M, 0.0, 1.0)
    wind_from: Number = air.wind_from_rad
    if air.veer_rad:
        wind_from = wind_from + air.veer_rad * height_m / VEER_DEPTH_M
    return -speed * np.cos(wind_from), -speed * np.sin(wind_from), -rising * depth


class GustStates(NamedTuple):
    """States of the shaping filters that turn white noise into gusts. The Dryden filters do not use the last three."""

    u: Any
    v1: Any
    v2: Any
    w1: Any
    w2: Any
    p: Any
    q: Any
    r: Any
    u2: Any
    v3: Any
    w3: Any


class Gust(NamedTuple):
    """Gust velocity (u, v, w) [m/s] and rotation of the air (p, q, r) [rad/s], body axes."""

    u: Any
    v: Any
    w: Any
    p: Any
    q: Any
    r: Any


class Scales(NamedTuple):
    """Intensities [m/s] and scale lengths [m] at a height."""

    sigma_u: Any
    sigma_w: Any
    L_u: Any
    L_w: Any


def gust_scales(W20_mps: Number, height_m: Number, length_factor: float = 1.0) -> Scales:
    """Low-altitude intensities and lengths (MIL-F-8785C sec. 3.7.3.4.1); lateral values equal longitudinal ones."""
    h_ft = np.clip(height_m, LOWEST_M, HIGHEST_M) / FOOT_M
    shape = 0.177 + 0.000823 * h_ft
    sigma_w = 0.1 * W20_mps
    L_u, L_w = h_ft / np.power(shape, 1.2) * FOOT_M, h_ft * FOOT_M
    return Scales(sigma_w / np.power(shape, 0.4), sigma_w, length_factor * L_u, length_factor * L_w)


def dryden(states: GustStates, white: Number, *, V: Number, span_m: float, scales: Scales) -> tuple[GustStates, Gust]:
    """Rates of change of the shaping filters, and the gusts they give (MIL-F-8785C sec. 3.7.1.2, Dryden form).

    white: four noises of unit two-sided intensity [1/sqrt(s)], for u, v, w and p; held over a step of dt, they are
    standard normal numbers divided by sqrt(dt). V: airspeed [m/s]. The filters have the standard's spectra for
    frequencies s = j Omega V: first order in u and p, (1 + sqrt3 T s)/(1 + T s)^2 in v and w. q and r follow from w and
    v.
    """
    sigma_u, sigma_w, L_u, L_w = scales
    V = np.maximum(V, 5.0)  # the filters need a speed above zero
    T_u, T_w = L_u / V, L_w / V
    n_u, n_v, n_w, n_p = white
    v = states.v2 + np.sqrt(3) * (states.v1 - states.v2)
    w = states.w2 + np.sqrt(3) * (states.w1 - states.w2)
    p_rate, q_rate, r_rate = rotation_rates(states, v, w, n_p, V=V, span_m=span_m, scales=scales)
    rates = GustStates(
        u=-states.u / T_u + sigma_u * np.sqrt(2 / T_u) * n_u,
        v1=-states.v1 / T_u + sigma_u / np.sqrt(T_u) * n_v,
        v2=(states.v1 - states.v2) / T_u,
        w1=-states.w1 / T_w + sigma_w / np.sqrt(T_w) * n_w,
        w2=(states.w1 - states.w2) / T_w,
        p=p_rate,
        q=q_rate,
        r=r_rate,
        u2=-states.u2 / T_u,
        v3=-states.v3 / T_u,
        w3=-states.w3 / T_w,
    )
    return rates, gust_of(states, rates, (states.u, v, w), V)


def rotation_rates(
    states: GustStates, v: Number, w: Number, n_p: Number, *, V: Number, span_m: float, scales: Scales
) -> tuple[Number, Number, Number]:
    """Rates of change of the states p, q, r, for both Dryden and von Karman spectra."""
    _, sigma_w, _, L_w = scales
    # The integrated spectrum of p gives the variance 0.8 (pi/2) (pi/4b) (pi L_w/4b)^(1/3) sigma_w^2 / L_w.
    per_span = np.pi / (4 * span_m)
    sigma_p = sigma_w * np.sqrt(0.8 * np.pi / 2 * per_span / L_w * np.power(L_w * per_span, 1 / 3))
    T_p, T_r = 1 / (per_span * V), 3 * span_m / (np.pi * V)
    return -states.p / T_p + sigma_p * np.sqrt(2 / T_p) * n_p, (w - states.q) / T_p, (v - states.r) / T_r


def gust_of(states: GustStates, rates: GustStates, velocity: Vector, V: Number) -> Gust:
    """Return the gust. Gradients along x are rotations of the air: q_g = -dw_g/dx, r_g = dv_g/dx; d/dx = (d/dt)/V."""
    u, v, w = velocity
    return Gust(u, v, w, states.p, -rates.q / V, rates.r / V)


WAVES = 6
LENGTH_RATIO = 2.0  # ratio of longest to middle, and of middle to shortest wavelength


def updraft(north_m: Number, east_m: Number, *, length_m: float, seed: int) -> Number:
    """Updrafts and downdrafts such as convection makes in calm weather, with unit rms over all places; elementwise.

    They are a sum of plane waves of random direction and phase: its horizontal mean is zero, but its mean along one
    track is not. At 40 m in a boundary layer of 1 km the vertical air motion has a standard deviation of 0.44 times the
    convective velocity (Lenschow et al. 1980, J. Atmos. Sci. 37, eq. for w variance), 0.5 to 2 m/s on a day with sun.
    length_m: the middle wavelength.
    """
    total = 0.0
    for k_north, k_east, phase in _waves(length_m, seed).tolist():
        total = total + np.sqrt(2 / WAVES) * np.cos(k_north * north_m + k_east * east_m + phase)
    return total


@lru_cache(maxsize=16)
def _waves(length_m: float, seed: int) -> NDArray[np.float64]:
    """Wave numbers north and east [rad/m] and phase [rad] of each wave, (WAVES, 3)."""
    rng = np.random.default_rng([seed, 0xC0])
    lengths = length_m * np.geomspace(1 / LENGTH_RATIO, LENGTH_RATIO, WAVES)
    direction, phase = rng.uniform(0, 2 * np.pi, (2, WAVES))
    k = 2 * np.pi / lengths
    return np.column_stack([k * np.cos(direction), k * np.sin(direction), phase])


# Von Karman turbulence: filters whose spectra approximate those of MIL-F-8785C sec. 3.7.1.1. At high frequency they
# fall as Omega^(-5/3), as measured in the atmosphere, while Dryden's fall as Omega^-2.
# Rational approximations of the spectra, over T s with T = L/V (those of MathWorks' continuous von Karman model):
# longitudinal (1 + 0.25 Ts)/(1 + 1.357 Ts + 0.1987 (Ts)^2), lateral and vertical with numerator of second and
# denominator of third order.
LONGITUDINAL_ZERO, LONGITUDINAL_POLES = 0.25, (1.357, 0.1987)
LATERAL_ZEROS, LATERAL_POLES = (2.7478, 0.3398), (2.9958, 1.9754, 0.1539)


def von_karman(
    states: GustStates, white: Number, *, V: Number, span_m: float, scales: Scales
) -> tuple[GustStates, Gust]:
    """Rates of change of the shaping filters, and the gusts they give; arguments as for `sim.air.dryden`."""
    sigma_u, sigma_w, L_u, L_w = scales
    V = np.maximum(V, 5.0)
    T_u, T_w = L_u / V, L_w / V
    n_u, n_v, n_w, n_p = white
    u = sigma_u * np.sqrt(2 * T_u) * (states.u + LONGITUDINAL_ZERO * states.u2)
    v = sigma_u * np.sqrt(T_u) * _lateral(states.v1, states.v2, states.v3)
    w = sigma_w * np.sqrt(T_w) * _lateral(states.w1, states.w2, states.w3)
    p_rate, q_rate, r_rate = rotation_rates(states, v, w, n_p, V=V, span_m=span_m, scales=scales)
    a1, a2 = LONGITUDINAL_POLES
    rates = GustStates(
        u=states.u2 / T_u,
        v1=states.v2 / T_u,
        v2=states.v3 / T_u,
        w1=states.w2 / T_w,
        w2=states.w3 / T_w,
        p=p_rate,
        q=q_rate,
        r=r_rate,
        u2=(n_u - states.u - a1 * states.u2) / (a2 * T_u),
        v3=_last_rate(states.v1, states.v2, states.v3, n_v, T_u),
        w3=_last_rate(states.w1, states.w2, states.w3, n_w, T_w),
    )
    return rates, gust_of(states, rates, (u, v, w), V)


def _lateral(x1: Number, x2: Number, x3: Number) -> Number:
    b1, b2 = LATERAL_ZEROS
    return x1 + b1 * x2 + b2 * x3


def _last_rate(x1: Number, x2: Number, x3: Number, white: Number, T: Number) -> Number:
    a1, a2, a3 = LATERAL_POLES
    return (white - x1 - a1 * x2 - a2 * x3) / (a3 * T)
