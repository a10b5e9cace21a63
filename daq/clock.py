"""Time as the loop sees it: a monotonic count of nanoseconds, and a way to wait for a point on it."""

import time
from typing import Protocol


class Clock(Protocol):
    """What the loop needs of a clock. A simulated one waits in no time."""

    def now_ns(self) -> int:
        """Monotonic time [ns]; its zero means nothing."""

    def sleep_until_ns(self, due_ns: int) -> None:
        """Return at `due_ns`, at once if that has passed."""

    def unix_ns(self) -> int:
        """The system's idea of Unix time [ns]; may be wrong and may jump."""


class SystemClock:
    """CLOCK_MONOTONIC and CLOCK_REALTIME."""

    def now_ns(self) -> int:
        return time.monotonic_ns()

    def sleep_until_ns(self, due_ns: int) -> None:
        # time.sleep restarts after a signal and never returns early (PEP 475); lateness is the kernel's.
        remaining_ns = due_ns - time.monotonic_ns()
        if remaining_ns > 0:
            time.sleep(remaining_ns / 1e9)

    def unix_ns(self) -> int:
        return time.time_ns()
