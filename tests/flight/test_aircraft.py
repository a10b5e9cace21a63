"""Shipped aircraft files, and the messages on broken ones."""

import dataclasses
import re
import typing

import pytest

from flightpower.flight.aircraft import Aircraft, load_aircraft, parse_aircraft, shipped_aircraft
from flightpower.flight.aircraft_keys import EXAMPLES, KEYS, LINES, SURFACES, to_markdown
from flightpower.flight.complete_aircraft import as_complete
from flightpower.flight.errors import InputError
from flightpower.flight.units import split_unit

FOOT, POUND = 0.3048, 4.4482216152605


@pytest.mark.parametrize(
    ("name", "span_ft", "chord_ft", "area_ft2", "weight_lbf"),
    [
        ("astraeus-ls", 7.75, 0.753, 5.81, 6.57),
        ("astraeus-hs", 5.5, 0.793, 4.35, 5.83),
        ("nexstar", 5.73, 0.870, 4.99, 8.47),
    ],
)
def test_shipped_aircraft_have_the_sources_numbers(name, span_ft, chord_ft, area_ft2, weight_lbf):
    """Their source is Table 5.1."""
    aircraft = load_aircraft(name)
    assert aircraft.geometry.span_m == pytest.approx(span_ft * FOOT)
    assert aircraft.geometry.chord_m == pytest.approx(chord_ft * FOOT)
    assert aircraft.geometry.wing_area_m2 == pytest.approx(area_ft2 * FOOT**2)
    assert aircraft.mass.weight_N == pytest.approx(weight_lbf * POUND)


@pytest.mark.parametrize("name", shipped_aircraft())
def test_no_shipped_aircraft_has_a_moment_of_inertia_larger_than_the_sum_of_the_other_two(name):
    m = load_aircraft(name).mass
    for item, other, third in (
        (m.Ix_kgm2, m.Iy_kgm2, m.Iz_kgm2),
        (m.Iy_kgm2, m.Iz_kgm2, m.Ix_kgm2),
        (m.Iz_kgm2, m.Ix_kgm2, m.Iy_kgm2),
    ):
        assert item <= other + third


@pytest.mark.parametrize("name", ["elevator", "aileron", "rudder"])
def test_pulse_and_angle_are_inverses(name):
    surface = getattr(load_aircraft("nexstar"), name)
    for pulse in range(1000, 2001, 50):
        assert surface.pulse_of_angle_us(surface.angle_of_pulse_rad(pulse)) == pytest.approx(pulse)
    assert surface.angle_of_pulse_rad(900) == surface.angle_of_pulse_rad(1000)
    assert surface.angle_of_pulse_rad(2100) == surface.angle_of_pulse_rad(2000)


def test_the_aspect_ratio_is_the_span_over_the_mean_chord():
    geometry = load_aircraft("nexstar").geometry
    mean_chord_m = geometry.wing_area_m2 / geometry.span_m
    assert load_aircraft("nexstar").aspect_ratio == pytest.approx(geometry.span_m / mean_chord_m)


TEXT = load_aircraft("nexstar").text


def test_a_file_of_ones_own_is_read_like_a_shipped_one(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(TEXT.replace('name = "nexstar"', 'name = "mine"'), "utf-8")
    own_aircraft = load_aircraft(path)
    assert own_aircraft.name == "mine"
    assert own_aircraft.mass == load_aircraft("nexstar").mass
    assert own_aircraft.text == path.read_text("utf-8")  # travels in the log as it is


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('span = "5.73 ft"', 'span = "5.73 kg"', r"geometry\.span.*m"),
        ('span = "5.73 ft"', "span = 5.73", r"geometry\.span"),
        ('span = "5.73 ft"', "", r"geometry\.span is missing"),
        ('span = "5.73 ft"', 'span = "0 ft"', r"geometry\.span.*greater than zero"),
        ('weight = "8.47 lbf"', 'weight = "-1 lbf"', r"mass\.weight.*greater than zero"),
        ('span = "5.73 ft"', 'span = "5.73 cm"', r"geometry\.span of 0\.0573 m .* aspect ratio of 0\.0071"),
        ('span = "5.73 ft"', 'span = "573 ft"', r"aspect ratio of 6\.6e\+04; check their units"),
        ('wing_area = "4.99', 'wing_area = "49.9', r"aspect ratio of 0\.66; check their units"),
        ("[geometry]", "[geometri]", "geometr"),
        ("pole_pairs = 7", "pole_pairs = 7.5", "pole_pairs"),
        ("pulse_us = [1000, 1500, 2000]", "pulse_us = [1000, 1500]", "aileron.*pulse_us"),
        ("pulse_us = [1000, 1500, 2000]", "pulse_us = [2000, 1500, 1000]", "aileron.*pulse_us"),
        ('title = "Hobbico Nexstar"', "title = ", "TOML"),
    ],
)
def test_a_broken_file_is_one_clear_line(old, new, expected):
    assert old in TEXT
    with pytest.raises(InputError) as caught:
        parse_aircraft(TEXT.replace(old, new, 1), "mine.toml")
    message = str(caught.value)
    assert message.startswith("mine.toml") and "\n" not in message
    assert re.search(expected, message), message


