"""Tests running all studies of docs/evidence (benchmarks/evidence.py): a failing part does not harm the others."""

import json
import subprocess
import sys

import evidence
import pytest
import typer
from typer.testing import CliRunner

from flightpower.analysis.records.flight import Trust


def test_without_the_development_tools_one_line_says_so() -> None:
    without = f"import runpy, sys; sys.modules['plotly'] = None; runpy.run_path({evidence.__file__!r}, run_name='x')"
    done = subprocess.run([sys.executable, "-c", without], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "evidence.py needs the development tools: .venv/bin/pip install -e '.[dev]'\n"


def studies(run: evidence.Run) -> evidence.Tables:
    return {"counted": [{"n": run.n}]}


def fails(run: evidence.Run) -> evidence.Tables:
    raise ArithmeticError("no flight converged")


def ends(run: evidence.Run) -> evidence.Tables:
    raise SystemExit("nothing to count")


def test_curves_are_counted_by_their_worst_speed_and_by_what_is_said_of_them() -> None:
    """A curve is right if the truth is inside its interval at every speed; speeds without a curve do not count."""
    trusted, doubtful = Trust.TRUSTED.value, Trust.DOUBTFUL.value
    lines = [
        {"world": world, "trust": trust, "error": error, "half": [2.0, 2.0, 2.0]}
        for world, trust, error in (
            ("a", trusted, [1.9, -1.9, None]), ("b", doubtful, [0.0, 1.0, 0.0]),
            ("c", trusted, [0.0, -2.5, 0.0]), ("d", doubtful, [9.0, 0.0, None]),
        )
    ]  # fmt: skip
    right, wrong, by_more = evidence.judgments([*lines, {"world": "e", "refused": "no runs"}])
    assert [right[name] for name in ("flights", trusted, doubtful, "where")] == [2, 1, 1, "doubted: b"]
    assert [wrong[name] for name in ("flights", trusted, doubtful, "where")] == [1, 1, 0, "trusted: c"]
    assert [by_more[name] for name in ("flights", trusted, doubtful, "where")] == [1, 0, 1, None]


@pytest.mark.parametrize("failing", [fails, ends])
def test_a_part_that_fails_ends_no_other_and_keeps_its_file(failing, tmp_path, monkeypatch, capsys) -> None:
    parts = {"first": studies, "second": failing, "third": studies}
    monkeypatch.setattr(evidence, "PARTS", {name: evidence.Part(of, 3, 1, "flights") for name, of in parts.items()})
    (tmp_path / "second.json").write_text('{"commit": "earlier"}')
    assert evidence.run_parts(list(parts), tmp_path, 1, quick=False) == ["second"]
    assert "second: failed" in capsys.readouterr().err
    assert json.loads((tmp_path / "second.json").read_text()) == {"commit": "earlier"}
    for name in ("first", "third"):
        assert json.loads((tmp_path / f"{name}.json").read_text())["tables"] == {"counted": [{"n": 3}]}


def test_a_part_says_whether_its_figures_are_those_that_were_stored(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(evidence, "PARTS", {"first": evidence.Part(studies, 3, 1, "flights")})
    for stored, message in (
        ({"counted": [{"n": 3}]}, "its figures are those of commit a"),
        ({"counted": [{"n": 4}]}, "differ at 1 place from those of commit a, first at counted.0.n"),
    ):
        (tmp_path / "first.json").write_text(json.dumps({"commit": "a", "tables": stored}))
        assert evidence.run_parts(["first"], tmp_path, 1, quick=False) == []
        assert message in capsys.readouterr().err


@pytest.mark.parametrize(("failing", "code"), [(fails, 1), (ends, 1), (studies, 0)])
def test_the_command_runs_all_parts_renders_the_pages_and_ends_with_1_if_a_part_failed(
    failing, code, tmp_path, monkeypatch
) -> None:
    parts = {"first": studies, "second": failing, "third": studies}
    monkeypatch.setattr(evidence, "PARTS", {name: evidence.Part(of, 3, 1, "flights") for name, of in parts.items()})
    monkeypatch.setattr(evidence, "KEPT", tmp_path)
    program = typer.Typer()
    program.command()(evidence.main)
    ended = CliRunner().invoke(program, ["--quick"])
    pages = tmp_path / "quick" / "pages"
    assert ended.exit_code == code
    assert ("measured before on the pages: second" in ended.output) is (code == 1)
    written = {path.stem for path in (pages / "data").iterdir()}
    assert written == {"first", "third"} | ({"second"} if code == 0 else set())
    assert (pages / "accuracy.md").exists() and "rendered" in ended.output
