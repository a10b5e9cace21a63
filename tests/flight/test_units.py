"""Quantities with units become SI values; wrong ones are refused with a message."""

import subprocess
import sys
from dataclasses import dataclass

import pytest

from flightpower.flight.errors import InputError
from flightpower.flight.units import COMMON_UNITS, _registry, read_table, split_unit, to_si


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("5.73 ft", "m", 1.746504),
        ("4.99 ft^2", "m^2", 0.463586169),
        ("4.99 ft2", "m^2", 0.463586169),
        ("4.99 sqft", "m^2", 0.463586169),
        ("0.464 m2", "m^2", 0.464),
        ("8.47 lbf", "N", 37.67643715),
        ("2.4 inH2O", "Pa", 597.8138),
        ("15 knot", "m/s", 7.716666667),
        ("0.19 ft/s^2", "m/s^2", 0.057912),
        ("1 deg", "rad", 0.01745329252),
        ("20 degC", "K", 293.15),
        ("20 mm^3", "m^3", 2e-8),
        ("6000 rpm", "turn/s", 100.0),
        ("74 W h", "W h", 74.0),
    ],
)
def test_conversions(text, unit, value):
    assert to_si(text, unit, "key") == pytest.approx(value, rel=1e-6)


# Spellings that pint lacks are accepted like its own.
NOT_OF_PINT = {"ft2": "ft^2", "sqft": "ft^2", "m2": "m^2"}


@pytest.mark.parametrize("text", COMMON_UNITS)
def test_the_units_converted_without_pint_are_pints(text):
    unit, factor = COMMON_UNITS[text]
    pints = NOT_OF_PINT.get(text, text)
    assert factor == pytest.approx(_registry().Quantity(1.0, pints).to(unit).magnitude, rel=1e-15)
    assert to_si(f"-2.5e1 {text}", unit, "key") == -25.0 * factor


def test_the_daemon_reads_a_shipped_aircraft_without_pint():
    code = "import sys, flightpower.flight.aircraft as a; a.load_aircraft('nexstar'); print('pint' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


@pytest.mark.parametrize("text", ["5.73 m^2", "5.73", "five ft", "5.73 fathomz", "", 5.73, True, None, ["1 m"]])
def test_what_is_not_a_length_names_its_key(text):
    with pytest.raises(InputError, match=r"file: span"):
        to_si(text, "m", "file: span")


def test_unit_stands_at_the_end_of_a_name():
    assert split_unit("wing_area_m2") == ("wing_area", "m^2")
    assert split_unit("Ixz_kgm2") == ("Ixz", "kg m^2")
    assert split_unit("pole_pairs") == ("pole_pairs", None)
    assert split_unit("CL_minD") == ("CL_minD", None)


@dataclass(frozen=True)
class Inner:
    length_m: float


@dataclass(frozen=True)
class Outer:
    name: str
    count: int
    ratio: float
    inner: Inner
    speeds_mps: tuple[float, ...]
    place_m: tuple[float, float]
    many: dict[str, Inner]
    perhaps_s: float | None = None


GOOD = {
    "name": "x",
    "count": 3,
    "ratio": 2,
    "inner": {"length": "1 ft"},
    "speeds": ["10 m/s", "20 knot"],
    "place": ["1 m", "2 ft"],
    "many": {"a": {"length": "2 m"}},
}


def test_a_good_table():
    outer = read_table(Outer, GOOD, "file")
    assert outer.inner.length_m == pytest.approx(0.3048)
    assert outer.speeds_mps == pytest.approx((10, 10.2888889))
    assert outer.many["a"] == Inner(2.0)
    assert outer.ratio == 2.0 and outer.perhaps_s is None
    assert read_table(Outer, {**GOOD, "perhaps": "20 ms"}, "file").perhaps_s == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"count": None}, "count"),
        ({"count": 2.5}, "count"),
        ({"count": True}, "count"),
        ({"ratio": "2"}, "ratio"),
        ({"name": 7}, "name"),
        ({"inner": {"length": "1 kg"}}, "inner.length"),
        ({"inner": {}}, "length is missing"),
        ({"inner": "1 m"}, "inner"),
        ({"speeds": "10 m/s"}, "speeds"),
        ({"place": ["1 m"]}, "place"),
        ({"place": ["1 m"] * 9}, "place"),
        ({"ratio": True}, "ratio"),
        ({"many": {"a": {"length": "1 s"}}}, "many.a.length"),
        ({"spam": 1}, "spam"),
    ],
)
def test_a_bad_table_names_the_key(change, named):
    with pytest.raises(InputError) as caught:
        read_table(Outer, {**GOOD, **change}, "file")
    assert named in str(caught.value) and "file" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("speed_revps", "6000 rpm", 100.0),
        ("energy_Wh", "36 kJ", 10.0),
        ("field_T", "50 uT", 50e-6),
        ("torque_Nm", "2 N m", 2.0),
    ],
)
def test_the_suffix_of_a_field_is_the_unit_it_is_given_in(name, text, value):
    assert to_si(text, split_unit(name)[1], name) == pytest.approx(value)


def test_a_length_or_a_mass_may_have_two_units() -> None:
    assert to_si("6 ft 2 in", "m", "span") == pytest.approx(74 * 0.0254)
    assert to_si("5 lb 4 oz", "kg", "mass") == pytest.approx(5.25 * 0.45359237)
    for wrong in ("6 ft 2", "6 ft 2 kg", "6 ft -2 in"):
        with pytest.raises(InputError, match="span"):
            to_si(wrong, "m", "span")
