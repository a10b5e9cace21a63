"""Log files: nothing is overwritten, data are soon on the disk, failures of the disk are survived and reported.

More than 350 lines: all tests share one simulated disk that fails on command.
"""

import errno
import fcntl
import os
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from flightpower.daq import disk_writer as disk_module
from flightpower.daq import log_files as logbook_module
from flightpower.daq.disk_space import DiskSpace, is_finished
from flightpower.daq.disk_writer import DiskWriter
from flightpower.daq.log_files import FileLimits, LogFiles
from flightpower.daq.log_names import numbered_names, part_names
from flightpower.daq.recorder import BACKLOG_BYTES, Recorder
from flightpower.daq.sensors import Sample
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import Imu

TICK_NS = 40_000_000
GIVE_UP_S = 60.0  # on something that hangs; generous, because the machine may be busy
NO_LIMITS = FileLimits(10**18, 10**18)


def ticks_of(path: Path) -> list[int]:
    log = read_log(path)
    assert not log.torn
    return [entry.tick for entry in log.entries["/imu"]]


def wait_for(condition, seconds=GIVE_UP_S):
    """Wait until `condition` holds; fail if it does not come true in time."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        threading.Event().wait(0.005)


class RecordingSession:
    """The log files of a directory, with a tick counter and all reported events."""

    def __init__(self, directory: Path, *, name=None, limits=NO_LIMITS, keep=0, policy="stop", waits=False):
        self.disk_space = DiskSpace(directory, keep, policy)
        self.tick = 0
        self.events: list = []

        def begin(recorder, number, now_ns, previous):
            recorder.log.add_metadata("part", {"number": str(number), "before": previous.name if previous else ""})
            recorder.log.declare("/imu")

        self.files = LogFiles(
            name or numbered_names(directory), begin, offset_ns=10**18, limits=limits, disk_space=self.disk_space
        )
        self.files.open(0, waits=waits)

    def run(self, ticks: int, **options) -> None:
        for _ in range(ticks):
            now_ns = self.tick * TICK_NS
            self.events += self.files.update(now_ns, **options)
            sample = Sample("/imu", now_ns, Imu(accel_x_counts=float(self.tick)))
            self.files.write([sample], tick=self.tick, now_ns=now_ns)
            self.tick += 1

    def run_until(self, condition) -> None:
        """Do a tick every 5 ms until `condition` holds: the disk's thread works on a real clock."""

        def step():
            self.run(1)
            return condition()

        wait_for(step)

    @property
    def texts(self) -> list[str]:
        return [event.text for event in self.events]


