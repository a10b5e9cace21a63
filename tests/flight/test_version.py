"""The version in results and logs: of the installation, and in a checkout of the commit that runs."""

import subprocess
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import pytest

from flightpower.flight import version as module
from flightpower.flight.version import version


@pytest.fixture(autouse=True)
def _asked_anew() -> Iterator[None]:
    version.cache_clear()
    yield
    version.cache_clear()


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository with one commit and a tag, as the one that the software runs from, installed as 1.0.0.dev7."""
    (tmp_path / "file").write_text("committed")
    for name in ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE"):
        monkeypatch.delenv(name, raising=False)
    for command in (("init", "-q"), ("add", "file"), ("commit", "-q", "-m", "First"), ("tag", "v0.9.0")):
        git(tmp_path, *command)
    monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(metadata, "version", lambda name: "1.0.0.dev7+g123456789")
    return tmp_path


def git(folder: Path, *arguments: str) -> str:
    who = ("-c", "user.name=A", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false")
    return subprocess.run(["git", *who, *arguments], cwd=folder, capture_output=True, text=True, check=True).stdout


def test_a_checkout_states_the_commit_that_runs_and_not_the_one_that_was_installed(checkout: Path) -> None:
    assert version() == f"1.0.0.dev7+g{git(checkout, 'rev-parse', '--short=9', 'HEAD').strip()}"


def test_a_changed_file_is_stated(checkout: Path) -> None:
    (checkout / "file").write_text("changed")
    assert version().endswith(".dirty")


def test_the_installed_version_where_git_is_missing_or_refuses(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    assert version() == "1.0.0.dev7+g123456789"
    monkeypatch.undo()
    monkeypatch.setattr(metadata, "version", lambda name: "1.0.0")
    (checkout / ".git" / "HEAD").unlink()
    monkeypatch.setattr(module, "ROOT", checkout)
    version.cache_clear()
    assert version() == "1.0.0"


def test_an_installation_states_its_own_version_and_asks_no_git(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(module, "_commit", lambda checkout: pytest.fail("git was asked"))
    assert version() == metadata.version("flightpower")


def test_a_folder_that_was_never_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(metadata, "version", none)
    assert version() == module.UNKNOWN
