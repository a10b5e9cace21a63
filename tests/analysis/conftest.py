"""What tests of the analysis fly with: benchmarks/flights.py, and the probe of the simulated tunnel."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import flights


@pytest.fixture(scope="session")
def probe():
    return flights.tunnel_probe()
