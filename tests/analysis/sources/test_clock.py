"""Reports of messages that come too often, too seldom, or in other units."""

import pytest

from flightpower.analysis.sources.structure import _wrong_interval


@pytest.mark.parametrize(
    ("interval_s", "text"),
    [
        (0.0, "most messages have the log_time of the one before; write each message's own, in nanoseconds"),
        (40e-9, "log_time is in milliseconds (40 between messages); write nanoseconds"),
        (40e-6, "log_time is in microseconds (40000 between messages); write nanoseconds"),
        (1e-9, "log_time is in seconds (1 between messages); write nanoseconds"),
        (2e-3, "500 messages a second are too many; average them to 25 a second (200 at most)"),
        (1.2e-3, "833 messages a second are too many; average them to 25 a second (200 at most)"),
        (2.5, "2.5 s between messages (by log_time, in nanoseconds); write 25 a second (1 at least)"),
    ],
)
def test_the_interval_tells_the_mistake(interval_s: float, text: str) -> None:
    assert _wrong_interval(interval_s) == text
