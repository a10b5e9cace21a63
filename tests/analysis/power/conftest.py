"""The aircraft whose power train is asked about."""

import pytest

from flight.aircraft import Aircraft, load_aircraft
from flight.propeller import Propeller
from flight.propeller_files import load_propeller


@pytest.fixture(scope="package")
def nexstar() -> Aircraft:
    return load_aircraft("nexstar")


@pytest.fixture(scope="package")
def propeller(nexstar: Aircraft) -> Propeller:
    return load_propeller(nexstar.propulsion.propeller)
