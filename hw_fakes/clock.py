"""A simulated clock, with which a flight is recorded in seconds."""


class SimulatedClock:
    """A clock whose time passes only in `sleep_until_ns` and `advance_ns` (which a bus transfer calls).

    Satisfies `daq.clock.Clock`.

    start_ns: monotonic time at the start [ns].
    unix_at_start_ns: the system's Unix time at the start, right or wrong [ns].
    """

    def __init__(self, start_ns: int = 0, unix_at_start_ns: int = 0):
        self._now_ns = start_ns
        self._unix_offset_ns = unix_at_start_ns - start_ns

    def now_ns(self) -> int:
        return self._now_ns

    def sleep_until_ns(self, due_ns: int) -> None:
        self._now_ns = max(self._now_ns, due_ns)

    def advance_ns(self, duration_ns: int) -> None:
        """Let `duration_ns` [ns] pass."""
        self._now_ns += duration_ns

    def unix_ns(self) -> int:
        return self._now_ns + self._unix_offset_ns

    def set_unix_ns(self, unix_ns: int) -> None:
        """Set the system's Unix time, as NTP does on a Pi without a real-time clock."""
        self._unix_offset_ns = unix_ns - self._now_ns
