"""Recordings that outlast a file, a clock and a card: ticks and time run on, and each log is complete by itself."""

import gc
import subprocess
import sys
import time
import tracemalloc
import weakref
from itertools import pairwise
from pathlib import Path
from statistics import median

import pytest
from mcap.reader import make_reader
from test_daemon import SteadySensorTruth, default_tray

from flightpower.daq import recorder
from flightpower.daq.config import parse_tray
from flightpower.daq.daemon import record
from flightpower.daq.disk_writer import DiskWriter
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import read_log
from flightpower.flight.log_writer import LogWriter
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.tray import FakeTray

SECOND_NS = 10**9
GIVE_UP_S = 60.0  # on something that hangs; generous, because the machine may be busy
BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "daemon.py"


def wait_for(condition):
    """Wait on the real clock until `condition` holds."""
    deadline = time.monotonic() + GIVE_UP_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.005)


def split_tray(tmp_path: Path, fake, minutes: float):
    text = default_tray(tmp_path, fake).text.replace("new_after_min = 60 ", f"new_after_min = {minutes} ")
    return parse_tray(text, "tray.toml", tmp_path)


def flown(tmp_path: Path, *, minutes: float = 60, seconds: int = 30, jump_s: dict[int, int] | None = None):
    """Logs of a flight; jump_s: by how many seconds the system's clock is set forward, at which second."""
    clock = SimulatedClock(start_ns=7 * SECOND_NS, unix_at_start_ns=10**18)
    fake = FakeTray(SteadySensorTruth(), clock)
    jumps = dict(jump_s or {})

    def progress(elapsed_s):
        for at_s in [at_s for at_s in jumps if elapsed_s >= at_s]:
            clock.set_unix_ns(clock.unix_ns() + jumps.pop(at_s) * SECOND_NS)

    recording = record(
        split_tray(tmp_path, fake, minutes),
        buses=fake,
        clock=clock,
        until_ns=clock.now_ns() + seconds * SECOND_NS,
        progress=progress,
    )
    assert not jumps and recording.write_error == ""
    return recording, [read_log(path) for path in recording.paths]


@pytest.fixture(scope="module")
def split(tmp_path_factory):
    return flown(tmp_path_factory.mktemp("split"), minutes=10 / 60)


@pytest.fixture(scope="module")
def one_file(tmp_path_factory):
    return flown(tmp_path_factory.mktemp("whole"))


def without_file_events(log):
    return {
        topic: [e for e in entries if topic != "/daq/event" or "recording" not in e.message.text]
        for topic, entries in log.entries.items()
    }


def test_files_put_together_are_the_flight(split, one_file):
    """They equal it message for message, including time and tick: the joints cannot be seen."""
    _, parts = split
    _, [item] = one_file
    assert len(parts) == 3
    for topic, entries in without_file_events(item).items():
        assert [entry for part in parts for entry in without_file_events(part)[topic]] == entries, topic


def test_each_file_is_complete_by_itself(split):
    recording, parts = split
    for number, (path, part) in enumerate(zip(recording.paths, parts, strict=True)):
        assert not part.torn
        assert set(part.attachments) == {"tray.toml", "aircraft.toml", "propeller.csv"}
        facts = part.metadata["flightpower"]
        assert facts["part"] == str(number + 1)
        assert facts["previous_log"] == (recording.paths[number - 1].name if number else "")
        assert int(facts["start_unix_ns"]) == part.entries["/daq/tick"][0].time_ns
        with path.open("rb") as stream:
            summary = make_reader(stream, validate_crcs=True).get_summary()
        assert summary.statistics.message_count == sum(map(len, part.entries.values()))
        assert {channel.topic for channel in summary.channels.values()} == set(part.entries)


def test_the_analysis_reads_one_file_as_it_reads_the_flight(split, one_file):
    """Channels on the grid are equal except at the ends, where splines have fewer points to lean on."""
    import numpy as np

    from flightpower.analysis.sources.daemon import synchronize

    _, parts = split
    _, [item] = one_file
    flight, middle = synchronize(item), synchronize(parts[1])
    shift = round((middle.start_ns - flight.start_ns) / 1e9 * 25)
    inner = slice(25, len(middle.table) - 25)
    expected = flight.table.iloc[shift : shift + len(middle.table)]
    for name in ("az_mps2", "q_radps", "dp_alpha_Pa", "static_Pa", "n_revps"):
        np.testing.assert_allclose(
            middle.table[name].to_numpy()[inner], expected[name].to_numpy()[inner], rtol=1e-6, atol=1e-9
        )


