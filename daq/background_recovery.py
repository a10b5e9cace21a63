"""Completes unfinished logs while the daemon records: each in a process of its own, with low priority and limits.

Run as a program with the path of a log, this module completes that log and prints the event as a line of JSON.
"""

import ctypes
import math
import os
import platform
import resource
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Iterable
from pathlib import Path
from types import FrameType
from typing import NoReturn

import msgspec

from daq.log_recovery import failure_event, recovery_event, unfinished_logs
from flight.messages import Event

MEMORY_BYTES = 512 * 2**20  # of address space; the libraries take half of it
CPU_S = 120  # an hour of the default tray takes 0.65 s on a fast processor
PAUSE_S = 0.002  # between two files that are only looked at
IOPRIO_SET = {"x86_64": 251, "aarch64": 30, "armv7l": 314, "armv6l": 314}  # numbers of the system call
IOPRIO_WHO_PROCESS, IOPRIO_CLASS_IDLE = 1, 3 << 13  # linux/ioprio.h


class Recovery:
    """Completes the unfinished ones of `paths`, in order. This class does so in the caller's thread, in `start`."""

    def __init__(self, paths: Iterable[Path]):
        self._paths = list(paths)
        self._events: deque[Event] = deque()

    def start(self) -> None:
        for path in unfinished_logs(self._paths):
            self._report(recovery_event(path))

    def stop(self) -> None:
        """End at once. The next start completes what is left."""

    def events(self) -> list[Event]:
        """The events since the last call."""
        return [self._events.popleft() for _ in range(len(self._events))]

    def _report(self, event: Event | None) -> None:
        if event is not None:
            self._events.append(event)


class BackgroundRecovery(Recovery):
    """Recovery beside the recording: a thread that waits for processes."""

    def __init__(self, paths: Iterable[Path]):
        super().__init__(paths)
        self._stopped = threading.Event()
        self._lock = threading.Lock()  # held while a process is started or ended
        self._process_id = 0
        self._thread = threading.Thread(target=self._work, name="recovery", daemon=True)

    def start(self) -> None:
        if self._paths:
            self._thread.start()

    def stop(self) -> None:
        self._stopped.set()
        with self._lock:
            if self._process_id:
                os.kill(self._process_id, signal.SIGKILL)

    def _work(self) -> None:
        for path in self._paths:
            if any(unfinished_logs([path])):
                self._complete(path)
            if self._stopped.wait(PAUSE_S):
                return

    def _complete(self, path: Path) -> None:
        """Run the process for one log and report what it prints, or how it ended."""
        try:
            line, status = self._run([sys.executable, "-m", __name__, str(path)])
        except OSError as error:
            self._report(failure_event(path, f"no process can be started: {error.strerror}"))
            return
        if self._stopped.is_set():
            return
        if status:
            cause = f"signal {-status}" if status < 0 else f"exit code {status}"
            self._report(failure_event(path, f"the process that completes it ended with {cause}"))
        elif line:
            self._report(msgspec.json.decode(line, type=Event))

    def _run(self, command: list[str]) -> tuple[bytes, int]:
        """The output and exit status of a process that has no real-time priority from its first instruction."""
        read_end, write_end = os.pipe2(os.O_CLOEXEC)
        with os.fdopen(read_end, "rb") as output:
            try:
                with self._lock:
                    if self._stopped.is_set():
                        return b"", 0
                    self._process_id = os.posix_spawn(
                        command[0],
                        command,
                        os.environ,
                        file_actions=[(os.POSIX_SPAWN_DUP2, write_end, 1)],
                        setpgroup=0,  # Ctrl-C is for the daemon
                        scheduler=(os.SCHED_OTHER, os.sched_param(0)),
                    )
            finally:
                os.close(write_end)
            line = output.read()
        # Reaped under the lock only after it has ended, so that `stop` cannot kill another process of the same number.
        os.waitid(os.P_PID, self._process_id, os.WEXITED | os.WNOWAIT)
        with self._lock:
            _, status = os.waitpid(self._process_id, 0)
            self._process_id = 0
        return line, os.waitstatus_to_exitcode(status)


def yield_to_others() -> None:
    """Use processor and disk only when nothing else does."""
    try:
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    except OSError:
        pass
    if platform.machine() in IOPRIO_SET:
        ctypes.CDLL(None).syscall(IOPRIO_SET[platform.machine()], IOPRIO_WHO_PROCESS, 0, IOPRIO_CLASS_IDLE)


def limit_resources() -> None:
    """Exceeding a limit raises MemoryError or TimeoutError."""

    def out_of_time(number: int, frame: FrameType | None) -> NoReturn:
        raise TimeoutError(f"it takes more than {CPU_S} s of the processor, the limit")

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    signal.signal(signal.SIGXCPU, out_of_time)
    limit_s = math.ceil(time.process_time()) + CPU_S
    resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s + 5))


def main() -> None:
    yield_to_others()
    limit_resources()
    event = recovery_event(Path(sys.argv[1]))
    if event is not None:
        sys.stdout.buffer.write(msgspec.json.encode(event))


if __name__ == "__main__":
    main()
