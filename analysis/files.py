"""Writing of small files: in one step, and without overwriting what people edit."""

from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import TypeVar

from flight.errors import InputError

T = TypeVar("T")


def write_file(path: Path, data: str | bytes) -> None:
    """Write a file of ours in one step: a half-written one never stands under its name."""
    _said(path, lambda: path.parent.mkdir(parents=True, exist_ok=True))
    draft = path.with_name(path.name + ".part")
    _said(path, lambda: draft.write_bytes(data.encode() if isinstance(data, str) else data))
    _said(path, lambda: draft.replace(path))


def write_kept(path: Path, data: str) -> Path | None:
    """Write a file of ours that people edit. Another text that stood there is kept under the first free number,
    `runs-1.toml`; returns that."""
    before = _said(path, lambda: path.read_bytes() if path.exists() else b"")
    if before == data.encode():
        return None
    kept = None
    if before:
        kept = next(p for i in count(1) if not (p := path.with_stem(f"{path.stem}-{i}")).exists())
        write_file(kept, before)
    write_file(path, data)
    return kept


def _said(path: Path, step: Callable[[], T]) -> T:
    try:
        return step()
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
