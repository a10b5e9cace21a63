"""A file on its way to the disk: written and synced by a thread of its own that does nothing but I/O.

Python threads that compute delay each other; a thread that waits for a slow SD card does not delay the sampling.
What was handed over is kept until it is synced, because after a failed sync nobody knows what is on the card (on Linux
the kernel then forgets the pages and reports the error once; see fsync(2), "NOTES" and "ERRORS").
"""

import errno
import fcntl
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

SYNC_EVERY_S = 0.25
RETRY_EVERY_S = 1.0  # after a write error: a card may be emptied, a stalled one may come back
SILENCE_S = 2.0  # a write or sync that takes longer is told
CLOSE_WITHIN_S = 8.0  # of a disk that does not answer; the service manager's patience is longer than this
WRITE_BYTES = 2**18  # at a time: while they are put together, the sampling cannot compute
FULL = frozenset({errno.ENOSPC, errno.EDQUOT})


class DiskWriter:
    """A new file that is written and synced in the background. Satisfies what `LogWriter` asks of a stream.

    name: its path, and the next one to try when there is something already; that is never touched. With `wait` the file
    is created before this returns, with the first name or OSError; without, in the background, where that is tried
    until it succeeds.
    """

    def __init__(self, name: Callable[[int], Path], *, wait: bool = True):
        self._name, self._attempt = name, 0
        self.path: Path | None = None  # once it is open
        self._file = -1
        self._error = ""
        self._errno = 0
        self._failing_since_s: float | None = None
        self._busy_since_s: float | None = None  # the call that the thread is in
        self.broken = False  # a sync failed: this file cannot be trusted with more
        self._waiting: deque[bytes] = deque()  # not written yet; the first perhaps in part
        self._head_written = 0  # bytes of the first that are
        self._unsynced: deque[bytes] = deque()
        self._position = 0
        self._backlog_bytes = 0
        self._changed = threading.Condition()
        self._closing = self._given_up = False
        if wait:
            self._open(take_next=False)
        self._thread = threading.Thread(target=self._work, name="disk", daemon=True)
        self._thread.start()

    @property
    def error(self) -> str:
        """What is wrong with the disk at the moment; empty when it takes data."""
        busy_s = self._busy_since_s
        if busy_s is not None and time.monotonic() - busy_s > SILENCE_S:
            return f"{self.path or 'a new file'}: the disk does not answer"
        return self._error

    @property
    def failing_s(self) -> float:
        """For how long it has refused data for another reason than being full; 0 when it does not."""
        since_s = self._failing_since_s
        return 0.0 if since_s is None or self._errno in FULL else time.monotonic() - since_s

    @property
    def backlog_bytes(self) -> int:
        """Handed over and not written yet."""
        return self._backlog_bytes

    def write(self, data: bytes) -> int:
        """Hand over; never waits."""
        with self._changed:
            self._waiting.append(data)
            self._backlog_bytes += len(data)
            self._changed.notify_all()
        return len(data)

    def unsaved(self) -> list[bytes]:
        """What was handed over and is not known to be on the disk, in pieces as they came."""
        with self._changed:
            return [*self._unsynced, *self._waiting]

    def retire(self) -> None:
        """Write what is left, sync, close, without waiting for it."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()

    def give_up(self) -> None:
        """Close without writing what is left."""
        with self._changed:
            self._closing = self._given_up = True
            self._changed.notify_all()

    def close(self, within_s: float = CLOSE_WITHIN_S) -> None:
        """`retire`, and wait for it: as long as the disk takes data, at most `within_s` when it does not.

        After an error there is one more try. `error` says so when the end of the file is missing.
        """
        self.retire()
        left, since_s = self._backlog_bytes, time.monotonic()
        while self._thread.is_alive():
            self._thread.join(0.1)
            if self._backlog_bytes != left:
                left, since_s = self._backlog_bytes, time.monotonic()
            if time.monotonic() - since_s > within_s:
                self._error = self.error or f"{self.path}: the disk does not answer"
                self.give_up()
                return

    @property
    def done(self) -> bool:
        """Whether the thread has ended."""
        return not self._thread.is_alive()

    def _work(self) -> None:
        synced_s = 0.0
        while True:
            with self._changed:
                pause_s = max(0.0, synced_s + SYNC_EVERY_S - time.monotonic()) if self._unsynced else None
                self._changed.wait_for(lambda: self._waiting or self._closing, pause_s)
                closing = self._closing
                if self._given_up:
                    break
            try:
                if self.broken:  # what is handed over is kept for another file
                    raise OSError(self._errno, "a sync failed, and the file is not continued")
                if self._file < 0:
                    self._open()
                self._write_some()
                if self._unsynced and (closing or time.monotonic() - synced_s >= SYNC_EVERY_S):
                    self._sync()
                    synced_s = time.monotonic()
                self._error, self._errno, self._failing_since_s = "", 0, None
            except OSError as error:
                self._error = f"{self.path or error.filename or 'a new file'}: {error.strerror or error}"
                self._errno = error.errno or errno.EIO
                self._failing_since_s = self._failing_since_s or time.monotonic()
                if closing:
                    break
                with self._changed:
                    self._changed.wait_for(lambda: self._closing, RETRY_EVERY_S)
                continue
            finally:
                self._busy_since_s = None
            if closing and not self._waiting and not self._unsynced:
                break
        if self._file >= 0:
            os.close(self._file)

    def _open(self, *, take_next: bool = True) -> None:
        """Create the file, and make its name survive a power cut."""
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        while self._file < 0:
            path = self._name(self._attempt)
            self._busy_since_s = time.monotonic()
            try:
                self._file = os.open(path, flags, 0o644)
            except FileExistsError:
                if not take_next:
                    raise
                self._attempt += 1
        self.path = path
        fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # so that nobody takes it for an unfinished one
        sync_directory(path.parent)
        self._busy_since_s = None

    def _write_some(self) -> None:
        """Write what waits, and move what the disk has accepted to what is to be synced."""
        while True:
            with self._changed:
                if not self._waiting:
                    return
                pieces: list[memoryview] = []
                begin, room = self._head_written, WRITE_BYTES
                for piece in self._waiting:
                    pieces.append(memoryview(piece)[begin : begin + room])
                    begin, room = 0, room - len(pieces[-1])
                    if not room:
                        break
            self._busy_since_s = time.monotonic()
            count = os.pwrite(self._file, b"".join(pieces), self._position)
            self._busy_since_s = None
            self._position += count
            with self._changed:
                self._backlog_bytes -= count
                self._head_written += count
                while self._waiting and self._head_written >= len(self._waiting[0]):
                    self._head_written -= len(self._waiting[0])
                    self._unsynced.append(self._waiting.popleft())
                self._changed.notify_all()

    def _sync(self) -> None:
        count = len(self._unsynced)
        self._busy_since_s = time.monotonic()
        try:
            os.fdatasync(self._file)
        except OSError:
            self.broken = True
            raise
        finally:
            self._busy_since_s = None
        with self._changed:
            for _ in range(count):
                self._unsynced.popleft()


def sync_directory(directory: Path) -> None:
    """Make a new name in `directory` survive a power cut."""
    handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
