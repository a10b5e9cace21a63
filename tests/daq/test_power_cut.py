"""A power cut at any byte: we read all but the last second as it is, and any MCAP reader does after the next start."""

import os
import pty
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import tty
from collections import Counter
from itertools import pairwise

import pytest
from mcap.reader import make_reader
from scripted_parts import counter_frame
from test_daemon import SteadySensorTruth, default_tray, fly

from flightpower.daq import disk_writer as disk_module
from flightpower.daq.clock import SystemClock
from flightpower.daq.daemon import record
from flightpower.daq.log_recovery import recover
from flightpower.daq.recorder import Recorder
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import read_log
from flightpower.hw_fakes.tray import FakeTray

SECONDS = 10
SECOND_NS = 10**9
RATE_HZ = 25
GIVE_UP_S = 120.0  # on something that hangs; generous, because the machine may be busy


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """The complete file, and the end and closing time [ns of log time] of each chunk."""
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
    assert max(gaps_ns) <= 500_000_000


def test_the_statistics_of_a_mended_log_count_every_message(flight, tmp_path):
    """This includes a last chunk whose message indices were lost: they are written again."""
    data, ends = flight
    path = tmp_path / "log-0001.mcap"
    path.write_bytes(data)
    with path.open("rb") as stream:
        fifth = make_reader(stream).get_summary().chunk_indexes[4]
    after = fifth.chunk_start_offset + fifth.chunk_length
    for cut in (after, after + 1, after + fifth.message_index_length // 2, ends[4][0], ends[4][0] + 30):
        path.write_bytes(data[:cut])
        recover(path)
        assert path.read_bytes()[: ends[4][0]] == data[: ends[4][0]]
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            statistics = reader.get_summary().statistics
            counter = Counter(channel.id for _, channel, _ in reader.iter_messages())
        assert statistics.message_count == counter.total() > 0
        assert statistics.channel_message_counts == counter


def test_zeros_after_the_head_of_a_chunk_are_not_taken_for_an_empty_chunk(flight, tmp_path):
    """A file system may have extended the file without writing the data, so the rest of a record is zeros."""
    data, _ = flight
    path = tmp_path / "log-0001.mcap"
    path.write_bytes(data)
    with path.open("rb") as stream:
        fifth = make_reader(stream).get_summary().chunk_indexes[4]
    for written in range(1, 60):
        path.write_bytes(data[: fifth.chunk_start_offset + written] + bytes(5000))
        done = recover(path)
        assert done is not None and path.read_bytes()[: done.kept_bytes] == data[: done.kept_bytes], written


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
        done = recover(path)
        assert done is not None and path.read_bytes()[: done.kept_bytes] == data[: done.kept_bytes]
        after = read_log(path)
        assert not after.torn and len(after.entries["/imu"]) == len(before.entries["/imu"])
        with path.open("rb") as stream:
            stock = [message.log_time for _, _, message in make_reader(stream).iter_messages()]
        assert max(stock) >= closed_ns
        assert recover(path) is None  # nothing left to do


def test_a_finished_log_and_a_stranger_are_left_alone(flight, tmp_path):
    data, _ = flight
    for name, content in (("log-0001.mcap", data), ("log-0002.mcap", b"no log at all" * 10)):
        (tmp_path / name).write_bytes(content)
    assert [recover(path) for path in sorted(tmp_path.iterdir())] == [None] * 2
    assert (tmp_path / "log-0001.mcap").read_bytes() == data
    assert (tmp_path / "log-0002.mcap").read_bytes() == b"no log at all" * 10


@pytest.mark.parametrize("from_the_end", [1, 2, 3, 4])
def test_a_chunk_that_never_reached_the_card_is_removed_although_later_ones_did(flight, tmp_path, from_the_end):
    """Unsynced data may reach the card in any order, and up to four chunks are written within a second.

    Everything before the damaged chunk is kept, and the completed log is readable to its end.
    """
    data, ends = flight
    path = tmp_path / "log-0001.mcap"
    path.write_bytes(data)
    with path.open("rb") as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[-from_the_end]
    middle = chunk.chunk_start_offset + chunk.chunk_length // 2
    unfinished = bytearray(data[: ends[-1][0]])
    unfinished[middle : middle + 16] = bytes(16)
    path.write_bytes(unfinished)
    recovered = recover(path)
    assert recovered is not None and recovered.kept_bytes == chunk.chunk_start_offset
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        latest_ns = max(message.log_time for _, _, message in reader.iter_messages())
    assert latest_ns == ends[-from_the_end - 1][1] and not read_log(path).torn


def test_a_log_that_is_being_recorded_is_left_alone(tmp_path):
    recorder = Recorder(lambda _: tmp_path / "log-0001.mcap", offset_ns=0)
    assert recover(tmp_path / "log-0001.mcap") is None
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
    assert any("log-0001.mcap was unfinished" in event.text for event in events)
    assert not read_log(torn).torn


def test_what_never_held_a_message_says_so(flight, tmp_path):
    data, _ = flight
    path = tmp_path / "log-0001.mcap"
    shutil.copyfile("/dev/null", path)
    path.write_bytes(data[:200])
    recover(path)
    with pytest.raises(InputError, match="holds no message"):
        read_log(path)


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """The log of a daemon that was killed while recording, and the number of ticks that it had done."""
    folder = tmp_path_factory.mktemp("killed")
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    port = os.ttyname(theirs)
    (folder / "tray.toml").write_text(f'[[sensors]]\ndriver="esc_counter"\nport="{port}"\npole_pairs=7\nframed=true\n')
    command = [sys.executable, "-m", "flightpower.daq", "run", "-c", folder / "tray.toml"]
    log = folder / "logs" / "log-0001.mcap"
    deadline, sequence, ticks = time.monotonic() + GIVE_UP_S, 0, 0
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(folder / "notify"))
        manager.setblocking(False)
        environment = {**os.environ, "NOTIFY_SOCKET": str(folder / "notify")}
        daemon = subprocess.Popen(command, stderr=subprocess.DEVNULL, env=environment)
        while ticks < 75 or log.stat().st_size < 12_000:  # until a status that comes after three seconds or more
            assert time.monotonic() < deadline
            os.write(ours, counter_frame(sequence))
            sequence += 1
            try:
                ticks = int(re.search(r"(\d+) ticks", manager.recv(4096).decode())[1])
            except BlockingIOError:
                time.sleep(0.01)
        daemon.send_signal(signal.SIGKILL)
        daemon.wait()
    os.close(ours)
    os.close(theirs)
    return log.read_bytes(), ticks


