"""One simulated flight, recorded by the real daemon through the fake tray and analyzed, with the tutorial's commands.

The flight needs Linux, as the daemon does; the laptop's commands also run once without POSIX, as on Windows.
"""

import contextlib
from pathlib import Path

import pytest
from running import Laptop, commands_without_posix

from tests.documented_commands import TUTORIAL, Walk, do, steps_in

FOUR_KEYS = """name = "mine"
[geometry]
span = "5.73 ft"
wing_area = "4.99 ft^2"
[mass]
weight = "8.47 lb"
"""
HOP = """
[[segment]]
kind = "stand"
duration = "2 s"
[[segment]]
kind = "take-off"
[[segment]]
kind = "land"
"""


@pytest.fixture(scope="session")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Walk:
    """The tutorial, walked through in an empty folder."""
    folder = tmp_path_factory.mktemp("tutorial")
    with contextlib.chdir(folder):
        return Walk(folder, [(step, do(step)) for step in steps_in(TUTORIAL)])


@pytest.fixture(scope="session")
def flown(walk: Walk) -> Path:
    """A folder with the flight of the demonstration: truth, log and the analysis."""
    return walk.folder / "out" / "demo"


@pytest.fixture(scope="session")
def laptop(flown: Path, tmp_path_factory: pytest.TempPathFactory) -> Laptop:
    """The tunnel, probe, flight, calibrations and analysis of the laptop, run in one process."""
    folder = tmp_path_factory.mktemp("laptop")
    (folder / "hop.toml").write_text(HOP, "utf-8")
    (folder / "four.toml").write_text(FOUR_KEYS, "utf-8")
    hop = (
        "--plan",
        folder / "hop.toml",
        "--aircraft",
        folder / "nexstar.toml",
        "--probe",
        folder / "probe.json",
        "-o",
        folder / "hop",
    )
    commands: dict[str, tuple[object, ...]] = {
        "flightpower new aircraft": ("--like", "nexstar", "-o", folder / "nexstar.toml"),
        "sim tunnel": ("-o", folder / "tunnel.csv"),
        "calibrate probe": (folder / "tunnel.csv", "-o", folder / "probe.json"),
        "sim fly": ("--no-hardware", *hop),
        "calibrate tubing": (folder / "hop" / "log.mcap",),
        "calibrate magnetometer": (folder / "hop" / "log.mcap", "-o", folder / "magnetometer.json"),
        "calibrate surfaces": (folder / "hop" / "log.mcap",),
        "analyze": (
            flown / "log.mcap", "--aircraft", folder / "four.toml", "--battery-Wh", "74", "-o", folder / "four",
            "--quiet",
        ),
        "flightpower export": (folder / "hop" / "log.mcap", "--to", "csv", "-o", folder / "tables"),
        "flightpower analyze": (folder / "missing-1.mcap", folder / "missing-2.mcap", "-o", folder / "several"),
        "flightpower plan": ("nexstar", "--minutes", "5", "-o", folder / "plan"),
        "flightpower analyze compare": (folder / "four", flown / "log.report", "-o", folder / "compared"),
    }  # fmt: skip
    lines = [[*name.split(), *map(str, arguments)] for name, arguments in commands.items()]
    return Laptop(folder, dict(zip(commands, commands_without_posix(*lines), strict=True)))


@pytest.fixture(scope="session")
def four(laptop: Laptop) -> Path:
    """A folder with an aircraft file of four keys, and the flight's analysis with this file and a battery of 74 Wh."""
    assert laptop.outcomes["analyze"].returncode == 0, laptop.outcomes["analyze"].stderr
    return laptop.folder
