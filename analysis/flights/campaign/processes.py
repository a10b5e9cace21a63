"""One analysis among many, and its outcome; also runs many of them on the processors of this computer."""

import multiprocessing
import multiprocessing.forkserver
import os
import signal
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from flightpower.analysis.flights.campaign.addresses import Log, as_file, name_by_address
from flightpower.analysis.flights.campaign.settings import CAMPAIGN
from flightpower.flight.errors import InputError, StorageError
from flightpower.flight.files import write_files

Progress = Callable[[str], None]


class Analyze(Protocol):
    """The analysis of one log: writes its results into `folder`. It is pickled to reach other processes.

    Raises InputError when the log cannot be used.
    """

    def __call__(self, log: Path, folder: Path, runs: Path | None, progress: Progress) -> None: ...

    def under(self, root: Path) -> "Analyze":
        """Return this analysis with its files read from the same paths below `root`."""
        ...


@dataclass(frozen=True)
class Job:
    """An analysis to be run. name: of its folder. runs: an edited list of runs. files: other files that it reads."""

    name: str
    log: Log
    runs: Path | None = None
    files: tuple[Path, ...] = ()


class Outcome(NamedTuple):
    """How a job ended: elapsed and processor time, peak memory of its process, and one line if it failed.

    digest: SHA-256 of a log that was at an address. storage: whether it failed because nothing more can be written.
    """

    error: str = ""
    seconds: float = 0.0
    processor_seconds: float = 0.0
    peak_bytes: int = 0
    digest: str = ""
    storage: bool = False


def run_job(analyze: Analyze, job: Job, folder: Path, progress: Progress) -> Outcome:
    """Run one job in this process, which runs nothing else, and limit the memory of the process. Never raises."""
    start, processor_start = time.monotonic(), time.process_time()
    limit_memory(round(CAMPAIGN.memory_GB * 2**30))
    error, digest, storage = "", "", False
    try:
        with as_file(job.log, folder) as (log, digest):
            analyze(log, folder, job.runs, progress)
            name_by_address(folder, log, job.log)
    except InputError as cause:
        error, storage = str(cause), isinstance(cause, StorageError)
    except MemoryError:
        error = f"{job.log}: needs more than {CAMPAIGN.memory_GB:.0f} GB of memory; analyze it alone"
    except BaseException as cause:
        where = traceback.extract_tb(cause.__traceback__)[-1]
        error = (
            f"{job.log}: {type(cause).__name__}: {cause} ({Path(where.filename).name}:{where.lineno}), an error of the"
            " software; analyze it alone for the details, and report it"
        )
    seconds, processor_seconds = time.monotonic() - start, time.process_time() - processor_start
    return Outcome(" ".join(error.splitlines()), seconds, processor_seconds, peak_bytes(), digest, storage)


def below(root: Path, path: Path) -> Path:
    """Move an absolute path below `root`; keep a relative one, for a process that works below `root`."""
    return root / path.relative_to(path.anchor) if path.is_absolute() else path


def limit_memory(limit_bytes: int) -> None:
    """Limit the memory of this process: allocations beyond the limit raise MemoryError. Works on Linux only."""
    if sys.platform == "linux":
        import resource

        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        most = limit_bytes if hard == resource.RLIM_INFINITY else min(limit_bytes, hard)
        resource.setrlimit(resource.RLIMIT_DATA, (most, hard))


def peak_bytes() -> int:
    """Return the peak memory of this process in bytes; 0 if the system does not report it."""
    if os.name != "posix":
        return 0
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


class Returned(NamedTuple):
    """The result of a job. files: the flight's files by name, if the job could not write them itself."""

    outcome: Outcome
    files: Mapping[str, bytes] = {}


class Computers(NamedTuple):
    """Where jobs run. submit: starts a job that writes into a folder. at_once: how many jobs keep them busy."""

    submit: Callable[[Job, Path], "Future[Returned]"]
    at_once: Callable[[], int]


