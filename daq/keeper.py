"""Keeps room on the card, by the policy of the tray file: says when there is none, or deletes the oldest logs."""

import fcntl
import os
import threading
from collections import deque
from pathlib import Path
from typing import Literal

from flight.log_index import MAGIC
from flight.messages import Event

Policy = Literal["stop", "delete_oldest"]
LOOK_EVERY_S = 2.0
AGAIN = 1.25  # recording goes on when there is this much more room than has to be kept
UNKNOWN = -1


class Keeper:
    """Watches the room where `directory` lies; what it does is told as events, nothing happens silently.

    room: whether there is enough for recording. `look` may wait for the disk; the thread that `start` makes calls it.
    """

    def __init__(self, directory: Path, keep_free_bytes: int, policy: Policy):
        self._directory = directory
        self._keep = keep_free_bytes
        self._policy = policy
        self.room = True
        self.free_bytes = UNKNOWN
        self._events: deque[Event] = deque()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Look every few seconds from now on, in a thread that does nothing but I/O."""
        self._thread = threading.Thread(target=self._work, name="keeper", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Does not wait: the disk may hang."""
        self._stop.set()

    def events(self) -> list[Event]:
        """What is new since the last call."""
        return [self._events.popleft() for _ in range(len(self._events))]

    def look(self) -> None:
        """Measure the room, and do what the policy asks. A directory that cannot be looked at says nothing."""
        try:
            self.free_bytes = free_bytes(self._directory)
            if self._policy == "delete_oldest":
                while self.free_bytes < self._keep and self._delete_oldest():
                    self.free_bytes = free_bytes(self._directory)
        except OSError:
            self.free_bytes = UNKNOWN
            return
        if self.room and self.free_bytes < self._keep:
            self.room = False
            nothing_left = "no finished log is left to delete, and " if self._policy == "delete_oldest" else ""
            self._tell(
                "error",
                f"{nothing_left}recording stops: {_MB(self.free_bytes)} left at {self._directory}, and the tray keeps "
                f"{_MB(self._keep)} free; move logs away",
            )
        elif not self.room and self.free_bytes >= AGAIN * self._keep:
            self.room = True
            self._tell("info", f"there is room again ({_MB(self.free_bytes)}): recording goes on in a new log")

    def _work(self) -> None:
        while not self._stop.wait(LOOK_EVERY_S):
            self.look()

    def _delete_oldest(self) -> bool:
        """Whether a finished log could be deleted."""
        for path in sorted(self._directory.glob("log-*.mcap"), key=number_of):
            if number_of(path) >= 0 and is_finished(path):
                size = path.stat().st_size
                path.unlink()
                self._tell("warning", f"{path} was deleted to make room ({_MB(size)}), as the tray asks for")
                return True
        return False

    def _tell(self, severity: str, text: str) -> None:
        self._events.append(Event(severity=severity, sensor="daq", text=text))


def number_of(path: Path) -> int:
    """The number in log-NNNN.mcap; -1 for any other name."""
    digits = path.name.removeprefix("log-").removesuffix(".mcap")
    return int(digits) if digits.isdigit() else -1


def is_finished(path: Path) -> bool:
    """Whether a log has its end and nobody is writing it."""
    with path.open("rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        size = stream.seek(0, os.SEEK_END)
        if size < 2 * len(MAGIC):
            return False
        stream.seek(-len(MAGIC), os.SEEK_END)
        return stream.read() == MAGIC


def free_bytes(directory: Path) -> int:
    """Room on the disk where logs go, or would go once the directory is made."""
    while not directory.exists() and directory != directory.parent:
        directory = directory.parent
    room = os.statvfs(directory)
    return room.f_bavail * room.f_frsize


def _MB(count: float) -> str:
    return f"{count / 1e6:.0f} MB"
