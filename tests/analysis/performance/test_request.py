"""Requests are read with their units; impossible ones are refused in one line that names the option."""

import pytest

from flightpower.analysis.performance.request import Request, parse_request
from flightpower.analysis.performance.settings import ASKED
from flightpower.flight.atmosphere import temperature_at
from flightpower.flight.errors import InputError
from flightpower.flight.units import TROPOPAUSE_M


def test_nothing_asked_is_the_default() -> None:
    assert parse_request() == Request(battery_Wh=None, usable=ASKED.usable, weights_N=(), density_altitudes_m=())


def test_units_are_understood() -> None:
    request = parse_request("74", "0.7", "3.8 kg, 9lbf,40 N", "0 m, 5000 ft, -200m")
    assert request.battery_Wh == 74.0 and request.usable == 0.7
    assert request.weights_N == pytest.approx((3.8 * 9.80665, 9 * 4.4482216, 40.0))
    assert request.density_altitudes_m == pytest.approx((0.0, 1524.0, -200.0))


@pytest.mark.parametrize(
    "text", ["0", "-5", "nan", "inf", "1e99 Wh", "seventy", "", "74 W", "5000 mAh, 14.8", "5000 mAh, 0 V"]
)
def test_an_energy_that_is_none(text: str) -> None:
    with pytest.raises(InputError, match=r"--battery-Wh.*watt hours above zero"):
        parse_request(battery_Wh=text)


@pytest.mark.parametrize(
    "text", ["74", "74 Wh", "74Wh", "0.074 kWh", "5000 mAh, 14.8 V", "5000mAh 14.8V", "5 Ah at 14.8 V", "5Ah x 14.8 V"]
)
def test_an_energy(text: str) -> None:
    assert parse_request(battery_Wh=text).battery_Wh == pytest.approx(74.0)


def test_what_is_far_from_the_aircraft_is_asked_about() -> None:
    """With 4 kg flown, 12.4 kg is over three times that, 74 J are 5 mWh/kg, and 2 kWh exceed 4 kg of the best cells."""
    flown_N = 4 * 9.80665
    assert parse_request("74", weights="3 kg, 9 lb, 11.9 kg, 1.4 kg").questions(flown_N) == []
    heavy, light = parse_request(weights="4 kg, 12.4 kg, 1.3 kg").questions(flown_N)
    assert heavy.startswith("Is --weights 12.4 kg right? It is 3.1 times the weight flown, 4 kg,")
    assert light.startswith("Is --weights 1.3 kg right? It is 0.33 times")
    (seconds,) = parse_request("74 J").questions(flown_N)
    assert seconds.startswith("Is --battery-Wh 0.0206 Wh right? That is 0.0051 Wh for each kilogram")
    assert len(parse_request("2 kWh").questions(flown_N)) == 1 and parse_request().questions(flown_N) == []


def test_a_charge_without_its_voltage_asks_for_it() -> None:
    with pytest.raises(InputError, match=r'voltage as well, such as "5000 mAh, 14.8 V"'):
        parse_request(battery_Wh="5000 mAh")


@pytest.mark.parametrize("text", ["0.8", "80%", "80 %"])
def test_a_share(text: str) -> None:
    assert parse_request(usable=text).usable == pytest.approx(0.8)


@pytest.mark.parametrize("text", ["120 %", "-10 %", "80 %%", "nan", "0", "1.01", "80", "most"])
def test_a_share_that_is_none(text: str) -> None:
    with pytest.raises(InputError, match=r"--usable.*between 0 and 1"):
        parse_request(usable=text)


@pytest.mark.parametrize("text", ["4", "0 kg", "-1 kg", "4 m", "3.8 kg,", "nan kg", "heavy", "1e6 N", "1000 kg"])
def test_a_weight_that_is_none(text: str) -> None:
    with pytest.raises(InputError, match=r"--weights.*above zero and below 1000 kg"):
        parse_request(weights=text)


@pytest.mark.parametrize("text", ["1000", "12 km", "3 kg", "nan m", "high"])
def test_a_height_that_is_none(text: str) -> None:
    with pytest.raises(InputError, match=r"--density-altitudes.*below 11000 m"):
        parse_request(density_altitudes=text)


def test_heights_end_where_the_standard_atmosphere_ceases_to_be_colder() -> None:
    """The limit is 11 km, where the standard atmosphere has 216.65 K."""
    assert temperature_at(TROPOPAUSE_M) == pytest.approx(216.65)
    assert parse_request(density_altitudes="10999 m").density_altitudes_m == pytest.approx((10999.0,))
    with pytest.raises(InputError, match="below 11000 m"):
        parse_request(density_altitudes="11001 m")
