"""One simulated flight, recorded by the real daemon through the fake tray and analysed: by the commands users type."""

import fcntl
import os
from pathlib import Path

import pytest
from running import done


@pytest.fixture(scope="session")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the flight of the demonstration: truth, log and what was analysed. All workers share it."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "flight"
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "log.report" / "report.html").exists():
            folder.mkdir()
            done("sim", "tunnel", "-o", folder / "tunnel.csv")
            done("calibrate", "probe", folder / "tunnel.csv", "-o", folder / "probe.json")
            done("sim", "fly", "--aircraft", "nexstar", "--plan", "accel-decel", "--probe", folder / "probe.json",
                 "-o", folder)  # fmt: skip
            done("analyze", folder / "log.mcap", "--quiet")
    return folder
