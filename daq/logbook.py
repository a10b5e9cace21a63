"""The logs of one recording: starts a new file when one is long enough, when asked to, or when the disk fails.

Ticks, time and topics run on from file to file, and each file is complete by itself.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from zstandard import ZstdCompressor

from daq.disk import CLOSE_WITHIN_S
from daq.keeper import Keeper, number_of
from daq.recorder import BACKLOG_BYTES, Recorder
from daq.sensors import Sample
from flight.errors import InputError
from flight.messages import Event

GIVE_UP_AFTER_S = 3.0  # on a file that cannot be written, for another reason than a full disk
BACK_OFF = 2  # the next one is given this much longer …
LONGEST_S = 60.0  # … up to here, so that a dying card is not littered with files


class Limits(NamedTuple):
    """When a file is long enough."""

    duration_ns: int
    size_bytes: int


class Logbook:
    """Where a recording goes. Nothing in here waits for the disk, except the first file's creation and `close`.

    name: path of file number 0, 1, …; begin: puts into a new file what stands at its start, told its number, its
    monotonic time [ns] and the file before it. Raises InputError when the first file cannot be created.
    """

    def __init__(
        self,
        name: Callable[[int], Path],
        begin: Callable[[Recorder, int, int, Path | None], None],
        *,
        offset_ns: int,
        limits: Limits,
        keeper: Keeper,
    ):
        self._name, self._begin = name, begin
        self._offset_ns, self._limits, self._keeper = offset_ns, limits, keeper
        self._compressor = ZstdCompressor()  # one for all files: two at a change of file would be half a megabyte more
        self._current: Recorder | None = None
        self._closing: dict[int, Recorder] = {}  # finished and still being written, by file number
        self._attempts = 0  # names used so far
        self._files = 0
        self._began_ns = 0
        self._previous: Path | None = None
        self._patience_s = GIVE_UP_AFTER_S
        self._announced = True  # whether the path of the current file was told
        self._told_error = ""
        self._dropped_before = 0  # messages, of files that are no longer current
        self._told_dropped = 0
        self._losing = False
        self._paths: dict[int, Path] = {}  # by file number, as far as they are known

    def open(self, now_ns: int) -> None:
        """Start the first file; raises InputError when it cannot be created."""
        path = self._name(0)
        try:
            self._start(now_ns, wait=True)
        except FileExistsError:
            raise InputError(f"{path}: exists already, and a log is never overwritten") from None
        except OSError as error:
            raise InputError(f"{path}: cannot be created ({error.strerror or error})") from None

    @property
    def paths(self) -> list[Path]:
        """The files so far, in order."""
        return [path for _, path in sorted(self._paths.items())]

    @property
    def recording(self) -> bool:
        return self._current is not None

    @property
    def path(self) -> Path | None:
        """Of the file that is being written, once it is open."""
        return None if self._current is None else self._current.path

    @property
    def error(self) -> str:
        """Why the disk does not take data at the moment; empty when it does."""
        return "" if self._current is None else self._current.disk.error

    @property
    def dropped(self) -> int:
        """Messages that had to be left out."""
        return self._dropped_before + (self._current.dropped if self._current else 0)

    @property
    def _behind(self) -> bool:
        return self._current is not None and self._current.disk.backlog_bytes > BACKLOG_BYTES

    def write(self, samples: list[Sample], *, tick: int, now_ns: int) -> None:
        """Add a tick's messages; nothing happens while there is no file."""
        if self._current is not None:
            self._current.write(samples, tick=tick, now_ns=now_ns)

    def attend(self, now_ns: int, *, wanted: bool = True, new_file: bool = False) -> list[Event]:
        """Once a tick: open, change or close the file as it is due; what a person should know of it.

        wanted: whether there should be a recording at all. new_file: somebody asks for a new one.
        """
        current, wanted = self._current, wanted and self._keeper.room
        if current is None:
            if wanted:
                self._start(now_ns)
        elif not wanted:
            self._retire()
        elif current.disk.broken or current.disk.failing_s > self._patience_s:
            self._replace(now_ns)
        elif current.ticks and (new_file or self._long_enough(current, now_ns)):
            self._retire()
            self._start(now_ns)
        for number, recorder in list(self._closing.items()):
            self._note(number, recorder)
            if recorder.disk.done:
                del self._closing[number]
        return self._keeper.events() + self._events()

    def close(self) -> str:
        """Finish the file and wait for the disk; why the end of the log may be missing, or nothing."""
        self._keeper.stop()
        if self._current is not None:
            self._retire()
        error = ""
        deadline_s = time.monotonic() + CLOSE_WITHIN_S
        for number, recorder in self._closing.items():
            recorder.disk.close(max(0.1, deadline_s - time.monotonic()))
            self._note(number, recorder)
            error = error or recorder.disk.error
        return error

    def _start(self, now_ns: int, *, wait: bool = False) -> None:
        first = self._attempts

        def name(taken: int) -> Path:
            self._attempts = max(self._attempts, first + taken + 1)
            return self._name(first + taken)

        recorder = Recorder(name, offset_ns=self._offset_ns, wait=wait, compressor=self._compressor)
        self._attempts = max(self._attempts, first + 1)
        self._begin(recorder, self._files, now_ns, self._previous)
        self._current, self._files, self._began_ns, self._announced = recorder, self._files + 1, now_ns, False

    def _retire(self) -> None:
        assert self._current is not None
        self._current.finish()
        self._closing[self._files - 1] = self._current
        self._leave()

    def _replace(self, now_ns: int) -> None:
        """Leave a file that cannot be continued, and take what did not reach the disk to a new one."""
        failed = self._current
        assert failed is not None
        self._leave()
        self._start(now_ns)
        assert self._current is not None
        self._current.take_over(failed)
        failed.disk.give_up()
        self._patience_s = min(BACK_OFF * self._patience_s, LONGEST_S)

    def _leave(self) -> None:
        assert self._current is not None
        self._note(self._files - 1, self._current)
        self._previous = self._current.path
        self._dropped_before += self._current.dropped
        self._current = None

    def _long_enough(self, current: Recorder, now_ns: int) -> bool:
        return now_ns - self._began_ns >= self._limits.duration_ns or current.log.size_bytes >= self._limits.size_bytes

    def _note(self, number: int, recorder: Recorder) -> None:
        if recorder.path is not None:
            self._paths[number] = recorder.path

    def _events(self) -> list[Event]:
        events = []
        error, before = self.error, self._told_error
        if self.path is not None and not self._announced:
            self._announced = True
            self._paths[self._files - 1] = self.path
            events.append(_event("info", f"recording {self.path}"))
        if error and not before:
            events.append(_event("error", f"cannot write the log, keeping it in memory: {error}"))
        if self.dropped > self._told_dropped and not self._losing:
            self._losing = True
            events.append(_event("error", "the disk does not keep up and memory is full: messages are being lost"))
        if (before or self._losing) and not error and not self._behind:
            lost = self.dropped - self._told_dropped
            self._losing, self._told_dropped, self._patience_s = False, self.dropped, GIVE_UP_AFTER_S
            text = f"{lost} messages were lost" if lost else "nothing was lost"
            events.append(_event("info", f"the log is being written again, {text}"))
        self._told_error = error
        return events


def _event(severity: str, text: str) -> Event:
    return Event(severity=severity, sensor="daq", text=text)


def numbered(directory: Path) -> Callable[[int], Path]:
    """Names log-NNNN.mcap past whatever is there. Raises InputError when the directory cannot be made or read."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        # Also what somebody is about to rename or copy counts: log-0007.mcap.part
        taken = [number_of(Path(path.name.partition(".mcap")[0] + ".mcap")) for path in directory.glob("log-*.mcap*")]
    except OSError as error:
        raise InputError(f"{directory}: cannot be used for logs ({error.strerror or error})") from None
    first = max(taken, default=0) + 1
    return lambda number: directory / f"log-{max(first, 1) + number:04d}.mcap"


def parts_of(path: Path) -> Callable[[int], Path]:
    """Names for a recording whose first file has a name of its own: log.mcap, log-part2.mcap, …"""
    return lambda number: path if number == 0 else path.with_name(f"{path.stem}-part{number + 1}{path.suffix}")
