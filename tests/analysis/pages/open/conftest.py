"""A folder with the log of a simulated flight, as it is opened."""

from pathlib import Path

import pytest

from flightpower.analysis.pages.open.flights import Folder
from tests.unchanged.commands import flight


@pytest.fixture(scope="session")
def flown() -> bytes:
    return flight("demo", "--seed", "11")


@pytest.fixture(scope="module")
def shared(flown: bytes, tmp_path_factory: pytest.TempPathFactory) -> Folder:
    """One folder for all tests of a module, so that what was computed for the flight is kept."""
    return folder_with(flown, tmp_path_factory.mktemp("shared"))


@pytest.fixture
def opened(flown: bytes, tmp_path: Path) -> Folder:
    return folder_with(flown, tmp_path)


def folder_with(log: bytes, directory: Path) -> Folder:
    """The folder `flights`, next to a file that the page must not serve."""
    for name in ("flights", "workspace"):
        (directory / name).mkdir()
    (directory / "flights" / "log.mcap").write_bytes(log)
    (directory / "secret.mcap").write_text("SECRET", "utf-8")
    return Folder(directory / "flights", directory / "workspace")
