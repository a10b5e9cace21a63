"""`analyze` writes the runs it found as a file to edit, and takes one back."""

import re
import shutil
from pathlib import Path

import msgspec
import pytest
from running import command, done

from analysis.results.schema import Results

pytestmark = pytest.mark.xdist_group("chain")


def test_an_edited_file_of_runs_is_what_the_next_analysis_uses(flown: Path, tmp_path: Path) -> None:
    """Without its first deceleration, and the acceleration begun half a second later."""
    text = (flown / "log.report" / "runs.toml").read_text("utf-8")
    entry = r'kind = "{}"\nstart = "([\d.]+) s"\nend = "[\d.]+ s"\nkeep = true'
    dropped = re.search(entry.format("deceleration"), text)
    shifted = re.search(entry.format("acceleration"), text)
    assert dropped and shifted
    later = float(shifted[1]) + 0.48
    text = text.replace(dropped[0], dropped[0].replace("true", "false"))
    text = text.replace(shifted[0], shifted[0].replace(shifted[1], f"{later:.2f}"))
    (tmp_path / "mine.toml").write_text(text, "utf-8")
    done("analyze", flown / "log.mcap", "--runs", tmp_path / "mine.toml", "-o", tmp_path / "report", "-q")
    before, after = (
        msgspec.json.decode((folder / "results.json").read_bytes(), type=Results)
        for folder in (flown / "log.report", tmp_path / "report")
    )
    assert len(after.runs) == len(before.runs) - 1
    assert float(dropped[1]) not in {round(run.start_s, 2) for run in after.runs}
    (acceleration,) = (run for run in after.runs if run.kind == "acceleration")
    assert acceleration.start_s == pytest.approx(later, abs=0.03)
    assert any(stretch.reason == "left out by hand" for stretch in after.rejected)
    assert len(after.one_by_one) == len(before.one_by_one) - 1


def test_a_wrong_file_of_runs_is_one_line_and_nothing_is_written(flown: Path, tmp_path: Path) -> None:
    """Every way to be wrong is in tests/analysis/test_runs_of_plans.py."""
    path = tmp_path / "mine.toml"
    path.write_text('[[run]]\nkind = "acceleration"\nend = "70 s"\n', "utf-8")
    outcome = command("analyze", flown / "log.mcap", "--runs", path, "-o", tmp_path / "report")
    assert outcome.returncode == 2
    assert len(outcome.stderr.strip().splitlines()) == 1
    assert "mine.toml" in outcome.stderr and "start is missing" in outcome.stderr
    assert not (tmp_path / "report").exists()


def test_decelerations_alone_do_not_put_the_blame_on_the_propeller(flown: Path, tmp_path: Path) -> None:
    text = (flown / "log.report" / "runs.toml").read_text("utf-8")
    parts = [part.replace("true", "false") if '"acceleration"' in part else part for part in text.split("[[run]]")]
    (tmp_path / "mine.toml").write_text("[[run]]".join(parts), "utf-8")
    outcome = command("analyze", flown / "log.mcap", "--runs", tmp_path / "mine.toml", "-o", tmp_path / "report")
    assert outcome.returncode == 2
    assert "mine.toml: keeps decelerations only" in outcome.stderr and "was flown?" not in outcome.stderr


def test_a_run_too_short_to_tell_is_refused_and_not_drawn(flown: Path, tmp_path: Path) -> None:
    """2.4 s of one acceleration: what a parabola makes of it falls with lift."""
    path = tmp_path / "short.toml"
    path.write_text('[[run]]\nkind = "acceleration"\nstart = "38 s"\nend = "40.4 s"\n', "utf-8")
    outcome = command("analyze", flown / "log.mcap", "--runs", path, "-o", tmp_path / "report")
    assert outcome.returncode == 2
    assert "unphysical drag polar from one run" in outcome.stderr and "keep or fly more runs" in outcome.stderr
    assert not (tmp_path / "report").exists()


def test_an_edited_file_of_runs_in_the_report_s_folder_is_not_lost(flown: Path, tmp_path: Path) -> None:
    report, mine = tmp_path / "report", tmp_path / "report" / "runs.toml"
    shutil.copytree(flown / "log.report", report)
    edited = mine.read_text("utf-8") + "# my remark\n"
    mine.write_text(edited, "utf-8")
    done("analyze", flown / "log.mcap", "--runs", mine, "-o", report, "-q")
    assert mine.read_text("utf-8") == edited
    outcome = command("analyze", flown / "log.mcap", "-o", report, "-q")
    assert outcome.returncode == 0
    assert (report / "runs-1.toml").read_text("utf-8") == edited and "# my remark" not in mine.read_text("utf-8")