def test_a_jump_of_the_system_clock_changes_nothing_but_what_time_says(tmp_path, one_file):
    """The clock jumps twice: it gets the time (46 years ahead), and is set back by a day."""
    _, [plain] = one_file
    _, [jumped] = flown(tmp_path, jump_s={8: 46 * 365 * 86400, 16: -86400})
    for topic, entries in without_file_events(plain).items():
        if topic != "/time":
            assert without_file_events(jumped)[topic] == entries, topic
    system_ns = [entry.message.system_ns for entry in jumped.entries["/time"]]
    steps_s = [round((b - a) / 1e9) for a, b in pairwise(system_ns)]
    assert sorted(step for step in steps_s if step != 1) == [1 - 86400, 1 + 46 * 365 * 86400]
    monotonic_ns = [entry.message.monotonic_ns for entry in jumped.entries["/time"]]
    assert {round((b - a) / 1e9) for a, b in pairwise(monotonic_ns)} == {1}


def test_time_pairs_all_clocks_once_the_satellites_told_theirs(one_file):
    _, [log] = one_file
    times = [entry.message for entry in log.entries["/time"]]
    assert [time.monotonic_ns - times[0].monotonic_ns for time in times] == pytest.approx(
        [i * SECOND_NS for i in range(30)], abs=40_000_000
    )
    with_utc = [time for time in times if time.gps_utc_ns is not None]
    assert len(with_utc) >= 27  # the receiver is configured in the first seconds
    offsets = [time.gps_utc_ns - time.monotonic_ns for time in with_utc]
    # The receiver's latency and the tick in which a solution is read: less than a fifth of a second.
    assert max(offsets) - min(offsets) < 0.2e9


class Stream:
    """Takes the bytes of a log."""

    def __init__(self):
        self.content = bytearray()

    def write(self, data):
        self.content += data
        return len(data)


def test_the_index_of_an_hour_is_handed_over_without_being_copied(tmp_path):
    """9,000 chunks of 15 topics have an index of 2 MB; copying it cost a tick when a file was changed."""
    stream = Stream()
    log = LogWriter(stream)
    channels = [log.add_channel(f"/{i}", 0) for i in range(15)]
    for chunk in range(9000):
        for channel in channels:
            log.write_encoded(channel, b"{}", time_ns=chunk, tick=chunk)
        log.flush()
    before = len(stream.content)
    tracemalloc.start()
    pieces = log._index.end_of_file(log.size_bytes)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert sum(map(len, pieces)) > 2_000_000 and most < 100_000
    log.finish()
    path = tmp_path / "hour.mcap"
    path.write_bytes(stream.content)
    with path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary.statistics.message_count == 15 * 9000 and len(summary.chunk_indexes) == 9000
    assert len(stream.content) - before > 2_000_000


class OneBus:
    """A transducer that always gives the same reading, as cheaply as possible."""

    def read(self, address, count):
        return bytes([0x20, 0x00, 0x60, 0x00])

    def i2c(self, device):
        return self


TRANSDUCER = '[[sensors]]\ndriver="honeywell"\nbus="b"\npart="SSCDRRN005ND2A5"\nmeasures="airspeed"\n'


@pytest.mark.thorough
def test_an_hour_leaves_no_memory_and_no_drift_behind(tmp_path, monkeypatch):
    """At 1 Hz, a file every ten minutes; weighed at the end of each. A leak of 20 bytes a tick is 12 kB a file.

    A leak shows in every difference; single allocations by other threads of the test show in few.
    """
    clock = SimulatedClock(unix_at_start_ns=10**18)
    tray = parse_tray(f"rate_Hz = 1\n[files]\nnew_after_min = 10\n{TRANSDUCER}", "tray.toml", tmp_path)
    sizes, writers = [], weakref.WeakSet()

    class ListedWriter(DiskWriter):
        def __init__(self, *args, **options):
            writers.add(self)
            super().__init__(*args, **options)

        def unsaved(self):
            return [] if self.done else super().unsaved()

    monkeypatch.setattr(recorder, "DiskWriter", ListedWriter)

    def progress(elapsed_s):
        if elapsed_s % 600 == 599:
            wait_for(lambda: not any(writer.unsaved() for writer in writers))  # data on their way are not a leak
            gc.collect()
            sizes.append(tracemalloc.get_traced_memory()[0])

    tracemalloc.start()
    try:
        recording = record(tray, buses=OneBus(), clock=clock, until_ns=3600 * SECOND_NS, progress=progress)
    finally:
        tracemalloc.stop()
    logs = [read_log(path) for path in recording.paths]
    ticks = [entry for log in logs for entry in log.entries["/daq/tick"]]
    assert len(logs) == 6 and recording.missed == 0
    assert [e.tick for e in ticks] == list(range(3600))
    assert [e.time_ns for e in ticks] == [10**18 + i * SECOND_NS for i in range(3600)]
    assert len(sizes) == 6
    assert abs(median(b - a for a, b in pairwise(sizes))) < 8_000


