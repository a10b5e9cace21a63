"""`flightpower export`: where it writes the data of one log and of several, and what it refuses before reading
anything."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from flightpower.analysis.cli import export
from flightpower.flight.command_line import ExitCode
from flightpower.flight.errors import InputError


def run(*words: object):
    return CliRunner().invoke(export.app, [str(word) for word in words])


@pytest.mark.parametrize(
    ("words", "written"),
    [
        (("a.BIN", "--to", "mat"), ["a.mat"]),
        (("a.BIN", "--to", "mat", "-o", "x.mat"), ["x.mat"]),
        (("a.BIN", "sub/b.ulg", "--to", "csv"), ["a.csv", "sub/b.csv"]),
        (("a.BIN", "sub/b.ulg", "--to", "mcap", "-o", "out"), ["out/a.derived.mcap", "out/b.derived.mcap"]),
    ],
)
def test_each_log_has_a_file_of_its_own(tmp_path: Path, monkeypatch, words, written: list[str]) -> None:
    """The command ends with the worst exit code of its logs."""
    monkeypatch.chdir(tmp_path)
    paths: list[Path] = []

    def record(log: Path, path: Path, *_: object, **__: object) -> ExitCode:
        paths.append(path)
        return ExitCode.FAILURE if log.name == "a.BIN" else ExitCode.DONE

    monkeypatch.setattr(export, "_export", record)
    outcome = CliRunner().invoke(export.app, words, standalone_mode=False)
    assert outcome.exception is None, outcome.exception
    assert paths == [Path(item) for item in written] and outcome.return_value == ExitCode.FAILURE
    assert Path("out").is_dir() == ("out" in words)


@pytest.mark.parametrize(
    ("words", "cause"),
    [
        (("a/log.BIN", "b/log.ulg", "--to", "csv", "-o", "out"), "two logs would be written there"),
        (("a.BIN", "b.BIN", "--to", "csv", "-o", "file"), "give the folder for several logs"),
        (("logs", "--to", "csv"), "is a folder; give its logs, such as logs/*.mcap"),
        (("logs", "a.BIN", "--to", "csv"), "is a folder; give its logs"),
        (("a.BIN", "b.BIN", "--to", "csv", "-o", "file/out"), "file/out: cannot be written"),
    ],
)
def test_what_cannot_be_written_is_refused(tmp_path: Path, monkeypatch, words, cause: str) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("mine")
    Path("logs").mkdir()
    outcome = run(*words)
    assert isinstance(outcome.exception, InputError) and cause in str(outcome.exception)
    assert {path.name for path in tmp_path.iterdir()} == {"file", "logs"} and Path("file").read_text() == "mine"
