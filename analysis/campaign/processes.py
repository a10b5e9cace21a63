"""One analysis among many, and how it ended.

Jobs on the processors of this computer: a process for each, so that memory stays flat and a crash costs one job.
"""

import multiprocessing
import multiprocessing.forkserver
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from flight.errors import InputError

Progress = Callable[[str], None]

MEMORY_LIMIT_BYTES = 4 * 2**30  # of one analysis; a flight of two hours takes a quarter of it


class Analyze(Protocol):
    """The analysis of one log: writes its results into `folder`. It is pickled to reach other processes.

    Raises InputError when the log cannot be used.
    """

    def __call__(self, log: Path, folder: Path, runs: Path | None, progress: Progress) -> None: ...

    def under(self, root: Path) -> "Analyze":
        """The same where the files that it reads were copied to the same paths below `root`."""
        ...


@dataclass(frozen=True)
class Job:
    """An analysis to be run. name: of its folder. runs: an edited list of runs. files: others that it reads."""

    name: str
    log: Path
    runs: Path | None = None
    files: tuple[Path, ...] = ()


class Outcome(NamedTuple):
    """How a job ended: elapsed and processor time, the most memory of its process, and one line where it failed."""

    error: str = ""
    seconds: float = 0.0
    processor_seconds: float = 0.0
    peak_bytes: int = 0


def run_job(analyze: Analyze, job: Job, folder: Path, progress: Progress) -> Outcome:
    """Run one job in this process, which is its own: the memory of the process is limited. Never raises."""
    start, processor_start = time.monotonic(), time.process_time()
    limit_memory(MEMORY_LIMIT_BYTES)
    error = ""
    try:
        analyze(job.log, folder, job.runs, progress)
    except InputError as cause:
        error = str(cause)
    except MemoryError:
        error = f"{job.log}: needs more than {MEMORY_LIMIT_BYTES / 2**30:.0f} GB of memory; analyze it alone"
    except BaseException as cause:
        where = traceback.extract_tb(cause.__traceback__)[-1]
        error = (
            f"{job.log}: {type(cause).__name__}: {cause} ({Path(where.filename).name}:{where.lineno}), an error of the"
            " software; analyze it alone for the details, and report it"
        )
    seconds, processor_seconds = time.monotonic() - start, time.process_time() - processor_start
    return Outcome(" ".join(error.splitlines()), seconds, processor_seconds, peak_bytes())


def below(root: Path, path: Path) -> Path:
    """An absolute path below `root`; a relative one as it is, for a process that works below `root`."""
    return root / path.relative_to(path.anchor) if path.is_absolute() else path


def limit_memory(limit_bytes: int) -> None:
    """Allocations of this process beyond the limit raise MemoryError. On Linux only."""
    if sys.platform == "linux":
        import resource

        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        most = limit_bytes if hard == resource.RLIM_INFINITY else min(limit_bytes, hard)
        resource.setrlimit(resource.RLIMIT_DATA, (most, hard))


def peak_bytes() -> int:
    """The most memory that this process had; 0 where the system does not say."""
    if os.name != "posix":
        return 0
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


START_METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"


class Running(NamedTuple):
    job: Job
    folder: Path
    process: Any


def load_ahead(modules: Sequence[str]) -> None:
    """Begin to load modules that all jobs need, once for all of them, and return meanwhile."""
    if START_METHOD == "forkserver":
        multiprocessing.set_forkserver_preload(list(modules))
        multiprocessing.forkserver.ensure_running()


def run_on_processors(
    jobs: Sequence[Job],
    analyze: Analyze,
    count: int,
    new_folder: Callable[[str], Path],
    progress: Callable[[Job, str], None],
) -> Iterator[tuple[Job, Path, Outcome]]:
    """Run jobs, `count` at a time; yields each with its folder when it ends.

    new_folder: by name, the folder that a job writes into.
    """
    context: Any = multiprocessing.get_context(START_METHOD)
    waiting, running = list(reversed(jobs)), dict[Connection, Running]()
    try:
        while waiting or running:
            while waiting and len(running) < count:
                receiver, started = _start(context, analyze, waiting.pop(), new_folder)
                running[receiver] = started
            ready: Any = wait(list(running))
            for receiver in ready:
                job, folder, process = running[receiver]
                message = _received(receiver)
                if isinstance(message, str):
                    progress(job, message)
                    continue
                del running[receiver]
                receiver.close()
                process.join()
                yield job, folder, message or Outcome(f"{job.log}: {_death(process.exitcode)}")
    finally:
        for _, _, process in running.values():
            process.kill()


def _start(context: Any, analyze: Analyze, job: Job, new_folder: Callable[[str], Path]) -> tuple[Connection, Running]:
    receiver, sender = context.Pipe(duplex=False)
    folder = new_folder(job.name)
    process = context.Process(target=_in_process, args=(analyze, job, folder, sender), daemon=True)
    process.start()
    sender.close()
    return receiver, Running(job, folder, process)


def _in_process(analyze: Analyze, job: Job, folder: Path, sender: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that waits for this one
    # Where that process was killed, sending fails, and this one ends.
    outcome = run_job(analyze, job, folder, sender.send)
    with suppress(OSError):
        sender.send(outcome)


def _received(receiver: Connection) -> Any:
    """A step, an outcome, or None when the process ended without one."""
    try:
        return receiver.recv()
    except (EOFError, OSError):
        return None


def _death(exit_code: int | None) -> str:
    if exit_code is not None and exit_code < 0:
        name = signal.Signals(-exit_code).name
        return f"its process was ended by {name}; is there enough memory? Analyze it alone"
    return f"its process ended with exit code {exit_code}; analyze it alone"
