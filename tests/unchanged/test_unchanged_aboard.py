"""What the daemon computes is what it was, to 3e-5, unless CHANGELOG.md says why it is not."""

import pytest

from tests.unchanged.aboard import CASES
from tests.unchanged.stored_values import check

pytestmark = pytest.mark.xdist_group("unchanged")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.thorough) if name == "run-monitor" else name for name in CASES]
)
def test_nothing_changed_unasked(name: str) -> None:
    check(name, CASES[name]())
