"""Completes unfinished logs while the daemon records, in a separate process with low priority and limited resources.

Run as a program with the paths of logs, this module completes them in order, and prints a line of JSON for each: the
event, or null. If the process dies while completing a log, another process continues after that log.
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
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import NoReturn

import msgspec

from flightpower.daq.log_recovery import failure_event, recovery_event, unfinished_logs
from flightpower.flight.messages import Event

MEMORY_BYTES = 512 * 2**20  # limit of address space; the libraries take half of it
CPU_S = 120  # limit for each log; an hour of the default tray takes 0.65 s on a fast processor
NICE = 10
LOGS_PER_PROCESS = 100  # paths in a command line; starting a process takes as long as completing a log of some minutes
PAUSE_S = 0.002  # pause between two files that are only inspected
IOPRIO_SET = {"x86_64": 251, "aarch64": 30, "armv7l": 314, "armv6l": 314}  # number of the system call, by machine
IOPRIO_WHO_PROCESS, IOPRIO_CLASS_IDLE = 1, 3 << 13  # linux/ioprio.h


class Recovery:
    """Completes the unfinished logs among `paths`, in order. This class does it in `start`, in the caller's thread."""

    def __init__(self, paths: Iterable[Path]):
        self._paths = list(paths)
        self._events: deque[Event] = deque()

    def start(self) -> None:
        for path in unfinished_logs(self._paths):
            self._report(recovery_event(path))

    def stop(self) -> None:
        """End at once. The next start of the daemon completes the remaining logs."""

    def events(self) -> list[Event]:
        """The events since the last call."""
        return [self._events.popleft() for _ in range(len(self._events))]

    def _report(self, event: Event | None) -> None:
        if event is not None:
            self._events.append(event)


class BackgroundRecovery(Recovery):
    """Recovery during the recording, by a thread that starts processes and waits for them."""

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
        unfinished: list[Path] = []
        for path in self._paths:
            unfinished += unfinished_logs([path])
            if self._stopped.wait(PAUSE_S):
                return
        while unfinished and not self._stopped.is_set():
            some, unfinished = unfinished[:LOGS_PER_PROCESS], unfinished[LOGS_PER_PROCESS:]
            unfinished = some[self._complete(some) :] + unfinished

    def _complete(self, paths: list[Path]) -> int:
        """Run a process for the logs, and report its output and how it ended. Returns the number of logs dealt with."""
        done = 0

        def report(line: bytes) -> None:
            nonlocal done
            done += 1
            self._report(msgspec.json.decode(line, type=Event | None))

        try:
            status = self._run([sys.executable, "-m", __name__, *map(str, paths)], report)
        except OSError as error:
            self._report(failure_event(paths[0], f"no process can be started: {error.strerror}"))
            return 1
        if self._stopped.is_set() or done == len(paths):
            return len(paths)
        cause = f"signal {-status}" if status < 0 else f"exit code {status}"
        self._report(failure_event(paths[done], f"the process that completes it ended with {cause}"))
        return done + 1

    def _run(self, command: list[str], on_line: Callable[[bytes], None]) -> int:
        """Run a process that never has real-time priority. Returns its exit status. on_line: gets each line."""
        read_end, write_end = os.pipe2(os.O_CLOEXEC)
        with os.fdopen(read_end, "rb") as output:
            try:
                with self._lock:
                    if self._stopped.is_set():
                        return 0
                    self._process_id = os.posix_spawn(
                        command[0],
                        command,
                        os.environ,
                        file_actions=[(os.POSIX_SPAWN_DUP2, write_end, 1)],
                        setpgroup=0,  # keeps Ctrl-C, which is meant for the daemon, from the process
                        scheduler=(os.SCHED_OTHER, os.sched_param(0)),
                    )
            finally:
                os.close(write_end)
            for line in output:
                if line.endswith(b"\n"):
                    on_line(line)
        # Reaped under the lock only after it has ended, so that `stop` cannot kill another process of the same number.
        os.waitid(os.P_PID, self._process_id, os.WEXITED | os.WNOWAIT)
        with self._lock:
            _, status = os.waitpid(self._process_id, 0)
            self._process_id = 0
        return os.waitstatus_to_exitcode(status)


def yield_to_others() -> None:
    """Use the disk only when nothing else does, and only about a tenth of a processor that other programs want.

    SCHED_IDLE is not used: with two busy programs, its share of 0.3 % takes a quarter of a minute for a log.
    """
    with suppress(PermissionError):  # logs are completed even if a sandbox forbids this
        os.nice(NICE)
    if platform.machine() in IOPRIO_SET:
        ctypes.CDLL(None).syscall(IOPRIO_SET[platform.machine()], IOPRIO_WHO_PROCESS, 0, IOPRIO_CLASS_IDLE)


def limit_resources(logs: int) -> None:
    """Limit memory and time: exceeding them raises MemoryError or TimeoutError. logs: number of logs to complete."""

    def out_of_time(number: int, frame: FrameType | None) -> NoReturn:
        raise TimeoutError(f"it takes more than {CPU_S} s of the processor, the limit")

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    signal.signal(signal.SIGXCPU, out_of_time)
    hard_s = math.ceil(time.process_time()) + logs * (CPU_S + 5)
    resource.setrlimit(resource.RLIMIT_CPU, (hard_s, hard_s))


def allow_time_for_a_log() -> None:
    """Restart the time allowed: exceeding it from now on raises TimeoutError."""
    _, hard_s = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (min(math.ceil(time.process_time()) + CPU_S, hard_s), hard_s))


def main() -> None:
    paths = sys.argv[1:]
    yield_to_others()
    limit_resources(len(paths))
    for path in paths:
        allow_time_for_a_log()
        print(msgspec.json.encode(recovery_event(Path(path))).decode(), flush=True)


if __name__ == "__main__":
    main()