@pytest.mark.parametrize("rate_Hz", [1, 2, 3, 25, 200])
def test_nothing_waits_in_a_chunk_for_half_a_second(tmp_path, rate_Hz):
    """A chunk is closed with its last message, so the time from its first to its last is how long that one waited."""
    clock = SimulatedClock(unix_at_start_ns=10**18)
    tray = parse_tray(f"rate_Hz = {rate_Hz}\n{TRANSDUCER}", "tray.toml", tmp_path)
    path = record(tray, buses=OneBus(), clock=clock, until_ns=10 * SECOND_NS).path
    with path.open("rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    assert max(chunk.message_end_time - chunk.message_start_time for chunk in chunks) < 0.5 * SECOND_NS


@pytest.mark.thorough
@pytest.mark.slow
def test_changes_of_file_leave_no_memory_in_use():
    """Two hours on the simulated clock in 24 files, in its own process, whose memory the kernel measures.

    After the sixth file memory stays level, except for single steps of up to 400 KiB when the disk thread was late. A
    leak grows in both halves of the rest. In each half, a single number kept at each tick would be 24 bytes of 13,500
    ticks, 316 KiB; a file's index kept when the file is finished (750 chunks of two sensors and three topics of our
    own, 131 bytes each), 863 KiB.
    """
    command = [sys.executable, BENCHMARK, "day", "--rate", "5", "--hours", "2", "--file-min", "5"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("resident memory [KiB], file by file:")]
    resident_KiB = [int(word) for word in line.partition(":")[2].split()]
    assert len(resident_KiB) == 24
    growth_KiB = resident_KiB[14] - resident_KiB[5], resident_KiB[23] - resident_KiB[14]
    assert min(growth_KiB) < 9 * 1500 * sys.getsizeof(0.0) / 1024


def test_when_the_card_is_full_at_power_on_it_says_so_and_waits_for_room(tmp_path, monkeypatch):
    free = [0]
    looked = [0]

    def free_bytes(directory):
        looked[0] += 1
        return free[0]

    monkeypatch.setattr("flightpower.daq.disk_space.free_bytes", free_bytes)
    monkeypatch.setattr("flightpower.daq.disk_space.CHECK_EVERY_S", 0.001)
    clock = SimulatedClock(unix_at_start_ns=10**18)
    tray = parse_tray(TRANSDUCER, "tray.toml", tmp_path)
    events, lines = [], []

    def progress(elapsed_s):
        if elapsed_s == 100.0:
            free[0] = 10**12
            seen = looked[0]
            wait_for(lambda: looked[0] > seen + 1)  # by the disk space thread, on the real clock

    recording = record(
        tray, buses=OneBus(), clock=clock, until_ns=300 * SECOND_NS, progress=progress,
        on_event=lambda event: events.append(event.text), report=lines.append,
    )  # fmt: skip
    assert "recording stops" in events[0]
    assert "NOT RECORDING: the card is full" in lines[50].line
    assert any("are free again: recording resumes" in text for text in events)
    first = read_log(recording.path).entries["/daq/tick"][0]
    assert first.tick >= 100 * 25
    with pytest.raises(InputError, match="recording stops"):
        free[0] = 0
        record(tray, buses=OneBus(), clock=clock, log_path=tmp_path / "mine.mcap", until_ns=clock.now_ns() + 10**9)
    assert not (tmp_path / "mine.mcap").exists()


def test_the_status_line_says_how_it_goes(tmp_path):
    clock = SimulatedClock(unix_at_start_ns=10**18)
    fake = FakeTray(SteadySensorTruth(), clock)
    lines = []
    record(
        default_tray(tmp_path, fake), buses=fake, clock=clock, until_ns=clock.now_ns() + 6 * SECOND_NS,
        report=lines.append,
    )  # fmt: skip
    assert len(lines) == 6
    line = lines[-1].line
    assert line.startswith("recording log-0001_2016-05-14_093000Z.mcap, 5 s, 126 ticks, 0 missed, ")
    assert line.endswith("GB free; all well")
    assert "starting" in lines[0].line