def readable_until_ns(path) -> int:
    return max(entry.time_ns for entries in read_log(path).entries.values() for entry in entries)


def test_a_killed_daemon_costs_less_than_a_second(killed, tmp_path):
    """The loss is counted in completed ticks, because a busy machine may complete fewer of them in a second."""
    data, ticks = killed
    path = tmp_path / "log-0001.mcap"
    path.write_bytes(data)
    assert ticks - len(read_log(path).entries["/daq/tick"]) < RATE_HZ


@pytest.mark.parametrize("zeros", [False, True])
def test_a_killed_daemons_file_cut_anywhere_costs_the_chunk_being_written(killed, tmp_path, zeros):
    """At 250 random bytes, and around the start and the end of every chunk.

    That a chunk covers less than half a second is shown by test_chunks_are_closed_twice_a_second.
    """
    data, _ = killed
    path = tmp_path / "log-0001.mcap"
    path.write_bytes(data)
    recover(path)
    with path.open("rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    draw = random.Random(20160514)
    first = chunks[0].chunk_start_offset + 1
    joints = {place for c in chunks for place in (c.chunk_start_offset, c.chunk_start_offset + c.chunk_length)}
    cuts = [draw.randrange(first, len(data)) for _ in range(250)]
    cuts += [joint + near for joint in sorted(joints) for near in (-1, 0, 1) if first <= joint + near < len(data)]
    for cut in cuts:
        whole_ns = max((c.message_end_time for c in chunks if c.chunk_start_offset + c.chunk_length <= cut), default=0)
        torn = data[:cut] + (bytes(draw.randrange(1, 10_000)) if zeros else b"")
        path.write_bytes(torn)
        if not whole_ns:
            continue  # within the first chunk
        assert readable_until_ns(path) >= whole_ns
        recover(path)
        with path.open("rb") as stream:
            stock_ns = max(message.log_time for _, _, message in make_reader(stream).iter_messages())
        assert stock_ns == readable_until_ns(path) >= whole_ns


def test_only_what_was_synced_is_left_and_that_is_all_but_a_second(tmp_path, monkeypatch):
    """Replay the daemon's own writes and syncs, and at every instant keep only what had been synced by then.

    The loss is counted in completed ticks, because on a busy machine a second may have fewer of them. Syncs are not
    carried out, since their duration depends on the disk.
    """
    calls: list[tuple[int, int, str, int, bytes]] = []  # begin, end [ns], operation, file offset, data
    pwrite = os.pwrite

    def write(file, data, offset):
        begin_ns = time.monotonic_ns()
        count = pwrite(file, data, offset)
        calls.append((begin_ns, time.monotonic_ns(), "write", offset, bytes(data[:count])))
        return count

    def sync(file):
        begin_ns = time.monotonic_ns()
        calls.append((begin_ns, time.monotonic_ns(), "sync", 0, b""))

    monkeypatch.setattr(disk_module.os, "pwrite", write)
    monkeypatch.setattr(disk_module.os, "fdatasync", sync)
    clock = SystemClock()
    fake = FakeTray(SteadySensorTruth(), clock)
    tray = default_tray(tmp_path, fake)
    recording = record(tray, buses=fake, clock=clock, until_ns=clock.now_ns() + 5 * SECOND_NS, threaded=True)
    first = read_log(recording.path)
    offset_ns = int(first.metadata["flightpower"]["start_unix_ns"]) - int(
        first.metadata["flightpower"]["start_monotonic_ns"]
    )
    times_ns = sorted(entry.time_ns - offset_ns for entry in first.entries["/daq/tick"])
    syncs = [(begin, end) for begin, end, what, _, _ in calls if what == "sync"]
    assert len(syncs) >= 2
    with recording.path.open("rb") as stream:
        data_begin = make_reader(stream).get_summary().chunk_indexes[0].chunk_start_offset
    oldest_ns = most_ticks = 0
    path = tmp_path / "log-0001.mcap"
    for (begin_ns, _), (_, next_ns) in pairwise(syncs):
        content = bytearray()
        for _, end_ns, what, offset, data in calls:
            if what == "write" and end_ns <= begin_ns:
                content[offset : offset + len(data)] = data
        path.write_bytes(content)
        there_ns = times_ns[0] - 1  # before the first chunk is closed there is nothing
        if len(content) > data_begin:
            there_ns = readable_until_ns(path) - offset_ns
            recover(path)
            with path.open("rb") as stream:
                assert max(m.log_time for _, _, m in make_reader(stream).iter_messages()) - offset_ns == there_ns
        lost = [time_ns for time_ns in times_ns if there_ns < time_ns <= next_ns]
        oldest_ns, most_ticks = max([oldest_ns, *(next_ns - time_ns for time_ns in lost)]), max(most_ticks, len(lost))
    assert most_ticks < RATE_HZ
    print(f"a power cut could destroy {most_ticks} ticks; the oldest was {oldest_ns / 1e9:.2f} s old")


def test_a_mended_log_has_its_index_again(flight, tmp_path):
    data, ends = flight
    path = tmp_path / "log-0001.mcap"
    path.write_bytes(data[: ends[5][0] + 100])
    recover(path)
    with path.open("rb") as stream:
        summary = make_reader(stream, validate_crcs=True).get_summary()
    assert len(summary.chunk_indexes) == 6 and summary.statistics.chunk_count == 6
    assert {channel.topic for channel in summary.channels.values()} == set(read_log(path).entries)
    assert [index.name for index in summary.attachment_indexes] == list(read_log(path).attachments)


def test_a_power_cut_while_mending_costs_nothing(flight, tmp_path):
    data, ends = flight
    torn = data[: ends[5][0] + 100]
    path = tmp_path / "log-0001.mcap"
    path.write_bytes(torn)
    complete = recover(path)
    mended = path.read_bytes()
    for cut in range(complete.kept_bytes, len(mended), 97):
        path.write_bytes(mended[:cut] + torn[cut:])
        recover(path)
        assert path.read_bytes()[: complete.kept_bytes] == mended[: complete.kept_bytes]
        assert not read_log(path).torn
