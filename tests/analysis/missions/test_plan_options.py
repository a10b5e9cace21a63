"""Options of a plan as a program gives them: names as texts are taken, those that do not exist are refused."""

import pytest

from analysis.cli.plan import PilotKind, PlanOptions
from flight.errors import InputError


def test_a_name_given_as_text_is_the_same_as_the_enum() -> None:
    assert PlanOptions(pilot="autopilot") == PlanOptions(pilot=PilotKind.AUTOPILOT)  # type: ignore[arg-type]
    assert PlanOptions(pilot="autopilot").longest_leg_m > PlanOptions().longest_leg_m  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["question", "pilot", "firmware"])
def test_a_name_that_does_not_exist_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=f"{name}: 'autopillot' is none of"):
        PlanOptions(**{name: "autopillot"})
