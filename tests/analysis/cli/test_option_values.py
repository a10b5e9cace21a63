"""The value that a command assumes for an omitted option."""

import inspect
from collections.abc import Callable
from typing import Any

import pytest

from flightpower.analysis.calibrations.probe import probe
from flightpower.analysis.calibrations.transducers import transducers
from flightpower.analysis.calibrations.weight_and_balance import weight_and_balance
from flightpower.analysis.cli.plan import plan
from flightpower.daq.__main__ import check, zero


@pytest.mark.parametrize(
    ("command", "assumed"),
    [
        # Twenty minutes and the end of the landing; a light breeze, 131 ft, porpoising from 0 to 2 g.
        (plan, {"minutes": 21.0, "wind_kt": 5.0, "height_m": 40.0, "load_factor": 2.0, "heading_deg": None}),
        (probe, {"angle_scale": 0.5}),  # percent
        (transducers, {"reference_error": 0.5}),  # percent, of a column of water
        (weight_and_balance, {"reading_error": 0.005, "gain_error": 0.1, "position_error": 0.002}),  # kg, %, m
        (zero, {"seconds": 10.0}),
        (check, {"seconds": 5.0}),
    ],
)
def test_an_option_that_is_not_given_has_its_usual_value(command: Callable[..., None], assumed: dict[str, Any]) -> None:
    parameters = inspect.signature(command).parameters
    assert {name: parameters[name].default for name in assumed} == assumed
