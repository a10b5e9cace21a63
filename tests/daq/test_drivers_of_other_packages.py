"""A driver from another package is found by its entry point; a faulty one costs one line that names it."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from flightpower.daq.config import installed_drivers, parse_tray
from flightpower.flight.errors import InputError

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "driver-sdp3x"
TRAY = '[[sensors]]\ndriver = "sdp3x"\nbus = "/dev/i2c-1"\n'


def install(folder: Path, points: str, name: str = "flightpower-sdp3x") -> Path:
    """Write a package's entry points, as pip does."""
    info = folder / f"{name.replace('-', '_')}-0.1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 0.1.0\n")
    (info / "entry_points.txt").write_text(f"[flightpower.drivers]\n{points}\n")
    return folder


@pytest.fixture
def installed(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLE))
    monkeypatch.syspath_prepend(str(tmp_path))
    return lambda points, name="flightpower-sdp3x": install(tmp_path, points, name)


def points_of_the_example() -> str:
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]
    return "\n".join(f"{name} = {value}" for name, value in project["entry-points"]["flightpower.drivers"].items())


def test_the_example_package_passes_its_own_tests(tmp_path):
    """Its driver runs in the daemon, on a fake of the test kit. The test on a real chip is skipped."""
    install(tmp_path, points_of_the_example())
    paths = [str(tmp_path), str(EXAMPLE), str(Path(__file__).parents[2])]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", os.devnull, str(EXAMPLE)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths), "PYTEST_ADDOPTS": ""},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3 passed, 1 skipped" in done.stdout


def test_the_check_of_a_tray_lists_the_drivers_it_knows(installed, tmp_path):
    assert "mpu9250" in installed_drivers() and "sdp3x" not in installed_drivers()
    installed(points_of_the_example())
    assert installed_drivers()["sdp3x"] == "flightpower-sdp3x 0.1.0"
    assert installed_drivers()["mpu9250"] == ""
    with pytest.raises(InputError, match=r"the drivers are .*sdp3x"):
        parse_tray('[[sensors]]\ndriver = "sdp4x"\nbus = "/dev/i2c-1"\n', "tray.toml", tmp_path)


def test_the_keys_of_a_driver_are_checked_like_those_of_the_others(installed, tmp_path):
    installed(points_of_the_example())
    with pytest.raises(InputError, match=r"sensors\[0\]"):
        parse_tray(f"{TRAY}adress = 0x21\n", "tray.toml", tmp_path)
    with pytest.raises(InputError, match="are both on address 0x21"):
        parse_tray(TRAY + TRAY, "tray.toml", tmp_path)


@pytest.mark.parametrize(
    "point",
    [
        "sdp3x = no_such_module:Table",
        "sdp3x = flightpower_sdp3x:NoSuchTable",
        "sdp3x = flightpower_sdp3x:Sdp3xDriver",
        "other = flightpower_sdp3x:Sdp3xTable",
        "sdp3x = flightpower.daq.config:Mpu9250Config",
    ],
)
def test_a_driver_that_cannot_be_used_names_its_package(installed, tmp_path, point):
    installed(point)
    name = point.split(" ")[0]
    with pytest.raises(InputError, match=f"driver {name} of flightpower-sdp3x 0.1.0"):
        parse_tray(TRAY.replace("sdp3x", name), "tray.toml", tmp_path)


def test_no_package_replaces_a_driver_of_this_one(installed, tmp_path):
    installed("mpu9250 = no_such_module:Table")
    tray = parse_tray('[[sensors]]\ndriver = "mpu9250"\nbus = "/dev/i2c-1"\n', "tray.toml", tmp_path)
    assert tray.sensors[0].topics == ("/imu",)
