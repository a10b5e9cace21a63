"""A reader from another package is found by its entry point; a faulty one costs one line that names it."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from flightpower.analysis.flights.campaign.addresses import find_logs
from flightpower.analysis.sources.open import open_source, suffixes
from flightpower.analysis.sources.readers import installed_readers
from flightpower.analysis.sources.recording import VOLTAGE, FlightRecording
from flightpower.flight.errors import InputError

PACKAGE = """
import numpy as np
from flightpower import Recording
from flightpower.analysis.sources.recording import VOLTAGE, channel

suffixes = (".XYZ",)

def recognizes(start):
    return start.startswith(b"XYZ1")

def read(path):
    numbers = np.frombuffer(path.read_bytes()[4:], "<f4")
    return Recording(path, {VOLTAGE: channel(0.1 * np.arange(len(numbers)), numbers)})
"""
Install = Callable[[str], None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Install a package with this module, as pip leaves it."""

    def made(source: str) -> None:
        site = tmp_path / "site"
        info = site / "xyzlogger-0.1.0.dist-info"
        info.mkdir(parents=True)
        (site / "xyzlogger.py").write_text(source)
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: xyzlogger\nVersion: 0.1.0\n")
        (info / "entry_points.txt").write_text("[flightpower.readers]\nxyz = xyzlogger\n")
        monkeypatch.syspath_prepend(str(site))
        installed_readers.cache_clear()

    monkeypatch.delitem(__import__("sys").modules, "xyzlogger", raising=False)
    yield made
    monkeypatch.delitem(__import__("sys").modules, "xyzlogger", raising=False)
    installed_readers.cache_clear()


def log(folder: Path) -> Path:
    import numpy as np

    path = folder / "flight.xyz"
    path.write_bytes(b"XYZ1" + np.linspace(16, 15, 50).astype("<f4").tobytes())
    return path


def test_its_logs_are_read_and_found_in_folders(install: Install, tmp_path: Path) -> None:
    path = log(tmp_path)
    with pytest.raises(InputError, match="no logs in this folder"):
        raise InputError(find_logs([str(tmp_path)]).failures[0])
    install(PACKAGE)
    assert suffixes()[-1] == ".xyz" and find_logs([str(tmp_path)]).logs == [path]
    source = open_source(path)
    assert isinstance(source, FlightRecording)
    assert source.channels[VOLTAGE].value[[0, -1]] == pytest.approx([16, 15])


def test_it_takes_no_log_that_is_read_here(install: Install, tmp_path: Path) -> None:
    install(PACKAGE.replace('start.startswith(b"XYZ1")', "True"))
    (tmp_path / "a.ulg").write_bytes(b"ULog\x01\x12\x35" + bytes(50))
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n")
    for name in ("a.ulg", "a.mcap"):
        with pytest.raises(InputError, match="holds no message"):
            open_source(tmp_path / name)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("import nothing_of_this_name", "cannot be loaded"),
        ("suffixes = ()", "has not all of suffixes, recognizes and read"),
        (PACKAGE.replace("numbers = ", "numbers = 1 / 0 or "), "ZeroDivisionError"),
        (PACKAGE.replace("return Recording(path, {", "return ({"), "gives no recording, but dict"),
        (PACKAGE.replace("start.startswith", "start.begins"), "AttributeError"),
    ],
)
def test_a_bad_one_costs_a_line_that_names_it(source: str, message: str, install: Install, tmp_path: Path) -> None:
    path = log(tmp_path)
    install(source)
    with pytest.raises(InputError, match=message) as raised:
        open_source(path)
    assert "xyz of xyzlogger 0.1.0" in str(raised.value) and "\n" not in str(raised.value)
