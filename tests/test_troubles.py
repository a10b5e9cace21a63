"""The page of what went wrong has every kind of refusal, doubt and status, and every message of the code."""

import importlib.util
import re
import sys
from pathlib import Path

import pytest

from flightpower.analysis.maneuvers.kinds import Unsuitable
from flightpower.analysis.missions.flown import INSTEAD
from flightpower.analysis.records.flight import EvidenceKind, MethodRejection
from flightpower.analysis.results.evidence import CULPRIT
from flightpower.analysis.sources.laws import Mistake
from flightpower.analysis.trajectory.observability import SENSOR_ERROR_KINDS, MissingExcitation
from flightpower.daq.tray_check import GOOD_STATUSES
from flightpower.flight.command_line import ExitCode
from flightpower.flight.messages import Status
from flightpower.flight.runs import RunRejected

SOURCE = Path(__file__).parents[1] / "docs" / "site" / "troubles.py"
spec = importlib.util.spec_from_file_location("troubles", SOURCE)
assert spec and spec.loader
troubles = importlib.util.module_from_spec(spec)
sys.modules["troubles"] = troubles
spec.loader.exec_module(troubles)


@pytest.fixture(scope="module")
def sections() -> dict[str, list[list[str]]]:
    """Rows of each table, without its header."""
    sections = {}
    for section in re.split(r"^#{2,3} ", troubles.page(), flags=re.MULTILINE)[1:]:
        title, _, text = section.partition("\n")
        lines = [line for line in text.splitlines() if line.startswith("|")]
        sections[title] = [re.split(r" (?<!\\)\| ", line.strip("| ")) for line in lines[2:]]
    return sections


@pytest.mark.parametrize(
    ("title", "kinds"),
    [
        ("Exit codes", [str(int(code)) for code in ExitCode]),
        ("Doubts about a result", list(EvidenceKind)),
        ("Sensor errors larger than assumed", [SENSOR_ERROR_KINDS[name].title for name in CULPRIT]),
        ("What a flight does not determine, and why", [missing.name.lower() for missing in MissingExcitation]),
        ("Methods that do not give the curve", [why for why in MethodRejection if why]),
        ("Stretches that are no maneuver", [*RunRejected, *Unsuitable]),
        ("Columns of a table", list(Mistake)),
        ("Sensors of the tray", [status for status in Status if status not in GOOD_STATUSES]),
        ("Items of a mission", list(INSTEAD)),
    ],
)
def test_each_kind_has_a_row_with_what_to_do(
    sections: dict[str, list[list[str]]], title: str, kinds: list[str]
) -> None:
    rows = sections[title]
    assert len(rows) == len(kinds)
    for row, kind in zip(rows, kinds, strict=True):
        assert str(int(kind) if title == "Items of a mission" else kind) in row[0]
        assert all(len(cell.split()) > 1 for cell in row[1:]), row


def test_each_refusal_of_the_code_is_on_the_page(sections: dict[str, list[list[str]]]) -> None:
    """Counted independently: calls of `InputError` with a text in the source."""
    messages = list(troubles.messages())
    message = {"; ".join(filter(None, row)) for title in troubles.AREAS.values() for row in sections.get(title, [])}
    cells = {troubles._cell(text).rstrip("; ") for text in {message.text for message in messages}}
    assert len(cells) > 450
    assert {text for text in cells if text not in {troubles._cell(item) for item in message}} == set()
    raised = sum(
        len(re.findall(r"^ *raise InputError\(", path.read_text("utf-8"), re.MULTILINE))
        for package in ("analysis", "daq", "flight", "flightpower", "sim")
        for path in (SOURCE.parents[2] / package).rglob("*.py")
    )
    assert len(messages) > 0.9 * raised, "few are raised with a text made elsewhere"
