"""Messages kept as columns come back as they were: nulls, integers of any size, lists, and their order in time."""

import pytest

from flightpower.flight.log_entries import BATCH, Entries, LogEntry, entries_of
from flightpower.flight.messages import Controls, Gps, Imu, Message, Status, Tick, Time

MESSAGES: list[Message] = [
    Imu(samples=8, specific_force_z_mps2=-9.81),
    Imu(status=Status.STALE),
    Time(monotonic_ns=2**63 - 1, system_ns=1463218142003960001),
    Gps(utc_ns=None, latitude_deg=35.77, satellites=0),
    Controls(pulse_us=[1500, 1000], throttle=0.0),
    Tick(late_ns=3, duration_ns={"imu": 5}),
]


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: type(message).__name__)
def test_entries_come_back_as_they_were(message: Message) -> None:
    kind = type(message)
    rows = [LogEntry(10 * i, i, message if i % 3 else kind()) for i in range(2 * BATCH + 7)]
    entries = entries_of(rows)
    assert list(entries) == rows and len(entries) == len(rows)
    assert entries[-1] == rows[-1] and entries[5:9] == rows[5:9]
    with pytest.raises(IndexError):
        entries[len(rows)]


def test_an_integer_beyond_64_bits_is_kept() -> None:
    rows = [LogEntry(i, i, Time(system_ns=value)) for i, value in enumerate((1, None, 2**70, 3))]
    assert list(entries_of(rows)) == rows


def test_entries_are_sorted_by_time_and_keep_the_order_of_one_time() -> None:
    entries = Entries(Imu)
    entries.extend([30, 10, 20, 10], [0, 1, 2, 3], [Imu(samples=i) for i in range(4)])
    entries.finish()
    assert [(e.time_ns, e.tick, e.message.samples) for e in entries] == [(10, 1, 1), (10, 3, 3), (20, 2, 2), (30, 0, 0)]
