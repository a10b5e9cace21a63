"""Whole flights in calm air, reconstructed once for the modules that look at them."""

from functools import cache
from typing import Any

import pytest
from test_reconstruction import flown

from flightpower.analysis.trajectory.reconstruction import reconstruct


@pytest.fixture(scope="session")
def calm(probe):
    """Truth, drawn errors, air data and trajectory of a full test flight in calm air, by its seed."""

    @cache
    def of(seed: int) -> tuple[Any, ...]:
        truth, errors, air, still = flown(seed, probe, "full-test-flight")
        return truth, errors, air, reconstruct(air, still)

    return of
