"""A test that takes long without saying so fails, by the time of processors: a busy machine does not make it fail."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.processor_time import used_s

ROOT = Path(__file__).parents[1]
CONFTEST = """
from pathlib import Path

from tests import processor_time

def pytest_configure(config):
    processor_time.LIMIT_S = 0.1
    config.addinivalue_line("markers", "slow: long")
    config.addinivalue_line("markers", "thorough: more")
    config.pluginmanager.register(processor_time.ProcessorTime())
    config.pluginmanager.register(processor_time.TimesFile(Path("times")))
"""
TESTS = """
import subprocess, sys, time
import pytest

BUSY = "import time; end = time.process_time() + 0.15\\nwhile time.process_time() < end: pass"

@pytest.fixture(scope="module")
def of_all():
    exec(BUSY)

@pytest.fixture
def of_one():
    exec(BUSY)

def test_busy():
    exec(BUSY)

def test_busy_child():
    subprocess.run([sys.executable, "-S", "-c", BUSY])

def test_fixture_of_its_own(of_one):
    pass

@pytest.mark.slow
def test_busy_and_marked():
    exec(BUSY)

def test_asleep():
    time.sleep(0.3)

def test_fixture_of_all(of_all):
    pass

@pytest.mark.thorough
def test_busy_and_left_to_test_all():
    exec(BUSY)
"""


def test_what_takes_long_without_its_marker_fails(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(CONFTEST, "utf-8")
    (tmp_path / "test_it.py").write_text(TESTS, "utf-8")
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", f"--rootdir={tmp_path}", "-rE"]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    environment |= {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    failed = {line.split("::")[1].split()[0] for line in done.stdout.splitlines() if line.startswith("ERROR test_it")}
    assert failed == {"test_busy", "test_busy_child", "test_fixture_of_its_own"}, done.stdout
    assert "s of processor time, and at most 0.1 s without the marker slow" in done.stdout
    times = {name.split("::")[1]: (own, every) for name, own, every in map(json.loads, (tmp_path / "times").open())}
    assert times["test_fixture_of_all"][0] < 0.1 < times["test_fixture_of_all"][1], "own time, and with what all share"
    assert times["test_busy"] == pytest.approx((0.15, 0.15), abs=0.05)


def test_a_child_that_still_runs_is_counted() -> None:
    """A browser is one: it ends with the session. Time of finished processes is not counted twice."""
    code = "import time\nwhile time.process_time() < 0.3: pass\nprint('done', flush=True); input()"
    before = used_s() - time.process_time()
    with subprocess.Popen([sys.executable, "-S", "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None and child.stdout.readline()
        assert used_s() - time.process_time() - before == pytest.approx(0.3, abs=0.1)
        child.kill()
    assert used_s() - time.process_time() - before == pytest.approx(0.3, abs=0.1)
