"""What the commands compute and draw is what it was, to 3e-5, unless CHANGELOG.md says why it is not."""

import pytest

from tests.unchanged.commands import CASES
from tests.unchanged.stored_values import check

pytestmark = pytest.mark.xdist_group("unchanged")


# The others are made by the same code from other flights.
DAILY = ("demonstration", "autopilot-logs", "option-defaults")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [name if name in DAILY else pytest.param(name, marks=pytest.mark.thorough) for name in CASES]
)
def test_nothing_changed_unasked(name: str) -> None:
    check(name, CASES[name]())
