"""Aircraft files: those shipped, and what is said of a broken one."""

import re

import pytest

from flight.aircraft import load_aircraft, parse_aircraft
from flight.errors import InputError

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
    """Table 5.1."""
    aircraft = load_aircraft(name)
    assert aircraft.geometry.span_m == pytest.approx(span_ft * FOOT)
    assert aircraft.geometry.chord_m == pytest.approx(chord_ft * FOOT)
    assert aircraft.geometry.wing_area_m2 == pytest.approx(area_ft2 * FOOT**2)
    assert aircraft.mass.weight_N == pytest.approx(weight_lbf * POUND)
    # No body has a moment of inertia larger than the sum of the other two.
    m = aircraft.mass
    for one, other, third in (
        (m.Ix_kgm2, m.Iy_kgm2, m.Iz_kgm2),
        (m.Iy_kgm2, m.Iz_kgm2, m.Ix_kgm2),
        (m.Iz_kgm2, m.Ix_kgm2, m.Iy_kgm2),
    ):
        assert one <= other + third


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
    mine = load_aircraft(path)
    assert mine.name == "mine"
    assert mine.mass == load_aircraft("nexstar").mass
    assert mine.text == path.read_text("utf-8")  # travels in the log as it is


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('span = "5.73 ft"', 'span = "5.73 kg"', r"geometry\.span.*m"),
        ('span = "5.73 ft"', "span = 5.73", r"geometry\.span"),
        ('span = "5.73 ft"', "", r"geometry\.span is missing"),
        ('span = "5.73 ft"', 'span = "0 ft"', r"geometry\.span.*greater than zero"),
        ('weight = "8.47 lbf"', 'weight = "-1 lbf"', r"mass\.weight.*greater than zero"),
        ("[geometry]", "[geometri]", "geometr"),
        ("pole_pairs = 7", "pole_pairs = 7.5", "pole_pairs"),
        ("pulse_us = [1000, 1500, 2000]", "pulse_us = [1000, 1500]", "aileron.*pulse_us"),
        ("pulse_us = [1000, 1500, 2000]", "pulse_us = [2000, 1500, 1000]", "aileron.*pulse_us"),
        ('title = "Hobbico Nexstar"', "title = ", "TOML"),
    ],
)
def test_a_broken_file_is_one_clear_line(old, new, said):
    assert old in TEXT
    with pytest.raises(InputError) as caught:
        parse_aircraft(TEXT.replace(old, new, 1), "mine.toml")
    message = str(caught.value)
    assert message.startswith("mine.toml") and "\n" not in message
    assert re.search(said, message), message


def test_a_missing_file_and_an_unreadable_one(tmp_path):
    with pytest.raises(InputError, match="nexstar"):
        load_aircraft("nexstarr")
    binary = tmp_path / "a.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=re.escape(str(binary))):
        load_aircraft(binary)
