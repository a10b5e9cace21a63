"""Writes and syncs a file in a thread that does nothing else.

Python threads that compute delay each other; a thread that waits for a slow SD card does not delay the sampling.
Data are kept in memory until they are synced, because after a failed sync the content of the card is unknown: Linux
discards the pages and reports the error once (fsync(2), "NOTES" and "ERRORS"). A new file is tested with its first
bytes: nothing else is written until they are synced, so that a failing card is not filled with copies.
"""

import enum
import errno
import fcntl
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

from flightpower.daq.process_setup import use_every_processor
from flightpower.daq.sync_directory import sync_directory

SYNC_EVERY_S = 0.25
RETRY_EVERY_S = 1.0  # interval of attempts after a write error: space may be freed, a stalled card may recover
SLOW_CALL_S = 2.0  # a write or sync that takes longer is reported
CLOSE_WITHIN_S = 8.0  # longest wait for a disk that does not answer; TimeoutStopSec of the systemd unit is longer
WRITE_BYTES = 2**18  # most bytes per call: the sampling thread cannot run while they are joined
TRIAL_BYTES = 4096  # bytes of a new file before its first sync: a page, the least that a card is given
FULL = frozenset({errno.ENOSPC, errno.EDQUOT})
# Errors of a card that may be fixed, freed or exchanged while the daemon waits; any other error is a mistake in the
# tray file.
CARD_FAULTS = frozenset({errno.EIO, errno.EROFS, errno.ENODEV, errno.ENXIO, *FULL})


class Gone(enum.Enum):
    """How a file left its place while it was being written."""

    DELETED = "was deleted while it was written: what it held is lost"
    MOVED = "was moved away while it was written"


