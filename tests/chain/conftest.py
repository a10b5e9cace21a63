"""One simulated flight, recorded by the real daemon through the fake tray and analysed: by the commands users type."""

from pathlib import Path

import pytest
from running import installed, succeeded


@pytest.fixture(scope="session")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the flight of the demonstration: truth, log and what was analysed."""
    folder = tmp_path_factory.mktemp("flight")

    def run(name: str, *arguments: object) -> None:
        succeeded(installed(name, *arguments))

    run("sim", "tunnel", "-o", folder / "tunnel.csv")
    run("calibrate", "probe", folder / "tunnel.csv", "-o", folder / "probe.json")
    run("sim", "fly", "--aircraft", "nexstar", "--plan", "accel-decel", "--probe", folder / "probe.json", "-o", folder)
    run("analyze", folder / "log.mcap", "--quiet")
    return folder
