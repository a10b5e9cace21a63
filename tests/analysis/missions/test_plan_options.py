"""Programs may give names in the options of a plan as text; names that do not exist are refused."""

import pytest

from flightpower.analysis.cli.plan import PilotKind, PlanOptions
from flightpower.flight.errors import InputError


def test_a_name_given_as_text_is_the_same_as_the_enum() -> None:
    assert PlanOptions(pilot="autopilot") == PlanOptions(pilot=PilotKind.AUTOPILOT)  # type: ignore[arg-type]
    assert PlanOptions(pilot="autopilot").longest_leg_m > PlanOptions().longest_leg_m  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("heading_deg", "wind_from_deg", "first_deg"), [(250.0, 200.0, 250.0), (250.0, 80.0, 70.0), (10.0, 200.0, 190.0)]
)
def test_the_first_leg_is_the_one_into_the_wind(heading_deg: float, wind_from_deg: float, first_deg: float) -> None:
    """The leg direction that is into the wind comes first; without a wind direction, it is the heading given."""
    assert PlanOptions(heading_deg=heading_deg, wind_from_deg=wind_from_deg).first_leg_deg == first_deg
    assert PlanOptions(heading_deg=heading_deg).first_leg_deg == heading_deg and PlanOptions().first_leg_deg is None
    with pytest.raises(InputError, match="without --heading"):
        PlanOptions(wind_from_deg=wind_from_deg)


@pytest.mark.parametrize("name", ["question", "pilot", "firmware"])
def test_a_name_that_does_not_exist_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=f"{name}: 'autopillot' is not one of"):
        PlanOptions(**{name: "autopillot"})
