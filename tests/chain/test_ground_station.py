"""MAVProxy, a ground station that people use, hears what the daemon sends; skipped where it is not installed."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "ground_station.py"


@pytest.mark.skipif(shutil.which("mavproxy.py") is None, reason="MAVProxy is not here (pip install MAVProxy)")
def test_mavproxy_knows_the_state_within_five_seconds_and_shows_long_texts_whole() -> None:
    done = subprocess.run([sys.executable, BENCHMARK], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
