"""Files are written whole or not at all: on a full disk, after an interruption, and where stdout is full."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from flightpower.flight.errors import InputError, StorageError
from flightpower.flight.files import write_file, write_files

resource = pytest.importorskip("resource")
LIMIT = 4096


@pytest.fixture
def full_disk() -> Iterator[None]:
    """No file may become longer than LIMIT: the kernel refuses the rest of it, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    signal.signal(signal.SIGXFSZ, before)


def test_a_full_disk_leaves_nothing_and_is_reported_by_the_true_name(tmp_path: Path, full_disk: None) -> None:
    (tmp_path / "old.txt").write_text("old")
    files = {tmp_path / "old.txt": "new", tmp_path / "new" / "folder" / "b.txt": b"x" * 2 * LIMIT}
    with pytest.raises(StorageError, match=rf"^{tmp_path}/new/folder/b.txt: cannot be written \(File too large\)$"):
        write_files(files)
    assert [path.name for path in tmp_path.rglob("*")] == ["old.txt"]
    assert (tmp_path / "old.txt").read_text() == "old"


def test_an_interruption_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_files({tmp_path / "a": "a", tmp_path / "folder" / "b": "b"})
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_cannot_be_is_wrong_input(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be written") as raised:
        write_file(tmp_path / "file" / "below", "text")
    assert not isinstance(raised.value, StorageError)


def ended(*words: str, **how: object) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "flightpower", *words], stderr=subprocess.PIPE, text=True, check=False, **how
    )  # type: ignore[call-overload,no-any-return]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux only")
@pytest.mark.parametrize("words", [("propellers", "10x5"), ("new", "aircraft")])
def test_a_full_output_is_one_line(words: tuple[str, ...]) -> None:
    with open("/dev/full", "w") as full:  # noqa: PTH123
        done = ended(*words, stdout=full)
    assert done.returncode == 1
    assert done.stderr == "error: the output cannot be written (No space left on device)\n"


@pytest.mark.parametrize("columns", ["0", "-1", "wide"])
def test_a_terminal_without_a_width_is_printed_on(columns: str) -> None:
    environment = {**os.environ, "COLUMNS": columns}
    done = ended("sim", "trim", "--speed", "15", stdout=subprocess.PIPE, env=environment)
    assert done.returncode == 0 and "P_req" in done.stdout and done.stderr == ""
