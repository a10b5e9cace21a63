"""The option --expected-skips: continuous integration learns of a test that stopped running."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.browser import HANGS_S

CONFTEST = Path(__file__).with_name("conftest.py")
SKIPS = """
import pytest

def test_that_runs():
    pass

@pytest.mark.parametrize("kind", ["a"])
def test_that_needs(kind):
    pytest.skip("no fuse here")
"""


def outcome(folder: Path, expected: str | None) -> subprocess.CompletedProcess[str]:
    (folder / "conftest.py").write_text(CONFTEST.read_text("utf-8"), "utf-8")
    (folder / "test_it.py").write_text(SKIPS, "utf-8")
    options = []
    if expected is not None:
        (folder / "expected").write_text(f"# why\n\n{expected}\n", "utf-8")
        options = ["--expected-skips", "expected"]
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", f"--rootdir={folder}", *options]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    environment["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # plugins take longer to import than the tests here
    environment["PYTHONPATH"] = str(CONFTEST.parents[1])
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=HANGS_S)


@pytest.mark.parametrize("expected", [None, "test_it.py::test_that_needs*: no fuse*"])
def test_a_skip_that_is_expected_passes(tmp_path: Path, expected: str | None) -> None:
    done = outcome(tmp_path, expected)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("expected", ["", "test_it.py::test_that_needs*: no root*", "test_it.py::test_other: *"])
def test_a_skip_that_is_not_expected_fails_and_is_named(tmp_path: Path, expected: str) -> None:
    done = outcome(tmp_path, expected)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "not in --expected-skips: test_it.py::test_that_needs[a]: no fuse here" in done.stdout


def test_a_list_that_is_missing_is_reported(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pytest", "-c", os.devnull, "--expected-skips", "absent"]
    (tmp_path / "conftest.py").write_text(CONFTEST.read_text("utf-8"), "utf-8")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    environment |= {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTHONPATH": str(CONFTEST.parents[1])}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=HANGS_S)
    assert done.returncode == 4
    assert "--expected-skips absent: cannot be read" in done.stderr


@pytest.mark.parametrize(("options", "code"), [([], 0), (["--all"], 1)])
def test_what_is_thorough_is_left_to_test_all(tmp_path: Path, options: list[str], code: int) -> None:
    (tmp_path / "conftest.py").write_text(CONFTEST.read_text("utf-8"), "utf-8")
    test = "import pytest\n\ndef test_daily(): pass\n\n@pytest.mark.thorough\ndef test_more(): assert False\n"
    (tmp_path / "test_it.py").write_text(test, "utf-8")
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", f"--rootdir={tmp_path}", *options]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    environment |= {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTHONPATH": str(CONFTEST.parents[1])}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=HANGS_S)
    assert done.returncode == code, done.stdout + done.stderr
    assert ("1 deselected" in done.stdout) is (code == 0)
