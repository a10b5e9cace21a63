"""The flights of the folder that was opened. The last two used stay in memory with their results."""

import unicodedata
from collections.abc import Callable, Mapping
from pathlib import Path

from flightpower.analysis.pages.open.folder_files import POLARS, listed, logs_in, polars_in
from flightpower.analysis.pages.open.opened import OpenedFlight, report_folder
from flightpower.analysis.pages.open.request import LIMITS, Json
from flightpower.analysis.pipeline import way_of
from flightpower.analysis.records.flight import Kind
from flightpower.analysis.sources.column_map import BESIDE
from flightpower.analysis.sources.open import TABLES, has_log_suffix, is_table, open_source, suffixes
from flightpower.analysis.sources.recording import FlightRecording
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log

NOT_IN_NAMES = '/\\:*?"<>|'  # characters with a special meaning on some file system


Reading = Callable[[], Log | FlightRecording]


def open_flight(path: Path, workspace: Path, reading: Reading | None = None) -> OpenedFlight:
    """Open a log as the kind of flight that its curve requires. reading : returns the log, if it is being read

    Raises InputError if it cannot be read.
    """
    source = reading() if reading else open_source(path)
    method = way_of(source)
    if isinstance(source, Log) and is_table(path) and not method.without_drag:
        from flightpower.analysis.sources.table import refuse_without_method

        refuse_without_method(source)
    if method.kind is Kind.POWER_REQUIRED:
        from flightpower.analysis.pages.open.runs_flight import RunsFlight  # imported late, as it loads casadi

        assert isinstance(source, Log)
        return RunsFlight(path, workspace, source)
    from flightpower.analysis.pages.open.whole_flight import WholeFlight

    return WholeFlight(path, workspace, source)


class Folder:
    """The folder that was opened.

    workspace : folder for files that the analysis reads while the user edits     reading : logs being read, by name
    """

    def __init__(self, path: Path, workspace: Path, reading: Mapping[str, Reading] = {}):
        self.path, self.workspace = path, workspace
        self._reading = dict(reading)
        self._opened: dict[str, OpenedFlight] = {}

    def logs(self) -> dict[str, Path]:
        """Return the logs in the folder by name; links that lead out of it are left out."""
        return logs_in(self.path)

    def polars(self) -> list[str]:
        """Return names of the files in the folder that hold a predicted polar."""
        return list(polars_in(self.path))

    def flight(self, name: str) -> OpenedFlight:
        """Return an opened flight. Raises InputError if there is no such log in the folder, or it cannot be read."""
        path = self.logs().get(name)
        if path is None:
            raise InputError(f"{name[:80]}: there is no such log in {self.path}; choose one of the list")
        opened = self._opened.get(name)
        if opened is None or opened.changed():
            self._opened.pop(name, None)
            while len(self._opened) > 1:  # keeps two in memory, which may be compared
                self._opened.pop(next(iter(self._opened)))
            opened = self._opened[name] = open_flight(path, self.workspace, self._reading.pop(name, None))
        return opened

    def report(self, name: str) -> bytes:
        """Return the written report of a log. Raises InputError if there is none."""
        path = self.logs().get(name)
        page = path and report_folder(path) / "report.html"
        if page is None or not page.is_file() or page.resolve().parent.parent != self.path.resolve():
            raise InputError(f"{name[:80]}: has no report yet")
        return page.read_bytes()

    def listed(self) -> list[Json]:
        """Return the logs with date, length and kind, newest first."""
        return listed(self.path)

    def new_file(self, name: str) -> Path:
        """Return where a dropped file goes. Raises InputError for a name in use, or not of a log, polar or map."""
        if not is_file_name(name) or not (
            has_log_suffix(name) or Path(name).suffix.lower() in POLARS or f".{name}".lower().endswith(f".{BESIDE}")
        ):
            raise InputError(
                f"{name[:80]!r}: is not the name of a log ({', '.join((*suffixes(), *TABLES))}, also with .gz),"
                f" of a polar ({', '.join(POLARS)}), or of a map of columns ({BESIDE})"
            )
        if (self.path / name).exists():
            raise InputError(f"{name}: is in the folder already; rename the file that you drop")
        return self.path / name


def is_file_name(name: str) -> bool:
    """Whether a name, in any script, can be a visible file in this folder on every operating system."""
    odd = any(
        unicodedata.category(character) in ("Cc", "Cs", "Co", "Cn") or character in NOT_IN_NAMES for character in name
    )
    ends = name[:1] in ("", ".", "-", " ") or name[-1:] in (".", " ")
    return not odd and not ends and len(name.encode("utf-8", "replace")) <= LIMITS.name_bytes
