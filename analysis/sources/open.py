"""Opens any record of a flight: a log of the daemon or of an autopilot, or a table."""

from pathlib import Path
from typing import TYPE_CHECKING

from flightpower.analysis.sources.autopilot import read_autopilot_log
from flightpower.analysis.sources.readers import installed_readers, read_by, reader_of
from flightpower.analysis.sources.recognize import autopilot_of
from flightpower.flight.errors import InputError
from flightpower.flight.formats import READ_BY_OTHERS, SUFFIXES, Format, format_of, refusal
from flightpower.flight.log_reader import Log, read_log

if TYPE_CHECKING:
    from flightpower.analysis.sources.recording import FlightRecording

TABLES = (".csv", ".parquet", ".mat")  # suffixes of tables; the first bytes show the actual format


def suffixes() -> tuple[str, ...]:
    """Return the suffixes of readable logs in lower case, including those of readers from other packages."""
    others = (suffix.lower() for installed_reader in installed_readers() for suffix in installed_reader.reader.suffixes)
    return tuple(dict.fromkeys((*SUFFIXES.values(), *others)))


def open_source(path: Path, columns: Path | None = None) -> "Log | FlightRecording":
    """Open a log of the daemon, or a table with its column map, as messages; open an autopilot's log as channels.

    Raises InputError where the file cannot be read.
    """
    refuse_folder(path)
    autopilot = autopilot_of(path)
    other = reader_of(path) if not autopilot and format_of(path) is not Format.DAEMON else None
    if not autopilot and other is None and is_table(path):
        from flightpower.analysis.sources.table import log_of_table  # loads pandas

        return log_of_table(path, columns)
    if columns is not None:
        raise InputError(
            f"{path}: --columns: only for tables (CSV, Parquet, .mat), and this file is not a table; leave it out"
        )
    if autopilot:
        return read_autopilot_log(path, autopilot)
    return read_log(path) if other is None else read_by(other, path)


def has_log_suffix(name: str) -> bool:
    """Return whether a file's name is that of a log or a table, including compressed ones."""
    return Path(name.lower().removesuffix(".gz")).suffix in (*suffixes(), *TABLES)


def refuse_non_log(path: Path) -> None:
    """Check the first bytes and the name of a file before any work starts on it.

    Raises InputError if it is neither a log nor a table, if lists of logs would leave it out, or if it cannot be
    read.
    """
    if format_of(path) not in (Format.DAEMON, *READ_BY_OTHERS) and reader_of(path) is None and not is_table(path):
        raise refusal(path)
    if not has_log_suffix(path.name):
        raise InputError(
            f"{path}: a log or a table whose name does not say so; rename it to end in"
            f" {', '.join((*suffixes(), *TABLES))}, or in one of these and .gz"
        )


def is_table(path: Path) -> bool:
    """Return whether a file is a table of columns. Raises InputError if it cannot be read."""
    from flightpower.analysis.sources.table_file import table_kind

    return path.is_file() and table_kind(path) is not None


def refuse_folder(path: Path) -> None:
    """Raises InputError for a folder; the message names a log in it."""
    if path.is_dir():
        inside = sorted(path.glob("*.mcap"))
        raise InputError(
            f"{path}: cannot be read, it is a folder; give a log, such as {inside[0] if inside else 'log.mcap'}"
        )
