"""Sets up the daemon's process for low latency."""

import ctypes
import gc
import os
import sys
import threading
from pathlib import Path

THREAD_STACK_BYTES = 512 * 1024
UNIT_PRIORITY = 50  # CPUSchedulingPriority in systemd/flightpower-daq.service
SWITCH_S = 0.001  # the sampling thread waits at most this long for another computing thread
M_MMAP_THRESHOLD, M_ARENA_MAX = -3, -8  # malloc.h
LARGE_BYTES = 128 * 1024
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4  # sys/mman.h; ONFAULT locks pages when they are first used

REAL_TIME = tuple(getattr(os, name) for name in ("SCHED_FIFO", "SCHED_RR") if hasattr(os, name))
PROCESSORS: set[int] = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()


def prepare_process() -> None:
    """Set up for low latency: no garbage collection of permanent objects, locked memory, small thread stacks."""
    gc.collect()
    gc.freeze()
    threading.stack_size(THREAD_STACK_BYTES)  # the whole stack of a thread is locked in memory
    sys.setswitchinterval(SWITCH_S)
    libc = ctypes.CDLL(None)
    if hasattr(libc, "mallopt"):  # only glibc has it
        libc.mallopt(M_ARENA_MAX, 1)  # one heap for all threads, instead of a growing heap for each
        # Large blocks are returned to the system when freed; by default, glibc keeps larger and larger ones.
        libc.mallopt(M_MMAP_THRESHOLD, LARGE_BYTES)
    # Fails without the permission (LimitMEMLOCK); then memory is not locked.
    libc.mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT)


def raise_priority() -> None:
    """Use the real-time priority that the systemd unit gives to `run`, if permitted.

    Without this priority, other programs' load can look like a hanging bus.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(UNIT_PRIORITY))
    except OSError:
        return


def use_one_processor() -> bool:
    """Pin the calling thread, and threads it starts later, to one processor. Returns whether that was done.

    Python computes in one thread at a time. On one processor the threads take turns without waking another processor;
    this saves a fifth of the daemon's processor time. This is done only with real-time priority, since another
    program's load on that processor would otherwise delay the threads. The last processor is used, because a Pi handles
    interrupts on the first.
    """
    try:
        if os.sched_getscheduler(0) not in REAL_TIME:
            return False
        os.sched_setaffinity(0, {max(PROCESSORS)})
    except OSError:
        return False
    return True


def use_every_processor(*, whole_process: bool) -> None:
    """Undo `use_one_processor`, for the calling thread or for all threads."""
    tasks = [int(task.name) for task in Path("/proc/self/task").iterdir()] if whole_process else [0]
    for task in tasks:
        try:
            os.sched_setaffinity(task, PROCESSORS)
        except OSError:  # the thread has ended
            continue


def computes_while_it_waits(device: str) -> bool:
    """Whether the processor itself drives the bus (i2c-gpio), so that nothing else can use it during a transfer."""
    adapter = Path("/sys/bus/i2c/devices", Path(device).resolve().name).resolve()
    return (adapter.parent / "driver").resolve().name == "i2c-gpio"
