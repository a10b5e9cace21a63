"""Writes small files that a user may have edited, and keeps their earlier versions."""

from itertools import count
from pathlib import Path

from flightpower.flight.files import write_error, write_file

__all__ = ["write_file", "write_keeping_previous"]


def write_keeping_previous(path: Path, data: str) -> Path | None:
    """Write a file that users edit. Earlier content that differs is kept in a file with the first free number, such as
    `runs-1.toml`.

    Return the path of the content kept; None if there was none or it was the same. Raises InputError when the earlier
    file cannot be read or a file cannot be written.
    """
    try:
        previous = path.read_bytes() if path.exists() else b""
    except OSError as error:
        raise write_error(path, error) from None
    if previous == data.encode():
        return None
    backup = None
    if previous:
        backup = next(p for i in count(1) if not (p := path.with_stem(f"{path.stem}-{i}")).exists())
        write_file(backup, previous)
    write_file(path, data)
    return backup
