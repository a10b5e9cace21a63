"""docs/use/hardware.md describes the tray of the example configuration."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "use" / "hardware.md").read_text("utf-8").replace("*", "")
DIAGRAM = (ROOT / "docs" / "figures" / "wiring.svg").read_text("utf-8")
SENSORS = tomllib.loads((ROOT / "daq" / "tray.example.toml").read_text("utf-8"))["sensors"]


def test_every_part_and_address_of_the_example_is_on_the_page_and_in_the_diagram():
    for sensor in SENSORS:
        for text in (sensor.get("part"), f"0x{sensor['address']:02X}" if "address" in sensor else None):
            assert text is None or text in PAGE, text
            assert text is None or text in DIAGRAM, text


def test_the_example_has_transducers_for_the_supply_that_a_pi_stands():
    """3.3 V: DS3 of MS4515DO, last digit 3 of Honeywell's SSC."""
    parts = [sensor["part"] for sensor in SENSORS if "part" in sensor]
    assert len(parts) == 3
    assert all(re.search(r"-DS3|A3$", part) for part in parts)


def test_the_diagram_is_what_its_source_draws(tmp_path):
    import runpy

    drawing = runpy.run_path(str(ROOT / "docs" / "figures" / "wiring.py"))["drawing"]
    assert drawing() == DIAGRAM
