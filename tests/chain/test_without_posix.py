"""The commands of the laptop run on Windows and macOS: nothing that only POSIX has is reached.

The fixture `flown` runs `sim tunnel`, `calibrate probe` and `analyze` in this way.
"""

from pathlib import Path

import pytest
from running import command_without_posix, done_without_posix

from flight.log_reader import read_log

pytestmark = pytest.mark.xdist_group("chain")

HOP = """
[[segment]]
kind = "stand"
duration = "2 s"
[[segment]]
kind = "take-off"
[[segment]]
kind = "land"
"""


def test_a_flight_without_hardware(flown: Path, tmp_path: Path) -> None:
    plan, aircraft = tmp_path / "hop.toml", tmp_path / "mine.toml"
    plan.write_text(HOP, "utf-8")
    done_without_posix("flightpower", "new", "aircraft", "--like", "nexstar", "-o", aircraft)
    options = ("--aircraft", aircraft, "--probe", flown / "probe.json", "-o", tmp_path / "out")
    done_without_posix("sim", "fly", "--no-hardware", "--plan", plan, *options)
    assert read_log(tmp_path / "out" / "log.mcap").attachments.keys() >= {"aircraft.toml", "probe.json"}


@pytest.mark.parametrize("name", ["tubing", "magnetometer", "surfaces"])
def test_calibrations_from_a_log(flown: Path, tmp_path: Path, name: str) -> None:
    """This flight supports none of them, which they may say."""
    outcome = command_without_posix("calibrate", name, flown / "log.mcap", "-o", tmp_path / "out")
    assert outcome.returncode in (0, 2) and "Traceback" not in outcome.stderr, outcome.stderr


def test_what_only_posix_has_is_blocked(tmp_path: Path) -> None:
    """Or the tests above would show nothing."""
    outcome = command_without_posix("flightpower", "daq", "run", "-c", tmp_path / "tray.toml")
    assert outcome.returncode == 2
    assert "runs on Linux only, on the aircraft's computer (fcntl is missing)" in outcome.stderr
