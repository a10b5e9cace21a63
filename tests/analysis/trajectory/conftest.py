"""Provides whole flights in calm air, reconstructed once for all modules that use them."""

from functools import cache
from typing import Any

import pytest
from test_reconstruction import flown

from flightpower.analysis.trajectory.reconstruction import reconstruct


@pytest.fixture(scope="session")
def calm(probe):
    """Return a function of the seed: truth, drawn errors, air data and trajectory of a calm full test flight."""

    @cache
    def of(seed: int) -> tuple[Any, ...]:
        truth, errors, air, still = flown(seed, probe, "full-test-flight")
        return truth, errors, air, reconstruct(air, still)

    return of
