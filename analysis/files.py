"""Atomic writing of small files, and keeping of earlier versions that a user may have edited."""

from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import TypeVar

from flight.errors import InputError

T = TypeVar("T")


def write_file(path: Path, data: str | bytes) -> None:
    """Write a file atomically, with its folder: `path` never holds a part of it.

    Raises InputError when it cannot be written.
    """
    _or_input_error(path, lambda: path.parent.mkdir(parents=True, exist_ok=True))
    partial = path.with_name(path.name + ".part")
    _or_input_error(path, lambda: partial.write_bytes(data.encode() if isinstance(data, str) else data))
    _or_input_error(path, lambda: partial.replace(path))


def write_keeping_previous(path: Path, data: str) -> Path | None:
    """Write a file that users edit. Other content that was there is kept under the first free number, such as
    `runs-1.toml`.

    Returns the path of the content kept; None where there was none, or it was the same. Raises InputError when
    the file cannot be written.
    """
    previous = _or_input_error(path, lambda: path.read_bytes() if path.exists() else b"")
    if previous == data.encode():
        return None
    kept = None
    if previous:
        kept = next(p for i in count(1) if not (p := path.with_stem(f"{path.stem}-{i}")).exists())
        write_file(kept, previous)
    write_file(path, data)
    return kept


def _or_input_error(path: Path, step: Callable[[], T]) -> T:
    """The result of `step`; an OSError becomes an InputError."""
    try:
        return step()
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