def test_a_missing_file_and_an_unreadable_one(tmp_path):
    with pytest.raises(InputError, match="nexstar"):
        load_aircraft("nexstarr")
    binary = tmp_path / "a.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=re.escape(str(binary))):
        load_aircraft(binary)


FOUR_KEYS = """
name = "mine"
[geometry]
span = "1.75 m"
wing_area = "0.46 m^2"
[mass]
weight = "4 kg"
"""


def test_four_keys_are_an_aircraft():
    own_aircraft = parse_aircraft(FOUR_KEYS, "mine.toml")
    assert (
        own_aircraft.mass_kg == pytest.approx(4.0) and own_aircraft.mass.standard_weight_N == own_aircraft.mass.weight_N
    )
    assert own_aircraft.title == "mine"
    assert own_aircraft.geometry.mean_chord_m == pytest.approx(0.46 / 1.75)
    assert (
        own_aircraft.has("name", "mass.weight")
        and not own_aircraft.has("mass.Ix")
        and not own_aircraft.has("mass.standard_weight")
    )


@pytest.mark.parametrize("weight", ["4 kg", "4kg", "4000 g", "39.2266 N", "8.8185 lb", "8.8185 lbf"])
def test_a_weight_is_given_as_a_force_or_a_mass(weight):
    own_aircraft = parse_aircraft(FOUR_KEYS.replace("4 kg", weight), "mine.toml")
    assert own_aircraft.mass.weight_N == pytest.approx(39.2266, rel=1e-5)


def test_everything_that_is_missing_or_wrong_is_reported_at_once_with_an_example():
    with pytest.raises(InputError) as caught:
        parse_aircraft('[geometry]\nspan = 1.75\n[mass]\nweight = "4 m"\nIx = "1 m"\n', "mine.toml")
    message = str(caught.value)
    assert message.count("mine.toml") == 1 and "\n" not in message
    for text in (
        'name is missing, such as name = "mine"',
        "geometry.span = 1.75",
        'geometry.wing_area is missing, such as wing_area = "0.46 m^2"',
        "mass.weight = '4 m'",
        "mass.Ix = '1 m'",
    ):
        assert text in message
    assert "standard_weight" not in message


def test_the_simulator_asks_for_every_key_it_flies_by():
    for key in ("Ix", "motor_resistance", "chord"):
        lines = [line for line in TEXT.splitlines() if not line.startswith(f"{key} ")]
        assert len(lines) == len(TEXT.splitlines()) - 1
        parse_aircraft("\n".join(lines), "mine.toml")
    with pytest.raises(InputError) as caught:
        as_complete(FOUR_KEYS, "mine.toml")
    for key in ("geometry.chord", "mass.Iy", "propulsion.battery_voltage", "rudder.angle", "probe.position"):
        assert key in str(caught.value)
    complete = as_complete(TEXT, "nexstar.toml")
    assert dataclasses.asdict(complete) == dataclasses.asdict(load_aircraft("nexstar"))


def test_every_key_is_described():
    """The table that messages, template and aircraft.md are made from has exactly the keys that the code reads."""
    read = set(keys_of(Aircraft)) - {"aerodynamics"}
    for surface in SURFACES:
        read = {key.replace(f"{surface}.", "SURFACE.") for key in read}
    assert read == KEYS.keys() - {"aerodynamics"}
    assert all(key.without for name, key in KEYS.items() if name not in REQUIRED)
    assert not any(KEYS[name].without for name in REQUIRED)


REQUIRED = ("name", "geometry.span", "geometry.wing_area", "mass.weight")


def keys_of(kind, section=""):
    """Keys of a file from which `read_table` makes a dataclass."""
    hints = typing.get_type_hints(kind)
    for field in dataclasses.fields(kind):
        key = section + split_unit(field.name)[0]
        kinds = [
            item for item in (hints[field.name], *typing.get_args(hints[field.name])) if dataclasses.is_dataclass(item)
        ]
        inside = f"{key}.LINE." if typing.get_origin(hints[field.name]) is dict else f"{key}."
        if kinds:
            yield from keys_of(kinds[0], inside)
        elif field.metadata.get("key", True):
            yield key


def test_examples_are_read_as_the_keys_they_are_for():
    assert parse_aircraft(TEXT, "nexstar.toml").keys <= EXAMPLES.keys() | SECTIONS | set(keys_below_aerodynamics())
    for key in REQUIRED:
        broken = FOUR_KEYS.replace(f"{key.rpartition('.')[2]} = ", "# ")
        with pytest.raises(InputError, match=re.escape(EXAMPLES[key])):
            parse_aircraft(broken, "mine.toml")


SECTIONS = {
    "geometry",
    "mass",
    "propulsion",
    "probe",
    "probe.lines",
    "uncertainty",
    *SURFACES,
    *(f"probe.lines.{line}" for line in LINES),
}


def keys_below_aerodynamics():
    return (key for key in load_aircraft("nexstar").keys if key.startswith("aerodynamics"))


def test_the_table_of_the_site_has_every_key():
    assert re.findall(r"^\| `([\w.]+)` \|", to_markdown(), flags=re.MULTILINE) == [*KEYS]
