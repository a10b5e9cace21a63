"""The logs on the image of a card, as they are for who reads the card next."""

import hashlib
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from crash_points import LogState, state_of
from image import run


class CardLog(NamedTuple):
    state: LogState
    sha256: str


@contextmanager
def mounted(folder: Path, disk: Path) -> Iterator[Path]:
    """The root of a copy of the disk, whose file system has replayed its journal. The disk is not changed."""
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
    """The logs on the disk by their number (log-0001)."""
    with mounted(folder, disk) as root:
        return {
            path.name[:8]: CardLog(state_of(path), hashlib.sha256(path.read_bytes()).hexdigest())
            for path in sorted((root / "var/lib/flightpower").glob("log-*.mcap"))
        }


def trouble(before: dict[str, CardLog], after: dict[str, CardLog]) -> list[str]:
    """What is wrong with the logs: gone, overwritten, shorter, not readable."""
    wrong = [f"{name} cannot be read: {log.state.error}" for name, log in after.items() if log.state.error]
    for name, old in before.items():
        new = after.get(name)
        if new is None:
            wrong.append(f"{name} is gone")
        elif old.state.complete and new.sha256 != old.sha256:
            wrong.append(f"{name} was complete and has changed")
        elif new.state.messages < old.state.messages:
            wrong.append(f"{name} lost {old.state.messages - new.state.messages} messages")
    return wrong


def file_system_errors(folder: Path, disk: Path) -> str:
    """What e2fsck finds in a copy of the disk after replaying the journal; empty if nothing."""
    copy = folder / "copy.img"
    run("cp", "--sparse=always", "--reflink=auto", disk, copy)
    subprocess.run(["e2fsck", "-p", str(copy)], capture_output=True)
    done = subprocess.run(["e2fsck", "-f", "-n", str(copy)], capture_output=True, text=True)
    copy.unlink()
    return done.stdout.strip()[-200:] if done.returncode else ""
