"""Readers of other packages, for formats that this one does not read: entry points of the group `flightpower.readers`.

    [project.entry-points."flightpower.readers"]
    mylogger = "my_package:MyLogger"

The entry point's object, such as a module or an instance of a class, has what `Reader` has.
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
    """suffixes : of its files, for lists and folders, such as (".xyz",)"""

    suffixes: Collection[str]

    def recognizes(self, start: bytes) -> bool:
        """Whether a file whose first bytes these are has this format."""
        ...

    def read(self, path: Path) -> "FlightRecording":
        """The channels of a log in SI units. Raises InputError, in one line, when it cannot be read."""
        ...


class Installed(NamedTuple):
    """title : of the reader and its package, for messages"""

    title: str
    reader: Reader


@cache
def installed_readers() -> tuple[Installed, ...]:
    """Readers of other packages. Raises InputError for one that cannot be loaded, or lacks something."""
    return tuple(_loaded(point) for point in metadata.entry_points(group=GROUP))


def reader_of(path: Path) -> Installed | None:
    """The reader of another package that recognizes a file; None where none does."""
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
    """The recording in a log. Raises InputError for whatever the other package raises."""
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
