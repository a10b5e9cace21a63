"""Reads the logs on a card's image, as the next reader of the card finds them."""

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from crash_points import LogState, state_of
from image import run


class CardLog(NamedTuple):
    state: LogState
    sha256: str


EMPTY = hashlib.sha256(b"").hexdigest()
_known: dict[str, CardLog] = {}  # logs by their contents, because most are read again after each trial


@contextmanager
def mounted(folder: Path, disk: Path) -> Iterator[Path]:
    """Mount a copy of the disk, which replays its journal, and yield the root. The disk itself is not changed."""
    copy, root = folder / "copy.img", folder / "mounted"
    run("cp", "--sparse=always", "--reflink=auto", disk, copy)
    root.mkdir(exist_ok=True)
    run("mount", "-o", "loop", copy, root)
    try:
        yield root
    finally:
        run("umount", root)
        copy.unlink()


def logs_on(folder: Path, disk: Path) -> dict[str, CardLog]:
    """Return the logs on the disk by their number (log-0001)."""
    with mounted(folder, disk) as root:
        return {path.name[:8]: _read(path) for path in sorted((root / "var/lib/flightpower").glob("log-*.mcap"))}


def _read(path: Path) -> CardLog:
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    if sha256 not in _known:
        _known[sha256] = CardLog(state_of(path), sha256)
    return _known[sha256]


def trouble(before: dict[str, CardLog], after: dict[str, CardLog]) -> list[str]:
    """Return what is wrong with the logs: gone, overwritten, shorter, unreadable.

    Only the last file may be empty: the power was cut after it was created and before its first bytes. The next start
    removes it.
    """
    last = max(after, default="")
    wrong = [
        f"{name} cannot be read: {log.state.error}"
        for name, log in after.items()
        if log.state.error and (log.sha256 != EMPTY or name != last)
    ]
    for name, old in before.items():
        new = after.get(name)
        if new is None and old.sha256 == EMPTY:
            continue
        if new is None:
            wrong.append(f"{name} is gone")
        elif old.state.complete and new.sha256 != old.sha256:
            wrong.append(f"{name} was complete and has changed")
        elif new.state.messages < old.state.messages:
            wrong.append(f"{name} lost {old.state.messages - new.state.messages} messages")
    return wrong
