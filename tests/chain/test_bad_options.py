"""Options of `analyze` that cannot be meant: one line on stderr, exit code 2, nothing written."""

from pathlib import Path

import pytest
from running import command

pytestmark = pytest.mark.xdist_group("chain")


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--battery-Wh", "0"),
        ("--usable", "80"),
        ("--weight", "4.1"),
        ("--weight", "-1 kg"),
        ("--weights", "0 kg"),
        ("--density-altitudes", "20 km"),
    ],
)
def test_a_question_that_cannot_be_meant(tmp_path: Path, option: str, value: str) -> None:
    outcome = command("analyze", tmp_path / "flight.mcap", option, value)
    assert outcome.returncode == 2
    (line,) = outcome.stderr.strip().splitlines()
    assert line.startswith("error: ") and option in line and value in line
    assert outcome.stdout == "" and list(tmp_path.iterdir()) == []


def test_a_propeller_that_is_not_there_or_was_not_flown(flown: Path, tmp_path: Path) -> None:
    for name, cause in (
        ("apc-99x9", "neither a file nor one of"),
        ("apc-10x5e", "is it the propeller that was flown?"),
    ):
        outcome = command("analyze", flown / "log.mcap", "--propeller", name, "-o", tmp_path / "out")
        assert outcome.returncode == 2
        (line,) = outcome.stderr.strip().splitlines()
        assert line.startswith("error: ") and name in line and cause in line
        assert not (tmp_path / "out").exists()
