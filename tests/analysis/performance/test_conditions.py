"""Tests which weights and densities performance is computed for, with and without a request."""

import numpy as np
import pytest

from flightpower.analysis.curve import Condition
from flightpower.analysis.performance.request import FlownCondition, Request, density_altitude_m, requested_conditions
from flightpower.flight.atmosphere import density, pressure_at, temperature_at

TEST = Condition(weight_N=37.7, rho=1.19, wing_area_m2=0.4636)
FLIGHT = FlownCondition(TEST, 100_000.0, 290.0)


def test_density_altitude_inverts_the_standard_atmosphere() -> None:
    h = np.array([-200.0, 0.0, 1234.0, 5000.0, 10_000.0])
    assert density_altitude_m(density(pressure_at(h), temperature_at(h))) == pytest.approx(h, abs=1e-6)


def test_without_a_request_there_are_more_payload_hotter_air_and_a_higher_field() -> None:
    cases = dict(requested_conditions(Request(), FLIGHT))
    assert cases["300 g more"].weight_N == pytest.approx(37.7 + 0.3 * 9.80665)
    assert cases["300 g more"].rho == TEST.rho
    assert cases["15 °C hotter"].weight_N == TEST.weight_N
    assert cases["15 °C hotter"].rho == pytest.approx(100_000 / (287.05287 * 305.0))
    assert cases["1000 m higher"].rho < 0.92 * TEST.rho
    assert len(cases) == 8


def test_a_request_gives_every_weight_in_every_air() -> None:
    request = Request(weights_N=(30.0, 40.0), density_altitudes_m=(0.0, 2000.0))
    cases = requested_conditions(request, FLIGHT)
    assert len(cases) == 4
    assert {round(condition.rho, 3) for _, condition in cases} == {1.225, 1.006}
    assert {condition.weight_N for _, condition in cases} == {30.0, 40.0}
