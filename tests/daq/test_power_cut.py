"""A power cut at any byte: all but the last second is read by us as it is, by any MCAP reader after the next start."""

import random
import shutil
from itertools import pairwise

import pytest
from mcap.reader import make_reader
from test_daemon import fly

from daq.recorder import Recorder
from daq.salvage import complete, complete_unfinished
from flight.errors import InputError
from flight.log_reader import read_log

SECONDS = 10


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """The whole file, and for each of its chunks where it ends and when it was closed [ns of log time]."""
    path = fly(tmp_path_factory.mktemp("cut"), SECONDS).path
    with path.open("rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    ends = [
        (chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length, chunk.message_end_time)
        for chunk in chunks
    ]
    return path.read_bytes(), ends


def test_chunks_are_closed_twice_a_second(flight):
    _, ends = flight
    gaps_ns = [b - a for (_, a), (_, b) in pairwise(ends)]
    assert max(gaps_ns) <= 560_000_000


@pytest.mark.parametrize("zeros", [0, 5000])
def test_a_cut_anywhere_costs_less_than_a_second(flight, tmp_path, zeros):
    data, ends = flight
    draw = random.Random(20160514)
    for cut in [draw.randrange(ends[0][0], len(data)) for _ in range(20)]:
        path = tmp_path / "log-0001.mcap"
        path.write_bytes(data[:cut] + bytes(zeros))
        # What was handed to the disk by then reaches to the chunk that is torn; the recorder closes one every 0.5 s.
        closed_ns = max(end_ns for end, end_ns in ends if end <= cut)
        before = read_log(path)
        latest_ns = max(entry.time_ns for entries in before.entries.values() for entry in entries)
        assert latest_ns >= closed_ns
        done = complete(path)
        assert done is not None and path.read_bytes()[: done.kept_bytes] == data[: done.kept_bytes]
        after = read_log(path)
        assert not after.torn and len(after.entries["/imu"]) == len(before.entries["/imu"])
        with path.open("rb") as stream:
            stock = [message.log_time for _, _, message in make_reader(stream).iter_messages()]
        assert max(stock) >= closed_ns
        assert complete(path) is None  # nothing left to do


def test_a_finished_log_and_a_stranger_are_left_alone(flight, tmp_path):
    data, _ = flight
    for name, content in (("log-0001.mcap", data), ("log-0002.mcap", b"no log at all" * 10), ("log-0003.mcap", b"")):
        (tmp_path / name).write_bytes(content)
    assert complete_unfinished(tmp_path) == []
    assert (tmp_path / "log-0001.mcap").read_bytes() == data
    assert (tmp_path / "log-0002.mcap").read_bytes() == b"no log at all" * 10


def test_a_log_that_is_being_recorded_is_left_alone(tmp_path):
    recorder = Recorder(lambda _: tmp_path / "log-0001.mcap", offset_ns=0)
    assert complete_unfinished(tmp_path) == []
    recorder.finish()
    recorder.disk.close()


def test_the_next_start_completes_what_the_last_one_left(flight, tmp_path):
    data, ends = flight
    (tmp_path / "logs").mkdir()
    torn = tmp_path / "logs" / "log-0001.mcap"
    torn.write_bytes(data[: ends[3][0] + 17])
    events = []
    recording = fly(tmp_path, 1, on_event=events.append)
    assert recording.path.name == "log-0002.mcap"
    assert "log-0001.mcap was unfinished" in events[0].text
    assert not read_log(torn).torn


def test_what_never_held_a_message_says_so(flight, tmp_path):
    data, _ = flight
    path = tmp_path / "log-0001.mcap"
    shutil.copyfile("/dev/null", path)
    path.write_bytes(data[:200])
    complete(path)
    with pytest.raises(InputError, match="holds no message"):
        read_log(path)
