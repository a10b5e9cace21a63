"""What happens to real logs, done to the topics of a ULog file: dropouts, a clock that is set, a late start."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sim.ulog_writer import Dropout, UlogTopic

LONGEST_DROPOUT_MS, DROPOUTS = 4000, 12


def with_dropouts(topics: Sequence[UlogTopic], seed: int) -> tuple[list[UlogTopic], list[Dropout]]:
    """Without the messages of some gaps of up to LONGEST_DROPOUT_MS at random times, and the records of these."""
    rng = np.random.default_rng(seed)
    first, last = (int(of(int(of(one.time_us)) for one in topics)) for of in (min, max))
    gaps = [
        Dropout(int(rng.integers(first, last)), int(rng.integers(100, LONGEST_DROPOUT_MS))) for _ in range(DROPOUTS)
    ]
    left = list(topics)
    for gap in gaps:
        left = [without(one, gap.time_us, gap.time_us + 1000 * gap.duration_ms) for one in left]
    return left, gaps


def begun_at(topics: Sequence[UlogTopic], time_us: int) -> list[UlogTopic]:
    return [without(one, 0, time_us) for one in topics]


def with_clock_set(topics: Sequence[UlogTopic], at_us: int, by_us: int) -> list[UlogTopic]:
    """The clock is set forward by `by_us` at `at_us`."""
    return [
        replace(one, time_us=one.time_us + np.where(one.time_us >= at_us, by_us, 0).astype(np.uint64)) for one in topics
    ]


def without(topic: UlogTopic, start_us: int, end_us: int) -> UlogTopic:
    """Without the messages from start_us to before end_us."""
    kept = (topic.time_us < start_us) | (topic.time_us >= end_us)
    return replace(topic, time_us=topic.time_us[kept], columns={name: x[kept] for name, x in topic.columns.items()})
