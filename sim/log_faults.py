"""Faults of real logs: dropouts, a clock that is set, a late start, no thermometer, several sensors, old formats."""

from collections.abc import Collection, Sequence
from typing import NamedTuple, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

FAULTS = (
    "landed", "wrong-battery-first", "pressure-offset", "dropouts", "clock-jump", "airborne-start", "appended",
    "truncated", "no-airspeed", "no-thermometer", "second-airspeed", "old-firmware", "hover", "two-packs", "esc-power",
    "dead-meter", "no-gps",
)  # fmt: skip
LONGEST_DROPOUT_MS, DROPOUTS = 4000, 12
CLOCK_SET_US, CLOCK_SET_AT = 3_600_000_000, 0.15  # by how much, and when as a fraction of the flight
TRUNCATED_TO = 0.7  # remaining fraction of the file
DEAD_A = 3.0  # reading of a current sensor that is not connected to the motor
HOVER_AT, HOVER_A = (0.3, 0.42), 25.0  # when a VTOL's lifting motors help, as fractions of the flight; their current


def lifted(t_s: NDArray[np.float64], duration_s: float, faults: Collection[str]) -> NDArray[np.bool_]:
    """Whether the lifting motors run, at times (n,) since the beginning."""
    share = t_s / duration_s
    return np.asarray((share >= HOVER_AT[0]) & (share < HOVER_AT[1]) & ("hover" in faults))


class Dropout(NamedTuple):
    time_us: int
    duration_ms: int


class Timed(Protocol):
    """Messages of one kind."""

    @property
    def time_us(self) -> NDArray[np.uint64]: ...

    def selected(self, selection: NDArray[np.bool_]) -> Self: ...

    def at(self, time_us: NDArray[np.uint64]) -> Self: ...


Messages = TypeVar("Messages", bound=Timed)


def with_dropouts(kinds: Sequence[Messages], seed: int) -> tuple[list[Messages], list[Dropout]]:
    """Remove the messages in gaps of up to LONGEST_DROPOUT_MS at random times. Also returns the gaps."""
    rng = np.random.default_rng(seed)
    first, last = (int(extreme(int(extreme(messages.time_us)) for messages in kinds)) for extreme in (min, max))
    gaps = [
        Dropout(int(rng.integers(first, last)), int(rng.integers(100, LONGEST_DROPOUT_MS))) for _ in range(DROPOUTS)
    ]
    left = list(kinds)
    for gap in gaps:
        left = [without(messages, gap.time_us, gap.time_us + 1000 * gap.duration_ms) for messages in left]
    return left, gaps


def begun_at(kinds: Sequence[Messages], time_us: int) -> list[Messages]:
    return [without(messages, 0, time_us) for messages in kinds]


def with_clock_set(kinds: Sequence[Messages], at_us: int, by_us: int) -> list[Messages]:
    """Set the messages' clock forward by `by_us` at `at_us`."""
    return [
        messages.at(messages.time_us + np.where(messages.time_us >= at_us, by_us, 0).astype(np.uint64))
        for messages in kinds
    ]


def without(messages: Messages, start_us: int, end_us: int) -> Messages:
    """Remove the messages from start_us up to, but not including, end_us."""
    return messages.selected((messages.time_us < start_us) | (messages.time_us >= end_us))
