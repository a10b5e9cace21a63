"""Run a computation in a process of its own, because an analysis has parts that do not depend on each other.

Threads would not help, because only one at a time holds the interpreter. The process is forked, so its data are already
in memory, and only its result is copied.
"""

import os
import sys
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

# The commands set this variable, because a user waits for them; a program that uses the library decides for itself.
PROCESSES = "FLIGHTPOWER_PROCESSES"

Result = TypeVar("Result")


def beside(compute: Callable[[], Result]) -> Callable[[], Result]:
    """Start a computation in another process; the function returned waits for its result, or raises its error.

    Without a second process the returned function itself computes. That is so if `PROCESSES` allows only one process,
    if there is only one processor, if processes cannot be forked safely, and in a child process or a second thread.
    """
    if not _has_second_process():
        return compute
    from multiprocessing import get_context

    context = get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(compute, sender, os.getpid()), daemon=True)
    process.start()
    sender.close()

    def result() -> Result:
        value: Result
        try:
            value, error = receiver.recv()
        except EOFError:  # the process was killed, perhaps because memory ran out
            return compute()
        finally:
            receiver.close()
            process.join()
        if error is not None:
            raise error
        return value

    return result


def _has_second_process() -> bool:
    processors = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else ()  # Linux, which forks safely
    if min(int(os.environ.get(PROCESSES, "1")), len(processors)) < 2:
        return False
    from multiprocessing import parent_process

    return parent_process() is None and threading.current_thread() is threading.main_thread()


PR_SET_PDEATHSIG = 1  # an option of prctl(2)


def _send(compute: Callable[[], Result], sender: "Connection", first_process: int) -> None:
    """Send the result or the error, then exit at once without the clean-up that the first process does at its own exit.

    If the first process ends earlier, this one is killed, which frees the files and ports that it inherited.
    """
    import ctypes
    import signal

    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != first_process:
        os._exit(0)
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it silently: the first process reports
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    sys.stderr = open(2, "w", closefd=False)  # noqa: SIM115 - a thread may hold the old lock
    try:
        try:
            outcome: tuple[Result | None, Exception | None] = compute(), None
        except Exception as error:  # raised where the result is requested
            outcome = None, error
        sender.send(outcome)
    finally:
        sys.stderr.flush()
        os._exit(0)
