"""Settings of the daemon's process for low latency."""

import ctypes
import gc
import os
import sys
import threading

THREAD_STACK_BYTES = 512 * 1024
UNIT_PRIORITY = 50  # CPUSchedulingPriority in systemd/flightpower-daq.service
SWITCH_S = 0.001  # the sampling thread waits at most this long for another computing thread
M_MMAP_THRESHOLD, M_ARENA_MAX = -3, -8  # malloc.h
LARGE_BYTES = 128 * 1024
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4  # sys/mman.h; ONFAULT locks pages when they are first used


def prepare_process() -> None:
    """Set up for low latency: no garbage collection of permanent objects, locked memory, small thread stacks."""
    gc.collect()
    gc.freeze()
    threading.stack_size(THREAD_STACK_BYTES)  # all of a thread's stack is locked in memory
    sys.setswitchinterval(SWITCH_S)
    libc = ctypes.CDLL(None)
    if hasattr(libc, "mallopt"):  # glibc
        libc.mallopt(M_ARENA_MAX, 1)  # one heap for all threads, instead of a growing one for each
        # Large blocks are returned to the system when freed; by default, glibc keeps larger and larger ones.
        libc.mallopt(M_MMAP_THRESHOLD, LARGE_BYTES)
    # Fails without the permission (LimitMEMLOCK); then memory is not locked.
    libc.mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT)


def raise_priority() -> None:
    """Use the real-time priority that the systemd unit gives to `run`, if permitted.

    Without it, other programs' load can look like a hanging bus.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(UNIT_PRIORITY))
    except OSError:
        return
