"""Jobs on the processors of this computer: a process for each, so that memory stays flat and a crash costs one job."""

import multiprocessing
import multiprocessing.forkserver
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, NamedTuple

from analysis.campaign.jobs import Analyze, Job, Outcome, run_job

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
        return f"its process was ended by {name}; is there enough memory? Analyse it alone"
    return f"its process ended with exit code {exit_code}; analyse it alone"
