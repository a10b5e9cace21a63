"""The log on its way to the disk: encoded by the sampling thread, written by another one that does nothing but I/O.

Python threads that compute delay each other; a thread that waits for a slow SD card does not delay the sampling.
"""

import fcntl
import os
import threading
import time
from collections import deque
from pathlib import Path

from daq.sensors import Sample
from flight.errors import InputError
from flight.log_writer import LogWriter

CHUNK_EVERY_NS = 500_000_000  # of the log's time: what a power cut can cost, together with SYNC_EVERY_S
SYNC_EVERY_S = 0.5
RETRY_EVERY_S = 1.0  # after a write error: a card may be emptied, a stalled one may come back
BACKLOG_BYTES = 8 * 2**20  # several minutes of the default tray
PATIENCE_S = 1.0  # how long the sampling may be held up when the backlog is full
NEVER_BY_SIZE = 2**30  # chunks are closed by time


class DiskWriter:
    """A file that is written and synced by a thread of its own. Never overwrites an existing file.

    Satisfies what `LogWriter` asks of a stream. `error` says what the last write met, and is empty when all is well;
    `lost` is true once data had to be dropped.
    """

    def __init__(self, path: Path):
        self.path = path
        self.error = ""
        self.lost = False
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        self._file = os.open(path, flags, 0o644)
        fcntl.flock(self._file, fcntl.LOCK_EX)  # so that nobody takes it for an unfinished one
        sync_directory(path.parent)
        self._position = 0
        self._backlog: deque[bytes] = deque()
        self._backlog_bytes = 0
        self._changed = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name="disk", daemon=True)
        self._thread.start()

    def write(self, data: bytes) -> int:
        """Hand over; waits a little only when the backlog is full, and drops `data` when that does not help."""
        with self._changed:
            if self._backlog_bytes > BACKLOG_BYTES and not self.lost:
                self._changed.wait_for(lambda: self._backlog_bytes <= BACKLOG_BYTES, PATIENCE_S)
            if self._backlog_bytes > BACKLOG_BYTES or self.lost:
                self.lost = True
            elif data:
                self._backlog.append(bytes(data))
                self._backlog_bytes += len(data)
                self._changed.notify_all()
        self._position += len(data)
        return len(data)

    def tell(self) -> int:
        return self._position

    def flush(self) -> None:
        """Nothing to do: what was handed over is on its way."""

    def close(self) -> None:
        """Write what is left, sync, close. After an error there is one more try."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._thread.join()
        os.close(self._file)

    def _work(self) -> None:
        synced_s, dirty = time.monotonic(), False
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._backlog or self._closing, SYNC_EVERY_S)
                data = b"".join(self._backlog)
                closing = self._closing
            try:
                if data:
                    self._write_all(data)
                    dirty = True
                if dirty and (closing or time.monotonic() - synced_s >= SYNC_EVERY_S):
                    os.fdatasync(self._file)
                    synced_s, dirty = time.monotonic(), False
                self.error = ""
            except OSError as error:
                self.error = f"{self.path}: {error.strerror or error}"
                if closing:
                    return
                with self._changed:
                    self._changed.wait_for(lambda: self._closing, RETRY_EVERY_S)
                continue
            if closing and not self._backlog:
                return

    def _write_all(self, data: bytes) -> None:
        """Write, and take off the backlog what the disk has accepted."""
        view = memoryview(data)
        while view:
            count = os.write(self._file, view)
            view = view[count:]
            with self._changed:
                self._backlog_bytes -= count
                while count:
                    piece = self._backlog.popleft()
                    if len(piece) > count:
                        self._backlog.appendleft(piece[count:])
                    count -= min(count, len(piece))
                self._changed.notify_all()


class Recorder:
    """A log file being recorded. offset_ns: Unix time minus monotonic time, fixed for the whole log."""

    def __init__(self, path: Path, *, offset_ns: int):
        self.path = path
        self._disk = DiskWriter(path)
        self.offset_ns = offset_ns
        self._chunk_due_ns: int | None = None
        self.log = LogWriter(self._disk, chunk_bytes=NEVER_BY_SIZE)  # type: ignore[arg-type]

    @property
    def error(self) -> str:
        """Why the disk does not take data at the moment; empty when it does."""
        return self._disk.error

    @property
    def lost(self) -> bool:
        """Whether data had to be dropped: this file cannot be continued."""
        return self._disk.lost

    def write(self, samples: list[Sample], *, tick: int, now_ns: int) -> None:
        """Add a tick's messages; closes the chunk when it is half a second old."""
        for sample in samples:
            self.log.write(sample.topic, sample.message, time_ns=sample.time_ns + self.offset_ns, tick=tick)
        if self._chunk_due_ns is None:
            self._chunk_due_ns = now_ns + CHUNK_EVERY_NS
        if now_ns >= self._chunk_due_ns:
            self.log.flush()
            self._chunk_due_ns = now_ns + CHUNK_EVERY_NS

    def close(self) -> None:
        """Write the index, wait for the disk."""
        self.log.finish()
        self._disk.close()


def new_log_path(directory: Path) -> Path:
    """The next free log-NNNN.mcap. Raises InputError when the directory cannot be made or read."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        numbers = [int(p.stem[4:]) for p in directory.glob("log-*.mcap*") if p.stem[4:].isdigit()]
    except OSError as error:
        raise InputError(f"{directory}: cannot be used for logs ({error.strerror or error})") from None
    return directory / f"log-{max(numbers, default=0) + 1:04d}.mcap"


def open_recorder(path: Path, *, offset_ns: int) -> Recorder:
    """A recorder on a new file. Raises InputError when the file exists or cannot be created."""
    try:
        return Recorder(path, offset_ns=offset_ns)
    except FileExistsError:
        raise InputError(f"{path}: exists already, and a log is never overwritten") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be created ({error.strerror or error})") from None


def sync_directory(directory: Path) -> None:
    """Make a new name in `directory` survive a power cut."""
    handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
