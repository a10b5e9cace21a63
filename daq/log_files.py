"""The log files of one recording: a new file is started when the current one is large or old enough, on request, when
the disk fails, or when the file is gone.

Tick numbers, time and topics continue from file to file. Each file can be read by itself.
"""

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from zstandard import ZstdCompressor

from flightpower.daq.disk_space import DiskSpace
from flightpower.daq.disk_writer import CARD_FAULTS, CLOSE_WITHIN_S, Gone
from flightpower.daq.log_names import name_with_start
from flightpower.daq.recorder import BACKLOG_BYTES, Recorder
from flightpower.daq.sensors import Sample
from flightpower.flight.errors import InputError
from flightpower.flight.messages import Event

GIVE_UP_AFTER_S = 3.0  # a file that cannot be written or synced is replaced after this time, unless the disk is full
BACK_OFF_FACTOR = 2  # each further file gets this many times as long,
MAX_PATIENCE_S = 60.0  # but at most this time, so that a failing card does not fill with files
WELL_AFTER_S = 60.0  # after this time without an error the patience is reset


class FileLimits(NamedTuple):
    """A new file is started when the current one reaches either limit."""

    duration_ns: int
    size_bytes: int


class LogFiles:
    """The files of a recording. Only `open` and `close` wait for the disk.

    name: gives the path of file number 0, 1, …; begin: writes the header of a new file, given the recorder, the file's
    number, its start in monotonic time [ns] and the path of the previous file. limits: when a new file is started.
    satellite_offset_ns: Unix time by the satellites minus monotonic time; once it is known and set, the names of
    numbered files include their start.
    """

    def __init__(
        self,
        name: Callable[[int], Path],
        begin: Callable[[Recorder, int, int, Path | None], None],
        *,
        offset_ns: int,
        limits: FileLimits,
        disk_space: DiskSpace,
    ):
        self._name, self._begin = name, begin
        self._offset_ns, self._limits, self._disk_space = offset_ns, limits, disk_space
        self._compressor = ZstdCompressor()  # shared by all files: a second one would take half a megabyte more
        self._current: Recorder | None = None
        self._closing: dict[int, Recorder] = {}  # finished files that are still being written, by file number
        self._attempts = 0  # names used so far
        self._files = 0
        self._began_ns = 0
        self._previous: Path | None = None
        self._patience_s = GIVE_UP_AFTER_S
        self._error = ""  # error of the disk, kept until a sync has succeeded
        self._syncs_at_error = 0
        self._failed_s = -math.inf  # real time at which the disk failed last
        self._replaced: dict[int, Recorder] = {}  # files whose data `_saver` has not saved yet, by number
        self._saver: Recorder | None = None  # the file that took over their data
        self._saved_at_bytes = 0  # size of the saver with these data
        self._deleted = False  # whether a file was deleted since the last report that the log is being written
        self._missing = ""  # why the end of a finished file is missing
        self._new_file = False  # requested, but not begun yet
        self._announced: Path | None = None  # path of the file that was last reported as current
        self.satellite_offset_ns: int | None = None
        self._renamed = -1  # number of the file that was last renamed
        self._reported_error = ""
        self._dropped_before = 0  # messages dropped from earlier files
        self._reported_dropped = 0
        self._losing = False
        self._paths: dict[int, Path] = {}  # by file number; a file without a path is not open yet

    def open(self, now_ns: int, *, waits: bool = False) -> None:
        """Start the first file. Raises InputError if it cannot be created.

        waits: if the card is read-only or full, or fails, the recording begins in memory instead.
        """
        path = self._name(0)
        try:
            self._start(now_ns, wait=True)
        except FileExistsError:
            raise InputError(f"{path}: exists already, and a log is never overwritten") from None
        except OSError as error:
            if not (waits and error.errno in CARD_FAULTS):
                raise InputError(f"{path}: cannot be created ({error.strerror or error})") from None
            self._attempts = 0
            self._start(now_ns)

    @property
    def paths(self) -> list[Path]:
        """The files created so far, in order."""
        return [path for _, path in sorted(self._paths.items())]

    @property
    def recording(self) -> bool:
        return self._current is not None

    @property
    def path(self) -> Path | None:
        """Path of the file being written, once it is open."""
        return None if self._current is None else self._current.path

    @property
    def error(self) -> str:
        """Why the disk cannot be written, kept until the waiting data are synced; empty if all is well."""
        return self._error

    @property
    def dropped(self) -> int:
        """Number of messages that were not recorded."""
        return self._dropped_before + (self._current.dropped if self._current else 0)

    @property
    def _backlog_full(self) -> bool:
        return self._current is not None and self._current.disk.backlog_bytes > BACKLOG_BYTES

    def write(self, samples: list[Sample], *, tick: int, now_ns: int) -> None:
        """Add a tick's messages. Does nothing while no file is open."""
        if self._current is not None:
            self._current.write(samples, tick=tick, now_ns=now_ns)

    def update(self, now_ns: int, *, wanted: bool = True, new_file: bool = False) -> list[Event]:
        """Open, change or close the file as required; call once a tick. Returns the events to report.

        wanted: whether to record at all. new_file: whether to start a new file now.
        """
        current, wanted = self._current, wanted and self._disk_space.sufficient
        self._new_file = self._new_file or new_file
        if current is None:
            if wanted:
                self._start(now_ns)
        elif not wanted:
            self._finish_current()
        elif self._should_replace(current):
            self._replace_current(now_ns)
        elif current.ticks and not self.error and (self._new_file or self._reached_limit(current, now_ns)):
            self._finish_current()
            self._start(now_ns)
        self._name_by_start()
        self._release_replaced()
        self._note_error()
        return self._disk_space.events() + self._events() + self._closed_events()

    def close(self) -> str:
        """Finish the file and wait for the disk. Returns why the end of the log may be missing, or an empty string."""
        self._disk_space.stop()
        if self._current is not None:
            self._finish_current()
        error = ""
        deadline_s = time.monotonic() + CLOSE_WITHIN_S
        for number, recorder in self._closing.items():
            recorder.disk.close(max(0.1, deadline_s - time.monotonic()))
            self._note_path(number, recorder)
            error = error or recorder.disk.error
        self._release_replaced()
        for failed in self._replaced.values():
            failed.disk.give_up()  # it may hold the only copy
        return error or self._missing

    def _start(self, now_ns: int, *, wait: bool = False) -> None:
        first = self._attempts

        def name(taken: int) -> Path:
            self._attempts = max(self._attempts, first + taken + 1)
            return self._name(first + taken)

        recorder = Recorder(name, offset_ns=self._offset_ns, wait=wait, compressor=self._compressor)
        self._attempts = max(self._attempts, first + 1)
        self._begin(recorder, self._files, now_ns, self._previous)
        self._current, self._files, self._began_ns, self._new_file = recorder, self._files + 1, now_ns, False

    def _finish_current(self) -> None:
        assert self._current is not None
        self._current.finish()
        self._closing[self._files - 1] = self._current
        self._leave_current()

    def _should_replace(self, current: Recorder) -> bool:
        """Whether to try another file. A file that cannot be created is tried again automatically."""
        disk = current.disk
        if disk.gone is not None and self._patience_s == GIVE_UP_AFTER_S:
            return True  # the file is gone, but the card works
        return disk.path is not None and disk.failing_s > self._patience_s

    def _replace_current(self, now_ns: int) -> None:
        """Start a new file with the data that could not be written to the current one."""
        failed, number = self._current, self._files - 1
        assert failed is not None
        self._leave_current()
        self._start(now_ns)
        assert self._current is not None
        self._current.take_over(failed)
        self._saver, self._saved_at_bytes, self._syncs_at_error = self._current, self._current.log.size_bytes, 0
        self._error, self._failed_s = failed.disk.error or self._error, time.monotonic()
        if failed.holds_messages:
            self._replaced[number] = failed
        else:
            failed.cut_off()
        if failed.disk.gone is not None or not failed.holds_messages:
            self._paths.pop(number, None)
        self._deleted = self._deleted or failed.disk.gone is Gone.DELETED
        self._patience_s = min(BACK_OFF_FACTOR * self._patience_s, MAX_PATIENCE_S)

    def _release_replaced(self) -> None:
        """Truncate failed files once another file has saved their data, so that nothing is stored twice."""
        if self._replaced and self._saver is not None and self._saver.disk.synced_bytes >= self._saved_at_bytes:
            for failed in self._replaced.values():
                failed.cut_off()
            self._replaced.clear()

    def _note_error(self) -> None:
        """Keep an error until a later sync has succeeded, and the data of failed files are saved."""
        if self._current is None:
            self._error = ""
            return
        disk = self._current.disk
        if error := disk.error:
            self._error, self._syncs_at_error, self._failed_s = error, disk.syncs, time.monotonic()
        elif self._error and disk.syncs > self._syncs_at_error and not self._replaced:
            self._error = ""
        elif not self._error and time.monotonic() - self._failed_s > WELL_AFTER_S:
            self._patience_s = GIVE_UP_AFTER_S

    def _leave_current(self) -> None:
        assert self._current is not None
        self._note_path(self._files - 1, self._current)
        self._previous = self._current.path
        self._dropped_before += self._current.dropped
        self._current = None

    def _name_by_start(self) -> None:
        """Rename the current file to include its start, as soon as the satellites' time is known."""
        path, number = self.path, self._files - 1
        if self._current is None or path is None or self.satellite_offset_ns is None or self._renamed == number:
            return
        self._renamed = number
        self._current.disk.rename(name_with_start(path, self._began_ns + self.satellite_offset_ns))

    def _reached_limit(self, current: Recorder, now_ns: int) -> bool:
        return now_ns - self._began_ns >= self._limits.duration_ns or current.log.size_bytes >= self._limits.size_bytes

    def _note_path(self, number: int, recorder: Recorder) -> None:
        if recorder.path is not None:
            self._paths[number] = recorder.path

    def _events(self) -> list[Event]:
        events = []
        error, before = self.error, self._reported_error
        if self.path is not None and self.path != self._announced:
            self._announced = self._paths[self._files - 1] = self.path
            events.append(_event("info", f"recording {self.path}"))
        if error and not before:
            events.append(_event("error", f"the log cannot be written and is kept in memory: {error}"))
        if self.dropped > self._reported_dropped and not self._losing:
            self._losing = True
            events.append(_event("error", "the disk is too slow and the memory is full: messages are being lost"))
        if self._current is not None and (before or self._losing) and not error and not self._backlog_full:
            lost = self.dropped - self._reported_dropped
            self._losing, self._reported_dropped = False, self.dropped
            text = (
                f"{lost} messages were lost"
                if lost
                else "nothing more was lost"
                if self._deleted
                else "nothing was lost"
            )
            self._deleted = False
            events.append(_event("info", f"the log is being written again, {text}"))
        self._reported_error = error
        return events

    def _closed_events(self) -> list[Event]:
        """Forget finished files that are closed. Returns an event for each file whose end is missing."""
        events = []
        for number, recorder in list(self._closing.items()):
            self._note_path(number, recorder)
            if recorder.disk.done:
                del self._closing[number]
                if error := recorder.disk.error:
                    self._missing = self._missing or error
                    events.append(_event("error", f"the end of a log is missing: {error}"))
        return events


def _event(severity: str, text: str) -> Event:
    return Event(severity=severity, sensor="daq", text=text)
