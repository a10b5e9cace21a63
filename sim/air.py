"""The air of a flight: pressure, temperature, wind with shear, updraft, thermal, and Dryden turbulence.

The functions accept floats, arrays and CasADi symbols.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from flight.atmosphere import density, pressure_at, temperature_at
from flight.number import Number

FOOT_M = 0.3048
# MIL-F-8785C sec. 3.7.3.4: the wind is given at 20 ft; roughness length 0.15 ft for all but the terminal phase.
WIND_HEIGHT_M = 20 * FOOT_M
ROUGHNESS_M = 0.15 * FOOT_M
# The boundary layer of the low-altitude model, 10 ft to 1,000 ft.
LOWEST_M, HIGHEST_M = 10 * FOOT_M, 1000 * FOOT_M
# Vertical wind is zero at the ground; a steady updraft grows linearly to its full speed over the first 20 m.
UPDRAFT_DEPTH_M = 20.0


@dataclass(frozen=True, kw_only=True)
class Air:
    """[air] of a plan."""

    ground_pressure_Pa: float = 100_000.0
    ground_temperature_K: float = 290.15
    ground_elevation_m: float = 110.0
    wind_mps: float = 0.0  # at 20 ft; other heights by the logarithmic profile
    wind_from_rad: float = 0.0
    turbulence_mps: float = 0.0  # W20 of the Dryden model
    thermal_mps: float = 0.0  # core updraft of one thermal
    thermal_radius_m: float = 60.0
    thermal_north_m: float = 0.0
    thermal_east_m: float = 0.0


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
    """(north, east, down) [m/s]: logarithmic profile (MIL-F-8785C sec. 3.7.3.4), steady updraft and one thermal.

    Zero at the ground. The thermal is a Gaussian column.
    """
    profile = np.log(np.maximum(height_m, ROUGHNESS_M) / ROUGHNESS_M) / np.log(WIND_HEIGHT_M / ROUGHNESS_M)
    speed = air.wind_mps * profile
    r2 = (north_m - air.thermal_north_m) ** 2 + (east_m - air.thermal_east_m) ** 2
    rising = updraft_mps + air.thermal_mps * np.exp(-r2 / (2 * air.thermal_radius_m**2))
    depth = np.clip(height_m / UPDRAFT_DEPTH_M, 0.0, 1.0)
    return -speed * np.cos(air.wind_from_rad), -speed * np.sin(air.wind_from_rad), -rising * depth


class GustStates(NamedTuple):
    """States of the shaping filters that turn white noise into gusts."""

    u: Any
    v1: Any
    v2: Any
    w1: Any
    w2: Any
    p: Any
    q: Any
    r: Any


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


def dryden_scales(W20_mps: Number, height_m: Number) -> Scales:
    """Low-altitude intensities and lengths (MIL-F-8785C sec. 3.7.3.4.1); lateral as longitudinal."""
    h_ft = np.clip(height_m, LOWEST_M, HIGHEST_M) / FOOT_M
    shape = 0.177 + 0.000823 * h_ft
    sigma_w = 0.1 * W20_mps
    return Scales(sigma_w / np.power(shape, 0.4), sigma_w, h_ft / np.power(shape, 1.2) * FOOT_M, h_ft * FOOT_M)


def dryden(
    states: GustStates, white: Number, *, V: Number, height_m: Number, span_m: float, W20_mps: float
) -> tuple[GustStates, Gust]:
    """Rates of change of the shaping filters, and the gusts they give (MIL-F-8785C sec. 3.7.1.2, Dryden form).

    white: four noises of unit two-sided intensity [1/sqrt(s)], for u, v, w and p; constant over a step of dt, they are
    standard normal numbers over sqrt(dt). V: airspeed [m/s]. The filters have the standard's spectra for frequencies
    s = j Omega V: first order in u and p, (1 + sqrt3 T s)/(1 + T s)^2 in v and w. q and r follow from w and v.
    """
    sigma_u, sigma_w, L_u, L_w = dryden_scales(W20_mps, height_m)
    V = np.maximum(V, 5.0)  # the filters need a speed above zero
    T_u, T_w = L_u / V, L_w / V
    n_u, n_v, n_w, n_p = white
    # Spectrum of p, integrated: variance 0.8 (pi/2) (pi/4b) (pi L_w/4b)^(1/3) sigma_w^2 / L_w.
    per_span = np.pi / (4 * span_m)
    sigma_p = sigma_w * np.sqrt(0.8 * np.pi / 2 * per_span / L_w * np.power(L_w * per_span, 1 / 3))
    T_p, T_r = 1 / (per_span * V), 3 * span_m / (np.pi * V)

    v = states.v2 + np.sqrt(3) * (states.v1 - states.v2)
    w = states.w2 + np.sqrt(3) * (states.w1 - states.w2)
    rates = GustStates(
        u=-states.u / T_u + sigma_u * np.sqrt(2 / T_u) * n_u,
        v1=-states.v1 / T_u + sigma_u / np.sqrt(T_u) * n_v,
        v2=(states.v1 - states.v2) / T_u,
        w1=-states.w1 / T_w + sigma_w / np.sqrt(T_w) * n_w,
        w2=(states.w1 - states.w2) / T_w,
        p=-states.p / T_p + sigma_p * np.sqrt(2 / T_p) * n_p,
        q=(w - states.q) / T_p,
        r=(v - states.r) / T_r,
    )
    # A gradient along x is a rotation of the air: q_g = -dw_g/dx, r_g = +dv_g/dx, with d/dx = (d/dt)/V.
    return rates, Gust(states.u, v, w, states.p, -rates.q / V, rates.r / V)
