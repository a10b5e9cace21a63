"""The commands of the laptop run on Windows and macOS: nothing that only POSIX has is reached."""

import json
from pathlib import Path

import pytest
from running import Laptop, commands_without_posix

from flightpower.flight.log_reader import read_log

pytestmark = pytest.mark.xdist_group("chain")


@pytest.mark.parametrize(
    "name",
    [
        "flightpower new aircraft", "sim tunnel", "calibrate probe", "sim fly", "analyze",
        "flightpower analyze compare",
    ],
)  # fmt: skip
def test_commands_of_the_laptop(laptop: Laptop, name: str) -> None:
    outcome = laptop.outcomes[name]
    assert outcome.returncode == 0, outcome.stderr


def test_a_flight_without_hardware(laptop: Laptop) -> None:
    assert read_log(laptop.folder / "hop" / "log.mcap").attachments.keys() >= {"aircraft.toml", "probe.json"}


def test_an_analysis_writes_its_report(laptop: Laptop) -> None:
    written = {path.name for path in (laptop.folder / "four").iterdir()}
    assert written >= {"report.html", "results.json", "power_required.csv", "runs.toml"}
    assert json.loads((laptop.folder / "four" / "results.json").read_text("utf-8"))["curves"]["power_required"][
        "points"
    ]


@pytest.mark.parametrize("name", ["tubing", "magnetometer", "surfaces"])
def test_calibrations_from_a_log(laptop: Laptop, name: str) -> None:
    """This flight supports none of them, and they may say so."""
    outcome = laptop.outcomes[f"calibrate {name}"]
    assert outcome.returncode in (0, 2) and "Traceback" not in outcome.stderr, outcome.stderr


@pytest.mark.parametrize(
    "name, reason",
    [
        ("flightpower export", "no acceleration or deceleration to analyze"),
        ("flightpower analyze", "none of the 2 logs can be used"),
        ("flightpower plan", "too short"),
    ],
)
def test_what_costs_seconds_is_refused_for_its_data_alone(laptop: Laptop, name: str, reason: str) -> None:
    """They are, even with everything imported that they need."""
    outcome = laptop.outcomes[name]
    assert outcome.returncode == 2 and reason in outcome.stderr, outcome.stderr


def test_what_only_posix_has_is_blocked(tmp_path: Path) -> None:
    """Otherwise the tests above would prove nothing."""
    (outcome,) = commands_without_posix(["flightpower", "daq", "run", "-c", str(tmp_path / "tray.toml")])
    assert outcome.returncode == 2
    assert "runs on Linux only, on the aircraft's computer (fcntl is missing)" in outcome.stderr
