"""A computation beside others, in a process of its own: an analysis has parts that need nothing of each other.

Threads would not do: neither leaves the other the interpreter. The process is forked, so that it finds its data where
they are, and only its result is copied.
"""

import os
import sys
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

# The commands set it, for a computer's user is waiting for them alone; a program that uses the library decides itself.
PROCESSES = "FLIGHTPOWER_PROCESSES"

Result = TypeVar("Result")


def beside(compute: Callable[[], Result]) -> Callable[[], Result]:
    """Start a computation in another process; the function returned waits for its result, or raises its error.

    Where there is no second process it computes at the time of that call: where `PROCESSES` allows one only, on a
    computer of one processor, where processes cannot be forked, or in a thread or process that is itself beside others.
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
        except EOFError:  # the process was killed, for want of memory, perhaps
            return compute()
        finally:
            receiver.close()
            process.join()
        if error is not None:
            raise error
        return value

    return result


def _has_second_process() -> bool:
    processors = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else ()  # of Linux, which forks safely
    if min(int(os.environ.get(PROCESSES, "1")), len(processors)) < 2:
        return False
    from multiprocessing import parent_process

    return parent_process() is None and threading.current_thread() is threading.main_thread()


PR_SET_PDEATHSIG = 1  # of prctl(2)


def _send(compute: Callable[[], Result], sender: "Connection", first_process: int) -> None:
    """Send the result or the error, and end at once: what the first process has yet to do at its end is its own.

    Where that ends before, this one is killed, with the files and the ports that it has of it.
    """
    import ctypes
    import signal

    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != first_process:
        os._exit(0)
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it without a word: the first process answers
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    sys.stderr = open(2, "w", closefd=False)  # noqa: SIM115 - a thread may hold the lock of the other one
    try:
        try:
            outcome: tuple[Result | None, Exception | None] = compute(), None
        except Exception as error:  # raised where the result is asked for
            outcome = None, error
        sender.send(outcome)
    finally:
        sys.stderr.flush()
        os._exit(0)
