"""The log on its way to the disk: nothing is overwritten, all is soon on the disk, write errors are survived."""

import errno
import os
import threading
import time

import pytest

from daq import recorder as recorder_module
from daq.recorder import BACKLOG_BYTES, DiskWriter, Recorder, new_log_path, open_recorder
from daq.sensors import Sample
from flight.errors import InputError
from flight.log_reader import read_log
from flight.messages import Imu

TICK_NS = 40_000_000


def record_ticks(recorder: Recorder, first: int, count: int) -> None:
    for tick in range(first, first + count):
        now_ns = tick * TICK_NS
        sample = Sample("/imu", now_ns, Imu(accel_x_counts=float(tick)))
        recorder.write([sample], tick=tick, now_ns=now_ns)


def wait_for(condition, seconds=5.0):
    """Until `condition` holds; fails when it does not come true in time."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        threading.Event().wait(0.005)


def test_messages_come_back_with_their_time_and_tick(tmp_path):
    recorder = open_recorder(tmp_path / "log.mcap", offset_ns=10**18)
    record_ticks(recorder, 0, 100)
    recorder.close()
    log = read_log(tmp_path / "log.mcap")
    assert not log.torn
    entries = log.entries["/imu"]
    assert [(e.tick, e.time_ns) for e in entries] == [(i, 10**18 + i * TICK_NS) for i in range(100)]
    assert [e.message.accel_x_counts for e in entries] == list(range(100))


def test_an_existing_log_is_never_overwritten(tmp_path):
    path = tmp_path / "log.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(InputError, match="never overwritten"):
        open_recorder(path, offset_ns=0)
    assert path.read_bytes() == b"precious"


def test_names_count_up_past_whatever_is_there(tmp_path):
    directory = tmp_path / "made" / "for us"
    assert new_log_path(directory).name == "log-0001.mcap"
    (directory / "log-0007.mcap").touch()
    (directory / "log-notes.txt").touch()
    assert new_log_path(directory).name == "log-0008.mcap"


def test_a_directory_that_cannot_be_used_is_said_by_name(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"file/logs: cannot be used"):
        new_log_path(tmp_path / "file" / "logs")
    with pytest.raises(InputError, match=r"log\.mcap: cannot be created"):
        open_recorder(tmp_path / "absent" / "log.mcap", offset_ns=0)


def test_all_but_the_last_half_second_is_in_the_file_before_it_is_finished(tmp_path):
    path = tmp_path / "log.mcap"
    recorder = open_recorder(path, offset_ns=0)
    record_ticks(recorder, 0, 100)
    handed_over = recorder._disk.tell()
    wait_for(lambda: path.stat().st_size == handed_over)
    log = read_log(path)
    assert log.entries["/imu"][-1].tick >= 100 - 13 - 1
    recorder.close()


def test_the_file_is_synced_while_recording_and_the_directory_at_once(tmp_path, monkeypatch):
    synced, directories = [], []
    monkeypatch.setattr(recorder_module.os, "fdatasync", lambda file: synced.append(file))
    monkeypatch.setattr(recorder_module, "sync_directory", directories.append)
    disk = DiskWriter(tmp_path / "log.mcap")
    assert directories == [tmp_path]
    disk.write(b"x")
    wait_for(lambda: synced, seconds=2.0)
    disk.close()


def test_a_full_disk_costs_nothing_once_there_is_room_again(tmp_path, monkeypatch):
    full = threading.Event()
    plain = os.write

    def write(file, data):
        if full.is_set():
            raise OSError(errno.ENOSPC, "No space left on device")
        return plain(file, bytes(data[: 1 + len(data) // 2]))  # and a disk may take less than it is given

    monkeypatch.setattr(recorder_module.os, "write", write)
    monkeypatch.setattr(recorder_module, "RETRY_EVERY_S", 0.01)
    recorder = open_recorder(tmp_path / "log.mcap", offset_ns=0)
    record_ticks(recorder, 0, 50)
    full.set()
    record_ticks(recorder, 50, 50)
    wait_for(lambda: "No space left" in recorder.error)
    full.clear()
    wait_for(lambda: not recorder.error)
    record_ticks(recorder, 100, 50)
    recorder.close()
    log = read_log(tmp_path / "log.mcap")
    assert not log.torn and [e.tick for e in log.entries["/imu"]] == list(range(150))


def test_a_disk_that_stays_broken_is_given_up_without_blocking_for_ever(tmp_path, monkeypatch):
    def write(file, data):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(recorder_module.os, "write", write)
    monkeypatch.setattr(recorder_module, "PATIENCE_S", 0.01)
    disk = DiskWriter(tmp_path / "log.mcap")
    for _ in range(BACKLOG_BYTES // 2**20 + 3):
        disk.write(bytes(2**20))
    assert disk.lost
    disk.close()
    assert "Input/output error" in disk.error
