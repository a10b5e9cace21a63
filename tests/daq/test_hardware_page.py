"""docs/use/hardware.md describes the tray of the example configuration."""

import re
import runpy
import tomllib
from pathlib import Path

import msgspec

from flightpower.daq.config import Ads1115Config, Ina226Config
from flightpower.daq.sensors.ina2xx import INA226

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "use" / "hardware.md").read_text("utf-8").replace("*", "")
FIGURES = ROOT / "docs" / "figures"
DIAGRAM = (FIGURES / "wiring.svg").read_text("utf-8")
DRAWN = runpy.run_path(str(FIGURES / "wiring.py"))
SENSORS = tomllib.loads((ROOT / "daq" / "tray.example.toml").read_text("utf-8"))["sensors"]


def test_every_part_and_address_of_the_example_is_on_the_page_and_in_the_diagram():
    for sensor in SENSORS:
        for text in (sensor.get("part"), f"0x{sensor['address']:02X}" if "address" in sensor else None):
            assert text is None or text in PAGE, text
            assert text is None or text in DIAGRAM, text


def test_optional_parts_have_the_addresses_and_limits_that_their_drivers_assume():
    """The counts of a shunt's voltage end at 82 mV; the counter's program pulls up its input."""
    for config in (Ina226Config, Ads1115Config):
        (address,) = [field.default for field in msgspec.structs.fields(config) if field.name == "address"]
        assert f"0x{address:02X}" in PAGE and f"0x{address:02X}" in DIAGRAM
    full_V = 2**15 * INA226.shunt_volts_per_count
    assert f"below {1000 * full_V:.0f} mV (INA226)" in PAGE and f"is for {full_V / 0.1:.1f} A" in PAGE
    program = (ROOT / "firmware" / "esc_counter" / "esc_counter.c").read_text("utf-8")
    assert "PORTB |= _BV(PORTB0)" in program and "pull-up at D8" in PAGE


def test_the_example_has_transducers_for_the_supply_that_a_pi_stands():
    """A Pi tolerates 3.3 V: DS3 of MS4515DO, last digit 3 of Honeywell's SSC."""
    parts = [sensor["part"] for sensor in SENSORS if "part" in sensor]
    assert len(parts) == 3
    assert all(re.search(r"-DS3|A3$", part) for part in parts)


def test_the_drawings_are_what_their_source_draws():
    assert DRAWN["wiring"]() == DIAGRAM
    assert DRAWN["plumbing"]() == (FIGURES / "plumbing.svg").read_text("utf-8")


def test_the_hoses_are_those_of_the_table():
    """ "lower minus upper port": the first goes to the high barb; every barb has one hose."""
    for name in ("alpha", "beta", "airspeed"):
        high, low = re.search(rf"^\| {name} \| .*?\| (\w+) (?:port )?minus (\w+)", PAGE, flags=re.MULTILINE).groups()
        hoses = {barb: port for port, transducer, barb in DRAWN["HOSES"] if transducer == name}
        assert hoses[DRAWN["HIGH"]] == high and hoses[DRAWN["LOW"]].split()[0] == low and len(hoses) == 2


def test_no_wire_passes_through_a_label_of_a_pin():
    """Labels lie inside the boxes, whose edges wires do not pass."""
    boxes = [tuple(float(item) for item in match) for match in re.findall(
        r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)" rx', DIAGRAM)]  # fmt: skip
    wires = [
        [tuple(map(float, point.split(","))) for point in points.split()]
        for points in re.findall(r'<polyline points="([^"]+)"', DIAGRAM)
    ]
    assert len(boxes) == 17 and len(wires) > 30
    for (x1, y1), (x2, y2) in wires:
        assert x1 == x2 or y1 == y2, "straight"
        for x, y, width, height in boxes:
            across = x < (x1 + x2) / 2 < x + width and y < (y1 + y2) / 2 < y + height
            assert not across


def test_each_pin_of_the_computer_is_used_once_and_is_what_the_header_has():
    header = {
        1: "3.3 V", 2: "5 V", 3: "SDA", 4: "5 V", 5: "SCL", 6: "GND", 8: "TXD", 9: "GND", 10: "RXD", 14: "GND",
        17: "3.3 V",
    }  # fmt: skip
    pins = re.findall(r">([\d, ]+): ([^<]+)</text>", DIAGRAM)
    named = [(int(number), name) for numbers, name in pins for number in numbers.split(",")]
    assert dict(named) == header and len(named) == len(header)
