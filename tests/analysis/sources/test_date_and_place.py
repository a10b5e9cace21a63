"""When and where a log of the daemon was recorded."""

from pathlib import Path

import pytest

from flightpower.analysis.sources.daemon import first_ns, fix_of_log
from flightpower.analysis.sources.recording import Fix, Position
from flightpower.flight.log_entries import NO_ENTRIES, LogEntry, entries_of
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import Gps, Message, Status, Time


def fix(topic: str, *timed: tuple[float, Message]) -> Fix:
    entries = entries_of([LogEntry(int(t_s * 1e9), i, message) for i, (t_s, message) in enumerate(timed)])
    log = Log(Path("flight.mcap"), {"/rpm": NO_ENTRIES, topic: entries})
    return fix_of_log(log, first_ns(log))


@pytest.mark.parametrize("clock_s", [0.0, 1.6e9], ids=["never set", "a year late"])
def test_satellites_date_a_flight_whose_computer_did_not_know_the_time(clock_s: float) -> None:
    """A Raspberry Pi has no battery for its clock, and no network at the field."""
    result = fix("/time", (clock_s, Time()), (clock_s + 40.0, Time(gps_utc_ns=1_780_000_040 * 10**9)))
    assert result.by_satellites and result.unix_at_zero_s == 1_780_000_000


@pytest.mark.parametrize(("clock_s", "start_s"), [(1.7e9, 1.7e9), (86_400.0, None), (946_684_800.0, None)])
def test_without_satellites_a_flight_has_the_computer_s_date_where_its_clock_was_set(
    clock_s: float, start_s: float | None
) -> None:
    result = fix("/time", (clock_s, Time()), (2e9, Time()))
    assert (result.unix_at_zero_s, result.by_satellites) == (start_s, False)


def test_the_places_are_the_first_and_the_last_that_the_receiver_knew() -> None:
    lost = Gps(status=Status.STARTING)
    first, last = (Gps(latitude_deg=35.0 + x, longitude_deg=-78.0 - x, height_msl_m=100.0 + x) for x in (0.25, 0.5))
    result = fix("/gps", (10.0, lost), (12.0, first), (13.0, lost), (15.0, last), (16.0, lost))
    assert result.ends == (Position(2.0, 35.25, -78.25), Position(5.0, 35.5, -78.5))
    assert (result.latitude_deg, result.longitude_deg, result.height_msl_m) == (35.25, -78.25, 100.25)
    assert fix("/gps", (10.0, lost)).ends == ()
