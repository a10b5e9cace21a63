"""The Nexstar, compiled once for all tests of the simulator."""

import pytest

from flightpower.flight.aircraft import load_aircraft
from flightpower.sim.fly import fly
from flightpower.sim.plan import parse_plan
from flightpower.sim.plant import plant_of
from flightpower.sim.trim import Trimmer

CALM_RUNS = """
title = "one acceleration and one deceleration in still air"
[[segment]]
kind = "stand"
duration = "4 s"
[[segment]]
kind = "take-off"
[[segment]]
kind = "hold"
duration = "8 s"
speed_over_stall = 1.3
[[segment]]
kind = "run"
throttle = 1.0
speed_of_max = 0.95
[[segment]]
kind = "run"
throttle = 0.4
speed_over_stall = 1.2
[[segment]]
kind = "land"
[[segment]]
kind = "stand"
duration = "4 s"
"""


@pytest.fixture(scope="session")
def nexstar():
    return load_aircraft("nexstar")


@pytest.fixture(scope="session")
def plant(nexstar):
    return plant_of(nexstar)


@pytest.fixture(scope="session")
def trimmer(plant):
    return Trimmer(plant, 100.0)


@pytest.fixture(scope="session")
def flight(nexstar):
    """A short flight in still air: from standing to standing."""
    return fly(nexstar, parse_plan(CALM_RUNS, "calm-runs"))
