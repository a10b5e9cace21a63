"""Compares with the printed tables of the standard atmosphere (U.S. Standard Atmosphere 1976, table I; ICAO Doc
7488/3)."""

import numpy as np
import pytest

from flightpower.flight import atmosphere

# Geopotential height [m], temperature [K], pressure [Pa], density [kg/m^3].
TABLE = (
    (0, 288.15, 101325.0, 1.2250),
    (1000, 281.65, 89874.6, 1.11164),
    (2000, 275.15, 79495.2, 1.00649),
    (5000, 255.65, 54019.9, 0.736116),
)


@pytest.mark.parametrize(("height", "temperature", "pressure", "density"), TABLE)
def test_standard_table(height, temperature, pressure, density):
    T, p = atmosphere.temperature_at(height), atmosphere.pressure_at(height)
    assert pytest.approx(temperature, abs=5e-3) == T
    assert p == pytest.approx(pressure, abs=0.06)  # the last printed digit
    assert atmosphere.density(p, T) == pytest.approx(density, rel=5e-6)


def test_height_is_the_inverse_of_pressure():
    heights = np.linspace(-100, 3000, 50)
    day = dict(ground_pressure_Pa=98_700.0, ground_temperature_K=301.0)
    assert np.allclose(atmosphere.height_at(atmosphere.pressure_at(heights, **day), **day), heights, atol=1e-8)


def test_pressure_falls_by_the_weight_of_the_air():
    h = np.array([499.5, 500.5])
    p = atmosphere.pressure_at(h, ground_pressure_Pa=99_000.0, ground_temperature_K=290.0)
    rho = atmosphere.density(p.mean(), atmosphere.temperature_at(500.0, 290.0))
    assert np.diff(p)[0] == pytest.approx(-rho * atmosphere.GRAVITY_MPS2, rel=1e-6)


def test_viscosity_at_sea_level():
    assert atmosphere.viscosity(288.15) == pytest.approx(1.7894e-5, rel=1e-4)


def test_a_foot_pound_per_second_is_a_pound_of_force_over_a_foot():
    assert pytest.approx(0.3048 * 0.45359237 * 9.80665, rel=1e-12) == atmosphere.FOOT_POUND_PER_SECOND_W
