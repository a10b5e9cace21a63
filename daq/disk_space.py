"""Keeps space free on the card as the tray file specifies: stops the recording, or deletes the oldest logs."""

import fcntl
import os
import threading
from collections import deque
from pathlib import Path

from flightpower.daq.config import FullDiskPolicy
from flightpower.daq.log_names import numbered_logs
from flightpower.flight.log_index import MAGIC
from flightpower.flight.messages import Event

CHECK_EVERY_S = 2.0
RESUME_FACTOR = 1.25  # recording resumes once this multiple of the space to keep free is free
UNKNOWN = -1


class DiskSpace:
    """Watches the free space on the disk of `directory`. Everything it does is reported as an event.

    sufficient: whether there is enough space for recording. `check` may wait for the disk, so `start` runs it in a
    thread.
    """

    def __init__(self, directory: Path, keep_free_bytes: int, policy: FullDiskPolicy):
        self._directory = directory
        self._keep_free_bytes = keep_free_bytes
        self._policy = policy
        self.sufficient = True
        self.free_bytes = UNKNOWN
        self._events: deque[Event] = deque()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Check every few seconds from now on, in a thread that does nothing but I/O."""
        self._thread = threading.Thread(target=self._work, name="disk space", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Ask the thread to end. Does not wait for it, because the disk may hang."""
        self._stop.set()

    def events(self) -> list[Event]:
        """The events since the last call."""
        return [self._events.popleft() for _ in range(len(self._events))]

    def check(self) -> None:
        """Measure the free space and apply the policy. Nothing changes when the directory cannot be read."""
        try:
            self.free_bytes = free_bytes(self._directory)
            if self._policy == "delete_oldest":
                while self.free_bytes < self._keep_free_bytes and self._delete_oldest():
                    self.free_bytes = free_bytes(self._directory)
        except OSError:
            self.free_bytes = UNKNOWN
            return
        if self.sufficient and self.free_bytes < self._keep_free_bytes:
            self.sufficient = False
            nothing_left = "no finished log is left to delete, and " if self._policy == "delete_oldest" else ""
            self._report(
                "error",
                f"{nothing_left}recording stops: {_MB(self.free_bytes)} are free at {self._directory}, and the tray "
                f"keeps {_MB(self._keep_free_bytes)} free; move logs to another disk",
            )
        elif not self.sufficient and self.free_bytes >= RESUME_FACTOR * self._keep_free_bytes:
            self.sufficient = True
            self._report("info", f"{_MB(self.free_bytes)} are free again: recording resumes in a new log")

    def _work(self) -> None:
        while not self._stop.wait(CHECK_EVERY_S):
            self.check()

    def _delete_oldest(self) -> bool:
        """Delete the oldest finished log. Returns whether there was one that could be deleted."""
        for path in numbered_logs(self._directory):
            if is_finished(path):
                size = path.stat().st_size
                path.unlink()
                self._report("warning", f"{path} ({_MB(size)}) was deleted to free space (when_full in the tray file)")
                return True
        return False

    def _report(self, severity: str, text: str) -> None:
        self._events.append(Event(severity=severity, sensor="daq", text=text))


def is_finished(path: Path) -> bool:
    """Whether a log is complete and no process is writing it."""
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
    """Free space on the disk of `directory`, which need not exist yet."""
    while not directory.exists() and directory != directory.parent:
        directory = directory.parent
    statistics = os.statvfs(directory)
    return statistics.f_bavail * statistics.f_frsize


def _MB(count: float) -> str:
    return f"{count / 1e6:.0f} MB"
