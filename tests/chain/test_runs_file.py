"""`analyze` writes the runs it found as a file to edit, and takes one back."""

import re
import shutil
from pathlib import Path
from typing import NamedTuple

import msgspec
import pytest
from running import command, done

from flightpower.analysis.records.flight import Results

pytestmark = pytest.mark.xdist_group("chain")


class Edited(NamedTuple):
    """A folder of results, its runs.toml, and an edited copy."""

    report: Path
    text: str
    dropped_s: float
    shifted_to_s: float


@pytest.fixture(scope="module")
def edited(flown: Path, tmp_path_factory: pytest.TempPathFactory) -> Edited:
    """A report of the flight, whose runs.toml was edited and used: without its first deceleration, and with the
    acceleration begun half a second later."""
    report = tmp_path_factory.mktemp("edited") / "report"
    shutil.copytree(flown / "log.report", report)
    text = (report / "runs.toml").read_text("utf-8")
    entry = r'kind = "{}"\nstart = "([\d.]+) s"\nend = "[\d.]+ s"\nkeep = true'
    dropped = re.search(entry.format("deceleration"), text)
    shifted = re.search(entry.format("acceleration"), text)
    assert dropped and shifted
    later = float(shifted[1]) + 0.48
    text = text.replace(dropped[0], dropped[0].replace("true", "false"))
    text = text.replace(shifted[0], shifted[0].replace(shifted[1], f"{later:.2f}")) + "# my remark\n"
    (report / "runs.toml").write_text(text, "utf-8")
    done("analyze", flown / "log.mcap", "--runs", report / "runs.toml", "-o", report, "-q")
    return Edited(report, text, float(dropped[1]), later)


@pytest.mark.slow
def test_an_edited_file_of_runs_is_what_the_next_analysis_uses(flown: Path, edited: Edited) -> None:
    before, after = (
        msgspec.json.decode((folder / "results.json").read_bytes(), type=Results)
        for folder in (flown / "log.report", edited.report)
    )
    assert len(after.runs) == len(before.runs) - 1
    assert edited.dropped_s not in {round(run.start_s, 2) for run in after.runs}
    (acceleration,) = (run for run in after.runs if run.kind == "acceleration")
    assert acceleration.start_s == pytest.approx(edited.shifted_to_s, abs=0.03)
    assert any(stretch.reason == "left out by hand" for stretch in after.rejected)
    assert len(after.single_runs) == len(before.single_runs) - 1


def test_decelerations_alone_do_not_put_the_blame_on_the_propeller(flown: Path, tmp_path: Path) -> None:
    """The runs lie beyond the table of a propeller of less pitch, as decelerations with a slow motor lie beyond any
    table."""
    text = (flown / "log.report" / "runs.toml").read_text("utf-8")
    parts = [part.replace("true", "false") if '"acceleration"' in part else part for part in text.split("[[run]]")]
    (tmp_path / "mine.toml").write_text("[[run]]".join(parts), "utf-8")
    arguments = ("--runs", tmp_path / "mine.toml", "--propeller", "apc-10x5e")
    outcome = command("analyze", flown / "log.mcap", *arguments, "-o", tmp_path / "report")
    assert outcome.returncode == 2
    assert "mine.toml: keeps decelerations only" in outcome.stderr and "was flown?" not in outcome.stderr


@pytest.mark.thorough  # in make test, test_replace.py shows that edited stretches are not lost
@pytest.mark.slow
def test_an_edited_file_of_runs_in_the_report_s_folder_is_not_lost(flown: Path, edited: Edited) -> None:
    report, own_file = edited.report, edited.report / "runs.toml"
    assert own_file.read_text("utf-8") == edited.text
    outcome = command("analyze", flown / "log.mcap", "-o", report, "-q")
    assert outcome.returncode == 0
    assert (report / "runs-1.toml").read_text("utf-8") == edited.text and "# my remark" not in own_file.read_text(
        "utf-8"
    )
