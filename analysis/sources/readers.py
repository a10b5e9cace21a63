"""Finds other packages' readers for formats that this one cannot read: entry points in the group `flightpower.readers`.

    [project.entry-points."flightpower.readers"]
    mylogger = "my_package:MyLogger"

The entry point's object, such as a module or an instance of a class, needs all members of `Reader`.
"""

from collections.abc import Collection
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol, runtime_checkable

from flightpower.flight.errors import InputError
from flightpower.flight.formats import first_bytes

if TYPE_CHECKING:
    from flightpower.analysis.sources.recording import FlightRecording

GROUP = "flightpower.readers"


@runtime_checkable
class Reader(Protocol):
    """suffixes : those of its files, such as (".xyz",), by which lists and folders find them"""

    suffixes: Collection[str]

    def recognizes(self, start: bytes) -> bool:
        """Return whether a file that starts with these bytes has this format."""
        ...

    def read(self, path: Path) -> "FlightRecording":
        """Return the channels of a log in SI units. Raises InputError, with a one-line message, if unreadable."""
        ...


class Installed(NamedTuple):
    """title : names of the reader and its package, for messages"""

    title: str
    reader: Reader


@cache
def installed_readers() -> tuple[Installed, ...]:
    """Return other packages' readers. Raises InputError for a reader that cannot be loaded or lacks a member."""
    return tuple(_loaded(point) for point in metadata.entry_points(group=GROUP))


def reader_of(path: Path) -> Installed | None:
    """Return the other package's reader that recognizes a file; None if no reader does."""
    if not installed_readers():
        return None
    start = first_bytes(path)
    for installed_reader in installed_readers():
        try:
            if installed_reader.reader.recognizes(start):
                return installed_reader
        except Exception as error:  # of another package: anything may be wrong with it
            raise InputError(
                f"{path}: the {installed_reader.title} fails ({type(error).__name__}: {error}): report it there"
            ) from None
    return None


def read_by(installed: Installed, path: Path) -> "FlightRecording":
    """Return the recording in a log. Raises InputError in place of any exception from the other package."""
    from flightpower.analysis.sources.recording import FlightRecording  # loads NumPy

    try:
        recording = installed.reader.read(path)
    except InputError:
        raise
    except Exception as error:  # of another package: anything may be wrong with it
        cause = str(error).partition("\n")[0]
        raise InputError(
            f"{path}: cannot be read by the {installed.title} ({type(error).__name__}: {cause}): report it there"
        ) from None
    if not isinstance(recording, FlightRecording):
        raise InputError(f"{path}: the {installed.title} gives no recording, but {type(recording).__name__}")
    return recording


def _loaded(point: metadata.EntryPoint) -> Installed:
    package = "" if point.dist is None else f" of {point.dist.name} {point.dist.version}"
    title = f"reader {point.name}{package}"
    try:
        reader = point.load()
    except Exception as error:  # of another package: anything may be wrong with it
        raise InputError(f"{title}: cannot be loaded ({type(error).__name__}: {error}): fix or uninstall it") from None
    if not isinstance(reader, Reader):
        raise InputError(f"{title}: {point.value} has not all of suffixes, recognizes and read: fix or uninstall it")
    return Installed(title, reader)
