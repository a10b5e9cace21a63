"""Provides simulated flights (benchmarks/flights.py), a probe from the simulated tunnel, an aircraft, a propeller."""

import sys
from pathlib import Path

import pytest

from flightpower.flight.aircraft import Aircraft, load_aircraft
from flightpower.flight.propeller import Propeller
from flightpower.flight.propeller_files import load_propeller

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import flights

from tests.corpus import from_corpus

flights.fly_and_measure = from_corpus(flights.fly_and_measure)


@pytest.fixture(scope="session")
def probe():
    return flights.tunnel_probe()


@pytest.fixture(scope="session")
def nexstar() -> Aircraft:
    return load_aircraft("nexstar")


@pytest.fixture(scope="session")
def propeller(nexstar: Aircraft) -> Propeller:
    return load_propeller(nexstar.propulsion.propeller)