class DiskWriter:
    """A new file, written and synced in the background. Can be the stream of a `LogWriter`.

    name: gives the path for attempt 0, 1, …; an existing file is never overwritten. With `wait`, the file is created
    under the first name before this returns; raises OSError if that fails. Without it, the background thread tries
    until it succeeds, with the next name if a file has the name already.
    """

    def __init__(self, name: Callable[[int], Path], *, wait: bool = True):
        self._name, self._attempt = name, 0
        self.path: Path | None = None  # None until the file is open
        self._new_path: Path | None = None  # requested by `rename`
        self._file = -1
        self._error = ""
        self._errno, self._cause = 0, ""
        self._failing_since_s: float | None = None
        self._busy_since_s: float | None = None  # start of the pending write or sync
        self.broken = False  # a sync failed, or the file is gone: nothing more is written to this file
        self.gone: Gone | None = None
        self.syncs = 0  # number of syncs that succeeded
        self.synced_bytes = 0  # total size of the pieces that are completely on the disk
        self._handed_over = self._cut = self._remove = False
        self._waiting: deque[bytes] = deque()  # pieces not written yet; the first may be written in part
        self._head_written = 0  # bytes of the first piece that are written
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
        """Why the disk cannot be written at the moment; empty if it can."""
        busy_s = self._busy_since_s
        if busy_s is not None and time.monotonic() - busy_s > SLOW_CALL_S:
            return f"{self.path or 'a new file'}: the disk does not answer"
        return self._error

    @property
    def failing_s(self) -> float:
        """How long writing has failed [s]; 0 if it works, or if the disk is only full and may take the rest later."""
        since_s = self._failing_since_s
        waits = self._errno in FULL and not self.broken
        return 0.0 if since_s is None or waits else time.monotonic() - since_s

    @property
    def backlog_bytes(self) -> int:
        """Number of bytes not written yet."""
        return self._backlog_bytes

    def write(self, data: bytes) -> int:
        """Queue data for writing. Never waits."""
        with self._changed:
            self._waiting.append(data)
            self._backlog_bytes += len(data)
            self._changed.notify_all()
        return len(data)

    def rename(self, path: Path) -> None:
        """Give the file another name, before the next write. It keeps its name if the new name is not possible."""
        with self._changed:
            self._new_path = path

    def unsaved(self) -> list[bytes]:
        """The data that may not be on the disk yet, in the pieces given to `write`."""
        with self._changed:
            return [*self._unsynced, *self._waiting]

    def hand_over(self) -> list[bytes]:
        """Return the unsaved data for another file, and write nothing more to this one."""
        with self._changed:
            self._handed_over = self.broken = True
            self._changed.notify_all()
            return [*self._unsynced, *self._waiting]

    def finish(self) -> None:
        """Write the remaining data, sync and close, in the background."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()

    def give_up(self) -> None:
        """Close without writing the remaining data."""
        with self._changed:
            self._closing = self._given_up = True
            self._changed.notify_all()

    def cut_off(self, *, remove: bool) -> None:
        """Close the file and cut off data that were handed over and saved elsewhere. remove: also delete the file."""
        self._cut, self._remove = True, remove
        self.give_up()

    def close(self, within_s: float = CLOSE_WITHIN_S) -> None:
        """Finish the file and wait for the disk, but at most `within_s` without progress.

        After an error it makes one more attempt. `error` is then set if the end of the file is missing.
        """
        self.finish()
        remaining, progress_s = self._backlog_bytes, time.monotonic()
        while self._thread.is_alive():
            self._thread.join(0.1)
            if self._backlog_bytes != remaining:
                remaining, progress_s = self._backlog_bytes, time.monotonic()
            if time.monotonic() - progress_s > within_s:
                self._error = self.error or f"{self.path}: the disk does not answer"
                self.give_up()
                return

    @property
    def done(self) -> bool:
        """Whether the thread has ended."""
        return not self._thread.is_alive()

    def _work(self) -> None:
        use_every_processor(whole_process=False)  # the kernel's work for a write must not hold up the sampling
        synced_s = 0.0
        while True:
            with self._changed:
                pause_s = max(0.0, synced_s + SYNC_EVERY_S - time.monotonic()) if self._unsynced else None
                self._changed.wait_for(lambda: self._waiting or self._closing, pause_s)
                closing = self._closing
                if self._given_up:
                    break
            try:
                if self.broken:  # the data are kept for another file
                    raise OSError(self._errno, self._cause)
                if self._file < 0:
                    self._open()
                self._rename()
                self._write_some(WRITE_BYTES if self.syncs else TRIAL_BYTES)
                due = closing or not self.syncs or time.monotonic() - synced_s >= SYNC_EVERY_S
                if due and (self._unsynced or (self._position and not self.syncs)):
                    self._sync()
                    synced_s = time.monotonic()
                if not self._unsynced:
                    self._error, self._errno, self._failing_since_s = "", 0, None
            except OSError as error:
                self._errno, self._cause = error.errno or errno.EIO, error.strerror or str(error)
                self._error = f"{self.path or error.filename or 'a new file'}: {self._cause}"
                self._failing_since_s = self._failing_since_s or time.monotonic()
                if not self.syncs:
                    self._begin_again()
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
            self._leave()

    def _leave(self) -> None:
        """Close the file, and cut off data that should not stay in it; an error changes nothing."""
        try:
            if self._remove and self.path is not None and self._find_gone() is None:
                self.path.unlink()
            elif self._cut:
                os.ftruncate(self._file, self.synced_bytes)
        except OSError:
            pass
        finally:
            os.close(self._file)

    def _open(self, *, take_next: bool = True) -> None:
        """Create the file and sync its directory entry."""
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
            except FileNotFoundError:  # the folder could not be made at first, or has been deleted since
                if not take_next:
                    raise
                path.parent.mkdir(parents=True)
        self.path, self._failing_since_s = path, None
        fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # marks the file as being written, see log_recovery
        sync_directory(path.parent)
        self._busy_since_s = None

    def _rename(self) -> None:
        """Change the name as requested. An existing file is not replaced; an error changes nothing."""
        with self._changed:
            path, self._new_path = self._new_path, None
        if path is None or self.path is None or path == self.path:
            return
        try:
            if not path.exists() and self._find_gone() is None:
                self._busy_since_s = time.monotonic()
                self.path.rename(path)
                self.path = path
                sync_directory(path.parent)
        except OSError:
            pass
        finally:
            self._busy_since_s = None

    def _write_some(self, most: int) -> None:
        """Write the waiting data and move what the disk has accepted to the unsynced data.

        most: bytes of one call. Until a first sync has succeeded, there is only one call.
        """
        while True:
            with self._changed:
                if not self._waiting or self._handed_over:
                    return
                pieces: list[memoryview] = []
                begin, capacity = self._head_written, most
                for piece in self._waiting:
                    pieces.append(memoryview(piece)[begin : begin + capacity])
                    begin, capacity = 0, capacity - len(pieces[-1])
                    if not capacity:
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
            if not self.syncs:
                return

    def _begin_again(self) -> None:
        """Prepare to write the first bytes again, in the same place."""
        with self._changed:
            self._waiting.extendleft(reversed(self._unsynced))
            self._unsynced.clear()
            self._backlog_bytes += self._position
            self._head_written = self._position = 0

    def _sync(self) -> None:
        count = len(self._unsynced)
        self._busy_since_s = time.monotonic()
        try:
            os.fdatasync(self._file)
            self.gone = self._find_gone()
        except OSError:
            self.broken = self.broken or self.syncs > 0
            raise
        finally:
            self._busy_since_s = None
        with self._changed:
            if not self._handed_over and self.gone is not Gone.DELETED:
                for _ in range(count):
                    self.synced_bytes += len(self._unsynced.popleft())
        self.syncs += 1
        if self.gone is not None:
            self.broken = True
            raise OSError(errno.ENOENT, self.gone.value)

    def _find_gone(self) -> Gone | None:
        """Find out whether the file is no longer where it was begun."""
        try:
            ours = os.fstat(self._file)
            if not ours.st_nlink:
                return Gone.DELETED
            return None if os.path.samestat(ours, Path(self.path or "").stat()) else Gone.MOVED
        except (FileNotFoundError, NotADirectoryError):
            return Gone.MOVED
        except OSError:  # the card cannot tell; the next write will
            return None
