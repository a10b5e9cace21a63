"""Provides the weight and density at which several tests compute performance."""

import pytest
from motor_data import RHO

from flightpower.analysis.curve import Condition


@pytest.fixture(scope="module")
def condition(nexstar) -> Condition:
    return Condition(nexstar.mass.weight_N, RHO, nexstar.geometry.wing_area_m2)
