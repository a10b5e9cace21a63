"""One simulated flight, recorded by the real daemon through the fake tray and analysed: by the commands users type.

The flight needs Linux, as the daemon does; the other commands run without POSIX, as on Windows.
"""

from pathlib import Path

import pytest
from running import done_without_posix, installed, succeeded


@pytest.fixture(scope="session")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the flight of the demonstration: truth, log and what was analysed."""
    folder = tmp_path_factory.mktemp("flight")
    done_without_posix("sim", "tunnel", "-o", folder / "tunnel.csv")
    done_without_posix("calibrate", "probe", folder / "tunnel.csv", "-o", folder / "probe.json")
    plan = ("--aircraft", "nexstar", "--plan", "accel-decel", "--probe", folder / "probe.json")
    succeeded(installed("sim", "fly", *plan, "-o", folder))
    done_without_posix("analyze", folder / "log.mcap", "--quiet")
    return folder