def run_jobs(
    jobs: Iterable[Job], computers: Computers, new_folder: Callable[[str], Path]
) -> Iterator[tuple[Job, Path, Outcome]]:
    """Run jobs, and yield each with its folder when it ends. new_folder: makes the results folder of a job by its name.

    Only as many jobs are started as keep the computers busy, so that waiting jobs need no memory.
    """
    waiting, running = deque(jobs), dict[Future[Returned], tuple[Job, Path]]()
    while waiting or running:
        while waiting and len(running) < computers.at_once():
            job = waiting.popleft()
            folder = new_folder(job.name)
            try:
                running[computers.submit(job, folder)] = job, folder
            except OSError as error:  # the log existed a moment ago
                yield job, folder, Outcome(f"{job.log}: could not be read ({error.strerror or error})")
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            job, folder = running.pop(future)
            yield job, folder, _outcome(future, job, folder)


def _outcome(future: "Future[Returned]", job: Job, folder: Path) -> Outcome:
    try:
        outcome, files = future.result()
    except (Exception, CancelledError) as error:
        return Outcome(f"{job.log}: could not be analyzed ({type(error).__name__}: {error})".splitlines()[0])
    write_files({folder / name: content for name, content in files.items()})
    return outcome


START_METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"


def load_ahead(modules: Sequence[str]) -> None:
    """Start loading the modules that all jobs need, once for all of them, and return without waiting."""
    if START_METHOD == "forkserver":
        multiprocessing.set_forkserver_preload(list(modules))
        multiprocessing.forkserver.ensure_running()


@contextmanager
def processors(analyze: Analyze, count: int, step: Callable[[Job, str], None]) -> Iterator[Computers]:
    """Yield this computer: `count` threads, each of which waits for the process of one job.

    A ProcessPoolExecutor would not do: there, a process that dies breaks the whole pool and fails all other jobs.
    step: called with each step of a job. Jobs that are still running at the end are killed.
    """
    processes = OwnProcesses(analyze, step)
    with ThreadPoolExecutor(count) as threads:
        try:
            yield Computers(lambda job, folder: threads.submit(processes.run, job, folder), lambda: count)
        finally:
            processes.kill()


class OwnProcesses:
    """Runs each job in its own process, so that memory does not grow and a crash affects only one job."""

    def __init__(self, analyze: Analyze, step: Callable[[Job, str], None]):
        self._analyze, self._step = analyze, step
        self._context: Any = multiprocessing.get_context(START_METHOD)
        self._lock, self._ended, self._running = threading.Lock(), False, set[Any]()

    def run(self, job: Job, folder: Path) -> Returned:
        """Start the process of a job, and wait for its end."""
        receiver, sender = self._context.Pipe(duplex=False)
        process = self._context.Process(target=_in_process, args=(self._analyze, job, folder, sender), daemon=True)
        with self._lock:  # starting a process checks all others, which is not thread-safe
            if self._ended:
                raise CancelledError
            process.start()
            self._running.add(process)
        sender.close()
        with receiver:
            while isinstance(message := _received(receiver), str):
                self._step(job, message)
        with self._lock:
            process.join()
            self._running.discard(process)
        return Returned(message or Outcome(f"{job.log}: {_death(process.exitcode)}"))

    def kill(self) -> None:
        """Kill all running jobs, and start no more."""
        with self._lock:
            self._ended = True
            for process in self._running:
                process.kill()


def _in_process(analyze: Analyze, job: Job, folder: Path, sender: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent process
    # If the parent was killed, sending fails, and this process ends.
    outcome = run_job(analyze, job, folder, sender.send)
    with suppress(OSError):
        sender.send(outcome)


def _received(receiver: Connection) -> Any:
    """Return a step, an outcome, or None when the process ended without sending either."""
    try:
        return receiver.recv()
    except (EOFError, OSError):
        return None


def _death(exit_code: int | None) -> str:
    if exit_code is not None and exit_code < 0:
        name = signal.Signals(-exit_code).name
        return f"its process was ended by {name}; is there enough memory? Analyze it alone"
    return f"its process ended with exit code {exit_code}; analyze it alone"
