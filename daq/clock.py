"""The clock of the sampling loop: monotonic time in nanoseconds, and waiting for a point in time."""

import time
from typing import Protocol


class Clock(Protocol):
    """The clock functions that the sampling loop needs. A simulated clock advances instead of waiting."""

    def now_ns(self) -> int:
        """Monotonic time [ns], from an arbitrary zero."""

    def sleep_until_ns(self, due_ns: int) -> None:
        """Return at `due_ns`, or at once if that time has passed."""

    def unix_ns(self) -> int:
        """Unix time of the system clock [ns]; may be wrong and may jump."""


class SystemClock:
    """CLOCK_MONOTONIC and CLOCK_REALTIME."""

    def now_ns(self) -> int:
        return time.monotonic_ns()

    def sleep_until_ns(self, due_ns: int) -> None:
        # time.sleep resumes after a signal and never returns early (PEP 475).
        remaining_ns = due_ns - time.monotonic_ns()
        if remaining_ns > 0:
            time.sleep(remaining_ns / 1e9)

    def unix_ns(self) -> int:
        return time.time_ns()
