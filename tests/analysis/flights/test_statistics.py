"""The statistics of a flight in results.json, and the name of its installation."""

from pathlib import Path

import pytest

from flightpower.analysis.air.contents import Replacements, contents
from flightpower.flight.aircraft import parse_aircraft
from flightpower.flight.log_reader import Log
from flightpower.flight.propeller_files import load_propeller

AIRCRAFT = 'name = "mine"\n[geometry]\nspan = "1.7 m"\nwing_area = "0.46 m^2"\n[mass]\nweight = "4 kg"\n'
NAMED = '[installation]\nname = "boom, May"\n'


@pytest.mark.parametrize(
    ("aircraft", "tray", "name"),
    [
        (AIRCRAFT, "", ""),
        (AIRCRAFT + NAMED, "", "boom, May"),
        (AIRCRAFT, NAMED, "boom, May"),
        (AIRCRAFT + NAMED, '[installation]\nname = "other"', "boom, May"),
        (AIRCRAFT, "[installation]\nname = 3", ""),
        (AIRCRAFT, "not TOML", ""),
    ],
)
def test_the_installation_is_named_by_the_aircraft_file_or_else_by_the_tray_file(
    aircraft: str, tray: str, name: str, probe
) -> None:
    log = Log(Path("flight.mcap"), attachments={"tray.toml": tray.encode()})
    replacements = Replacements(parse_aircraft(aircraft, "mine.toml"), load_propeller("apc-12x8e"), probe)
    assert contents(log, replacements).aircraft.installation.name == name


def test_a_name_in_the_tray_file_leaves_what_else_the_aircraft_file_says_of_the_installation(probe) -> None:
    log = Log(Path("flight.mcap"), attachments={"tray.toml": NAMED.encode()})
    text = AIRCRAFT + '[installation]\naccelerometer_vibration = ["0.1 m/s^2", "0 m/s^2", "-0.2 m/s^2"]\n'
    log_contents = contents(log, Replacements(parse_aircraft(text, "mine.toml"), load_propeller("apc-12x8e"), probe))
    assert log_contents.aircraft.installation.name == "boom, May"
    assert log_contents.aircraft.installation.accelerometer_vibration_mps2 == (0.1, 0.0, -0.2)