class FaultyDisk:
    """The system calls of the disk thread, some of which fail. A write hangs while `hold` is cleared.

    `gave_up`: a write hung for GIVE_UP_S, which happens only if the caller waits for the disk.
    """

    def __init__(self, monkeypatch):
        self.write_error = self.sync_error = self.open_error = 0
        self.hold = threading.Event()
        self.hold.set()
        self.gave_up = False
        pwrite, fdatasync, open_ = os.pwrite, os.fdatasync, os.open

        def write(file, data, offset):
            self.gave_up |= not self.hold.wait(GIVE_UP_S)
            if self.write_error:
                raise OSError(self.write_error, os.strerror(self.write_error))
            return pwrite(file, bytes(data[: 1 + len(data) // 2]), offset)  # a disk may take less than it is given

        def sync(file):
            if self.sync_error:
                raise OSError(self.sync_error, os.strerror(self.sync_error))
            return fdatasync(file)

        def opening(path, flags, *rest, **named):
            if self.open_error and flags & os.O_CREAT:
                raise OSError(self.open_error, os.strerror(self.open_error), str(path))
            return open_(path, flags, *rest, **named)

        monkeypatch.setattr(disk_module.os, "pwrite", write)
        monkeypatch.setattr(disk_module.os, "fdatasync", sync)
        monkeypatch.setattr(disk_module.os, "open", opening)
        monkeypatch.setattr(disk_module, "RETRY_EVERY_S", 0.01)
        monkeypatch.setattr(disk_module, "SLOW_CALL_S", GIVE_UP_S)  # a busy machine is not a slow disk


@pytest.fixture
def faulty(monkeypatch):
    return FaultyDisk(monkeypatch)


def test_messages_come_back_with_their_time_and_tick(tmp_path):
    session = RecordingSession(tmp_path)
    session.run(100)
    assert session.files.close() == ""
    log = read_log(tmp_path / "log-0001.mcap")
    assert not log.torn
    entries = log.entries["/imu"]
    assert [(e.tick, e.time_ns) for e in entries] == [(i, 10**18 + i * TICK_NS) for i in range(100)]
    assert [e.message.accel_x_counts for e in entries] == list(range(100))


def test_an_existing_log_is_never_overwritten(tmp_path):
    path = tmp_path / "log.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(InputError, match="never overwritten"):
        RecordingSession(tmp_path, name=part_names(path))
    assert path.read_bytes() == b"precious"


def test_a_name_that_was_taken_meanwhile_is_passed_over(tmp_path):
    session = RecordingSession(tmp_path)
    session.run(10)
    (tmp_path / "log-0002.mcap").write_bytes(b"precious")
    session.run(1, new_file=True)
    session.run(10)
    session.files.close()
    assert (tmp_path / "log-0002.mcap").read_bytes() == b"precious"
    assert ticks_of(tmp_path / "log-0001.mcap") + ticks_of(tmp_path / "log-0003.mcap") == list(range(21))


def test_names_count_up_past_whatever_is_there(tmp_path):
    directory = tmp_path / "made" / "for us"
    assert numbered_names(directory)(0).name == "log-0001.mcap"
    (directory / "log-0007.mcap").touch()
    (directory / "log-notes.txt").touch()
    assert [numbered_names(directory)(i).name for i in (0, 1)] == ["log-0008.mcap", "log-0009.mcap"]


def test_a_log_is_named_by_the_satellites_time_once_it_is_known(tmp_path):
    session = RecordingSession(tmp_path)
    session.run(10)
    session.files.satellite_offset_ns = 1_795_358_402 * 10**9  # 2026-11-22 14:40:02 at monotonic time 0
    dated = tmp_path / "log-0001_2026-11-22_144002Z.mcap"
    session.run_until(lambda: f"recording {dated}" in session.texts)  # reported at the tick after the new name
    session.files.close()
    assert session.files.paths == [dated]
    assert ticks_of(dated) == list(range(session.tick))
    assert numbered_names(tmp_path)(0).name == "log-0002.mcap"


def test_naming_a_log_never_replaces_another(tmp_path):
    session = RecordingSession(tmp_path)
    target = tmp_path / "log-0001_2026-11-22_144002Z.mcap"
    target.write_bytes(b"precious")
    session.files.satellite_offset_ns = 1_795_358_402 * 10**9
    session.run(20)
    session.files.close()
    assert target.read_bytes() == b"precious"
    assert ticks_of(tmp_path / "log-0001.mcap") == list(range(20))


def test_a_directory_that_cannot_be_used_is_said_by_name(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"file/logs: cannot be used"):
        numbered_names(tmp_path / "file" / "logs")
    with pytest.raises(InputError, match=r"log\.mcap: cannot be created"):
        RecordingSession(tmp_path, name=part_names(tmp_path / "absent" / "log.mcap"))


def test_all_but_the_last_half_second_is_in_the_file_before_it_is_finished(tmp_path):
    session = RecordingSession(tmp_path)
    session.run(100)
    recorder = session.files._current
    wait_for(lambda: session.files.path.stat().st_size == recorder.log.size_bytes)
    assert read_log(session.files.path).entries["/imu"][-1].tick >= 100 - 0.5e9 / TICK_NS
    session.files.close()


def test_the_directory_is_synced_at_once(tmp_path, monkeypatch):
    directories = []
    monkeypatch.setattr(disk_module, "sync_directory", directories.append)
    DiskWriter(lambda _: tmp_path / "log.mcap").close()
    assert directories == [tmp_path]


@pytest.mark.parametrize("why", ["asked", "age", "size"])
def test_a_new_file_goes_on_where_the_last_one_ended(tmp_path, why):
    limits = {"asked": NO_LIMITS, "age": FileLimits(20 * TICK_NS, 10**9), "size": FileLimits(10**18, 3000)}[why]
    session = RecordingSession(tmp_path, limits=limits)
    for tick in range(100):
        session.run(1, new_file=why == "asked" and tick % 20 == 19)
        wait_for(lambda: session.files.path is not None)  # a file names the one before by its path, if it has one yet
    assert session.files.close() == ""
    paths = sorted(tmp_path.glob("log-*.mcap"))
    assert len(paths) >= 3 and session.files.paths == paths
    assert [tick for path in paths for tick in ticks_of(path)] == list(range(session.tick))
    described = [read_log(path).metadata["part"] for path in paths]
    assert [part["number"] for part in described] == [str(i) for i in range(len(paths))]
    assert [part["before"] for part in described[1:]] == [path.name for path in paths[:-1]]


def test_a_full_disk_costs_nothing_once_there_is_room_again(tmp_path, faulty):
    session = RecordingSession(tmp_path)
    session.run(50)
    faulty.write_error = errno.ENOSPC
    session.run_until(lambda: "No space left" in session.files.error)
    session.run(50)
    faulty.write_error = 0
    session.run_until(lambda: not session.files.error)
    session.run(1)
    assert session.files.close() == ""
    assert ticks_of(tmp_path / "log-0001.mcap") == list(range(session.tick))
    assert [text.partition(":")[0] for text in session.texts[1:]] == [
        "the log cannot be written and is kept in memory",
        "the log is being written again, nothing was lost",
    ]
    assert session.events[1].severity == "error"


@pytest.mark.parametrize("failing", ["write_error", "sync_error"])
def test_a_file_that_cannot_be_continued_is_left_and_nothing_is_lost(tmp_path, faulty, monkeypatch, failing):
    """Data not yet synced go into the new file, so there is no gap between the two files."""
    monkeypatch.setattr(logbook_module, "GIVE_UP_AFTER_S", 0.05)
    session = RecordingSession(tmp_path)
    session.run(100)
    wait_for(lambda: session.files._current.disk.synced_bytes == session.files._current.log.size_bytes)
    setattr(faulty, failing, errno.EIO)
    faulty.open_error = errno.EIO  # the card is gone for a while
    session.run_until(lambda: "Input/output error" in session.files.error)
    session.run_until(lambda: session.files._files > 1)
    setattr(faulty, failing, 0)
    faulty.open_error = 0
    session.run_until(lambda: session.files.path is not None and not session.files.error)
    session.run(50)
    assert session.files.close() == ""
    first, *later = [read_log(path) for path in sorted(tmp_path.glob("log-*.mcap"))]
    ticks = {entry.tick for log in [first, *later] for entry in log.entries.get("/imu", [])}
    assert ticks == set(range(session.tick))
    assert not later[-1].torn
    assert any("written again, nothing was lost" in text for text in session.texts)


FAULTS = {
    "every sync fails": {"sync_error": errno.EIO},
    "every write fails": {"write_error": errno.EIO},
    "full": {"write_error": errno.ENOSPC},
    "read-only": {"write_error": errno.EROFS, "sync_error": errno.EIO, "open_error": errno.EROFS},
    "hangs": {},
}


@pytest.fixture
def hurried(monkeypatch):
    """Divide the patience by a hundred: sixty seconds of a flight last 0.6 s."""
    for name in ("GIVE_UP_AFTER_S", "MAX_PATIENCE_S", "WELL_AFTER_S"):
        monkeypatch.setattr(logbook_module, name, getattr(logbook_module, name) / 100)
    monkeypatch.setattr(disk_module, "SYNC_EVERY_S", disk_module.SYNC_EVERY_S / 100)


def told_again(session: RecordingSession) -> list[str]:
    return [text for text in session.texts if "written again" in text]


@pytest.mark.parametrize("fault", FAULTS)
def test_a_minute_of_a_fault_leaves_few_files_and_every_tick_once(tmp_path, faulty, hurried, monkeypatch, fault):
    """The daemon reports it at once and does not report success meanwhile; afterwards all waiting data are saved, in
    one place."""
    session = RecordingSession(tmp_path)
    session.run_until(lambda: session.tick > 20 and session.files._current.holds_messages)
    for name, number in FAULTS[fault].items():
        setattr(faulty, name, number)
    if fault == "hangs":
        monkeypatch.setattr(disk_module, "SLOW_CALL_S", 0.02)
        faulty.hold.clear()
    session.run_until(lambda: session.files.error)
    minute_over_s = time.monotonic() + 0.6
    session.run_until(lambda: time.monotonic() > minute_over_s or not session.files.error)
    assert session.files.error and not told_again(session)
    assert session.files._files <= 1 + 4 and len(list(tmp_path.iterdir())) <= 1 + 4
    for name in FAULTS[fault]:
        setattr(faulty, name, 0)
    faulty.hold.set()
    session.run_until(lambda: told_again(session))
    session.run(20)
    assert session.files.close() == ""
    assert [text for text in told_again(session) if not text.endswith("nothing was lost")] == []
    wait_for(lambda: sorted(all_ticks(tmp_path)) == list(range(session.tick)))
    wait_for(lambda: len(list(tmp_path.iterdir())) <= 2)
    assert not read_log(session.files.paths[-1]).torn


def all_ticks(folder: Path) -> list[int]:
    return [entry.tick for path in folder.iterdir() for entry in read_log(path).entries.get("/imu", [])]


def test_the_first_bytes_of_a_new_file_are_its_trial(tmp_path, faulty):
    """A card that accepts data but saves nothing is not sent the waiting data again every second."""
    disk = DiskWriter(lambda _: tmp_path / "log.mcap")
    faulty.sync_error = errno.EIO
    data = os.urandom(10 * disk_module.TRIAL_BYTES)
    disk.write(data)
    wait_for(lambda: disk.failing_s > 0.1)
    assert (tmp_path / "log.mcap").stat().st_size <= disk_module.TRIAL_BYTES
    faulty.sync_error = 0
    disk.close()
    assert not disk.error and (tmp_path / "log.mcap").read_bytes() == data


def test_syncs_that_fail_now_and_then_do_not_bring_the_patience_back(tmp_path, faulty, hurried):
    """A card that works between its faults is tried as rarely as one that never works."""
    session = RecordingSession(tmp_path)
    for _ in range(3):
        syncs = session.files._current.disk.syncs
        session.run_until(lambda syncs=syncs: session.files._current.disk.syncs > syncs + 1)
        faulty.sync_error = errno.EIO
        session.run_until(lambda: session.files.error)
        faulty.sync_error = 0
        session.run_until(lambda: not session.files.error)
    assert session.files._patience_s == 8 * logbook_module.GIVE_UP_AFTER_S
    session.files.close()
    assert sorted(all_ticks(tmp_path)) == list(range(session.tick))


@pytest.mark.parametrize("how", ["deleted", "moved away"])
def test_a_log_that_goes_away_is_reported_and_followed_by_another(tmp_path, hurried, how):
    logs, elsewhere = tmp_path / "logs", tmp_path / "log-0001.mcap"
    session = RecordingSession(logs)
    session.run_until(lambda: session.tick > 20 and session.files._current.holds_messages)
    first = session.files.path
    if how == "deleted":
        first.unlink()
    else:
        first.rename(elsewhere)
    session.run_until(lambda: told_again(session))
    session.run(20)
    assert session.files.close() == ""
    assert any(f"{first}: was {how}" in text for text in session.texts)
    ticks = ticks_of(logs / "log-0002.mcap")
    assert ticks[-1] == session.tick - 1 and session.files.paths == [logs / "log-0002.mcap"]
    if how == "deleted":
        assert told_again(session)[0].endswith("nothing more was lost") and len(ticks) >= 20
    else:
        wait_for(
            lambda: (
                sorted(all_ticks(logs) + [e.tick for e in read_log(elsewhere).entries["/imu"]])
                == list(range(session.tick))
            )
        )
        assert told_again(session)[0].endswith("nothing was lost")


def test_the_end_of_a_file_that_could_not_be_saved_is_reported(tmp_path, faulty):
    """The arm switch ends the recording while the card fails, and this must not look like an all-clear."""
    session = RecordingSession(tmp_path)
    session.run_until(lambda: session.files._current.disk.syncs > 1)
    faulty.sync_error = errno.EIO
    session.run_until(lambda: session.files.error)
    session.run(1, wanted=False)
    wait_for(lambda: all(recorder.disk.done for recorder in session.files._closing.values()))
    session.run(1, wanted=False)
    assert "the end of a log is missing" in session.texts[-1] and not told_again(session)
    assert "Input/output error" in session.files.close()


@pytest.mark.parametrize("number", [errno.EROFS, errno.ENOSPC, errno.EIO])
def test_a_card_that_takes_no_file_at_power_on_is_waited_for_and_reported(tmp_path, faulty, number):
    faulty.open_error = number
    session = RecordingSession(tmp_path, waits=True)
    session.run_until(lambda: session.texts)
    assert session.events[0].severity == "error" and os.strerror(number) in session.files.error
    session.run(50)
    faulty.open_error = 0
    session.run_until(lambda: told_again(session))
    assert session.files.close() == ""
    assert ticks_of(tmp_path / "log-0001.mcap") == list(range(session.tick))


def test_a_folder_without_permission_at_power_on_is_a_mistake_and_not_waited_for(tmp_path, faulty):
    faulty.open_error = errno.EACCES
    with pytest.raises(InputError, match="Permission denied"):
        RecordingSession(tmp_path, waits=True)


def test_a_disk_that_stays_broken_costs_data_but_never_time(tmp_path, faulty):
    session = RecordingSession(tmp_path)
    session.run(1)
    faulty.hold.clear()  # a card that hangs in a write
    while not session.files.dropped:
        now_ns = session.tick * TICK_NS
        session.events += session.files.update(now_ns)
        samples = [Sample("/imu", now_ns, Imu(accel_x_counts=float(i))) for i in range(100)]
        session.files._current.log._chunk += os.urandom(2**20)  # what zstd cannot make small
        session.files.write(samples, tick=session.tick, now_ns=now_ns)
        session.tick += 1
    assert session.files._current.disk.backlog_bytes < BACKLOG_BYTES + 16 * 2**20
    assert not faulty.gave_up  # all this happened while one write was hanging
    session.run(1)
    assert "messages are being lost" in session.texts[-1]
    faulty.hold.set()


def test_each_further_file_of_a_failing_card_gets_twice_the_time(tmp_path):
    """The time grows up to a minute: an hour of failure leaves sixty files and a few more."""
    session = RecordingSession(tmp_path)
    patience_s = []
    for _ in range(6):
        patience_s.append(session.files._patience_s)
        session.run(1)
        session.files._replace_current(session.tick * TICK_NS)
    assert patience_s == [3.0, 6.0, 12.0, 24.0, 48.0, 60.0]
    session.files.close()


def test_each_loss_is_reported_with_its_own_number_of_messages(tmp_path):
    session = RecordingSession(tmp_path)
    session.files.close()
    texts = []
    for dropped in (5, 5, 12, 12):
        disk = SimpleNamespace(error="", backlog_bytes=0)
        session.files._current = SimpleNamespace(dropped=dropped, disk=disk, path=None)
        texts += [event.text for event in session.files._events() if "were lost" in event.text]
    assert [text.rpartition(", ")[2] for text in texts] == ["5 messages were lost", "7 messages were lost"]


def test_a_disk_that_hangs_is_reported_and_does_not_delay_the_end(tmp_path, faulty, monkeypatch):
    monkeypatch.setattr(disk_module, "SLOW_CALL_S", 0.05)
    session = RecordingSession(tmp_path)
    session.run(50)
    faulty.hold.clear()
    session.run_until(lambda: "does not answer" in session.files.error)
    session.run(1)
    assert "does not answer" in session.texts[-1]
    session.files._current.disk.close(within_s=0.2)
    assert not faulty.gave_up  # it returned while the write was hanging
    assert "does not answer" in session.files.error
    faulty.hold.set()


def test_a_sync_that_fails_is_not_believed_later(tmp_path, faulty):
    """After EIO from fsync the kernel has forgotten the pages, so the success of the next one means nothing
    (fsync(2))."""
    disk = DiskWriter(lambda _: tmp_path / "log.mcap")
    disk.write(b"the beginning")
    wait_for(lambda: disk.synced_bytes == len(b"the beginning"))
    faulty.sync_error = errno.EIO
    disk.write(b"half a second of a flight")
    wait_for(lambda: disk.broken)
    faulty.sync_error = 0
    disk.write(b"and another")
    disk.close()  # tries once more
    assert disk.done and disk.error and b"".join(disk.unsaved()) == b"half a second of a flightand another"


class Card:
    """A card of a given size; `statvfs` reports the space its files use."""

    def __init__(self, monkeypatch, directory: Path, size: int):
        self.directory, self.size = directory, size
        monkeypatch.setattr("flightpower.daq.disk_space.free_bytes", lambda _: self.free)

    @property
    def free(self) -> int:
        return self.size - sum(path.stat().st_size for path in self.directory.glob("*"))


def finished_log(path: Path, ticks: int = 100) -> None:
    recorder = Recorder(lambda _: path, offset_ns=0)
    for tick in range(ticks):
        recorder.write([Sample("/imu", tick, Imu())], tick=tick, now_ns=tick)
    recorder.finish()
    recorder.disk.close()


def test_stop_means_stop_and_say_so_and_go_on_when_there_is_room(tmp_path, monkeypatch):
    card = Card(monkeypatch, tmp_path, 2_000_000)
    session = RecordingSession(tmp_path, keep=1_000_000)
    session.run(50)
    card.size = 900_000
    session.disk_space.check()
    session.run(10)
    assert not session.files.recording
    assert "recording stops" in session.texts[-1] and session.events[-1].severity == "error"
    card.size = 1_100_000  # not enough more to go on
    session.disk_space.check()
    session.run(10)
    assert not session.files.recording
    card.size = 3_000_000
    session.disk_space.check()
    session.run(40)
    assert session.files.close() == ""
    assert any("are free again: recording resumes" in text for text in session.texts)
    assert ticks_of(tmp_path / "log-0001.mcap") == list(range(50))
    assert ticks_of(tmp_path / "log-0002.mcap") == list(range(70, 110))


def test_recording_resumes_only_when_a_quarter_more_than_the_kept_space_is_free(tmp_path, monkeypatch):
    """Otherwise a card at its limit would stop and start the recording, each time with a new file."""
    free = 0
    monkeypatch.setattr("flightpower.daq.disk_space.free_bytes", lambda _: free)
    space = DiskSpace(tmp_path, 1_000_000, "stop")
    sufficient = {}
    for free in (1_000_000, 999_999, 1_000_001, 1_100_000, 1_249_999, 1_250_000, 1_000_000):
        space.check()
        sufficient[free] = space.sufficient
    assert [bytes_free for bytes_free, enough in sufficient.items() if not enough] == [
        999_999, 1_000_001, 1_100_000, 1_249_999,
    ]  # fmt: skip
    stops, resumes = space.events()
    assert (stops.severity, resumes.severity) == ("error", "info")
    assert "1 MB are free" in stops.text and "keeps 1 MB free" in stops.text and "1 MB are free again" in resumes.text


def test_a_file_with_nothing_but_its_first_bytes_is_not_finished(tmp_path):
    """A complete log begins and ends with them."""
    finished_log(tmp_path / "log.mcap", ticks=1)
    complete = (tmp_path / "log.mcap").read_bytes()
    assert is_finished(tmp_path / "log.mcap") and complete[:8] == complete[-8:]
    (tmp_path / "log.mcap").write_bytes(complete[:8])
    assert not is_finished(tmp_path / "log.mcap")


def test_the_oldest_finished_logs_go_first_and_only_they(tmp_path, monkeypatch):
    for number in (3, 5, 9):
        finished_log(tmp_path / f"log-{number:04d}.mcap")
    torn = tmp_path / "log-0001.mcap"
    torn.write_bytes((tmp_path / "log-0003.mcap").read_bytes()[:-20])
    (tmp_path / "log-keep.mcap").write_bytes((tmp_path / "log-0003.mcap").read_bytes())
    size = (tmp_path / "log-0003.mcap").stat().st_size
    card = Card(monkeypatch, tmp_path, 10**7)
    session = RecordingSession(tmp_path, keep=10**6, policy="delete_oldest")
    session.run(1)
    card.size = 10**6 + sum(path.stat().st_size for path in tmp_path.glob("*")) - size - 1  # two have to go
    session.disk_space.check()
    session.run(1)
    assert [path.name for path in sorted(tmp_path.glob("log-*.mcap"))] == [
        "log-0001.mcap", "log-0009.mcap", "log-0010.mcap", "log-keep.mcap",
    ]  # fmt: skip
    assert [text for text in session.texts if "deleted" in text] == [
        f"{tmp_path}/log-{n:04d}.mcap (0 MB) was deleted to free space (when_full in the tray file)" for n in (3, 5)
    ]
    card.size = 10**6
    session.disk_space.check()
    session.run(1)
    assert "no finished log is left to delete, and recording stops" in session.texts[-1]
    assert torn.exists() and (tmp_path / "log-0010.mcap").exists()
    session.files.close()


def test_a_finished_log_that_a_process_still_holds_is_not_deleted(tmp_path, monkeypatch):
    """A copying program may hold a lock, and `log_recovery` does while it completes a log."""
    path = tmp_path / "log-0001.mcap"
    finished_log(path)
    Card(monkeypatch, tmp_path, 0)
    space = DiskSpace(tmp_path, 10**6, "delete_oldest")
    with path.open("rb") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        space.check()
        assert path.exists()
    space.check()
    assert not path.exists()


def test_dropped_messages_of_earlier_files_stay_counted(tmp_path):
    session = RecordingSession(tmp_path)
    session.run(10)
    session.files._current.dropped = 7
    session.run(1, new_file=True)
    session.run(5)
    assert session.files.dropped == 7
    session.files.close()
    assert session.files.dropped == 7
