"""Old files in the log folder: none of them ends or delays a recording, and none takes unbounded memory or time."""

import errno
import fcntl
import os
import signal
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import zstandard
from mcap.opcode import Opcode
from test_commands_in_trouble import GIVE_UP_S, counter, running, tray_file, wait_for  # noqa: F401
from test_daemon import fly

from flightpower.daq.background_recovery import BackgroundRecovery
from flightpower.daq.log_list import list_logs
from flightpower.daq.log_recovery import recover, recovery_event
from flightpower.flight.errors import InputError
from flightpower.flight.log_chunk import MAX_CHUNK_BYTES
from flightpower.flight.log_index import MAGIC, RECORD_HEAD
from flightpower.flight.log_reader import read_log

MOST_RESIDENT_KiB = 150_000  # of a command that reads a hostile file; the command itself takes 50,000
BOMB_BYTES = 2**28


@pytest.fixture(scope="module")
def complete_log(tmp_path_factory):
    return fly(tmp_path_factory.mktemp("whole"), 4).path.read_bytes()


def chunk_starts(log: bytes) -> list[int]:
    starts, offset = [], len(MAGIC)
    while offset < len(log) and log[offset] != Opcode.DATA_END:
        opcode, length = RECORD_HEAD.unpack_from(log, offset)
        starts += [offset] * (opcode == Opcode.CHUNK)
        offset += RECORD_HEAD.size + length
    return starts


@pytest.fixture(scope="module")
def torn(complete_log):
    return complete_log[: chunk_starts(complete_log)[-1] + 200]  # within the last chunk


@pytest.fixture(scope="module")
def poison(torn):
    """A log with an attachment whose name is not valid text: completing the log raises UnicodeDecodeError."""
    return torn.replace(b"aircraft.toml", b"\xfa" * 13, 1)


def chunk_record(compressed: bytes, size: int) -> bytes:
    content = struct.pack("<QQQII", 0, 1, size, 0, 4) + b"zstd" + struct.pack("<Q", len(compressed)) + compressed
    return RECORD_HEAD.pack(Opcode.CHUNK, len(content)) + content


@pytest.fixture(scope="module", params=["size in the frame", "size not in the frame"])
def bomb(request, complete_log):
    """A torn log of some kilobytes whose last chunk decompresses to BOMB_BYTES of zeros."""
    size_is_stated = request.param == "size in the frame"
    compressor = zstandard.ZstdCompressor().compressobj(size=BOMB_BYTES if size_is_stated else -1)
    block = bytes(2**22)
    data = b"".join([*(compressor.compress(block) for _ in range(BOMB_BYTES // len(block))), compressor.flush()])
    return complete_log[: chunk_starts(complete_log)[1]] + chunk_record(data, BOMB_BYTES)


MEASURE = """if True:
    import resource, subprocess, sys
    code = subprocess.run([sys.executable, "-m", *sys.argv[1:]], stderr=subprocess.STDOUT).returncode
    print("\\n", code, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"""


def resident_KiB(*command) -> tuple[int, str, int]:
    """Exit code, output and largest resident memory of a command.

    A small process starts it: Linux counts the memory of the process that forks as the child's.
    """
    arguments = [sys.executable, "-c", MEASURE, *map(str, command)]
    output = subprocess.run(arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True).stdout
    *lines, last = output.splitlines(keepends=True)
    code, memory_KiB = map(int, last.split())
    return code, "".join(lines), memory_KiB


def test_one_bad_file_stops_neither_the_recording_nor_the_completion_of_the_others(tmp_path, counter, torn, poison):  # noqa: F811
    logs = tmp_path / "logs"
    logs.mkdir()
    (logs / "log-0001.mcap").write_bytes(poison)
    (logs / "log-0002.mcap").mkdir()
    (logs / "log-0003.mcap").write_bytes(torn)
    with running(tray_file(tmp_path, counter.path)) as (daemon, lines):
        wait_for(lambda: any("log-0003.mcap was unfinished and has been completed" in line for line in lines))
        wait_for(lambda: read_when_there(logs / "log-0004.mcap"))
        daemon.send_signal(signal.SIGTERM)
        assert daemon.wait(GIVE_UP_S) == 0
    assert (logs / "log-0001.mcap").read_bytes() == poison
    assert any("log-0001.mcap is unfinished and cannot be completed (UnicodeDecodeError" in line for line in lines)
    assert any("log-0002.mcap" in line and "Is a directory" in line for line in lines)
    assert not read_log(logs / "log-0003.mcap").torn
    texts = [entry.message.text for entry in read_log(logs / "log-0004.mcap").entries["/daq/event"]]
    assert any("log-0001.mcap" in text for text in texts) and any("log-0003.mcap" in text for text in texts)


def test_a_file_without_a_byte_is_removed_and_told_unless_it_is_being_recorded(tmp_path):
    """A power cut leaves such a file between its name and its first bytes; it is not an unreadable log."""
    path = tmp_path / "log-0001.mcap"
    path.touch()
    with path.open("rb") as recording:
        fcntl.flock(recording, fcntl.LOCK_EX)
        assert recovery_event(path) is None and path.exists()
        assert [log.state for log in list_logs(tmp_path)] == ["empty"]
    assert str(path) in recovery_event(path).text and not path.exists()
    path.write_bytes(MAGIC)  # not without a byte: whatever it is, it stays
    assert recovery_event(path) is None and path.read_bytes() == MAGIC


def read_when_there(path: Path) -> bool:
    try:
        return "/daq/event" in read_log(path).entries
    except InputError:
        return False


def test_a_log_that_may_not_be_written_is_named_and_the_next_is_completed(tmp_path, monkeypatch, torn, complete_log):
    paths = [tmp_path / f"log-000{number}.mcap" for number in (1, 2, 3)]
    for path, content in zip(paths, (torn, torn, complete_log), strict=True):
        path.write_bytes(content)
    opening = Path.open

    def refuse(path, mode="r", **named):
        if path in (paths[0], paths[2]) and "+" in mode:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return opening(path, mode, **named)

    monkeypatch.setattr(Path, "open", refuse)
    refused, completed, nothing = [recovery_event(path) for path in paths]
    assert refused.severity == "warning" and f"{paths[0]} is unfinished" in refused.text
    assert "Permission denied" in refused.text
    assert "has been completed" in completed.text
    assert nothing is None  # a finished log need not be writable


def test_recording_begins_before_old_logs_are_completed(tmp_path, monkeypatch, torn):
    """This holds while a process that completes one hangs."""
    path = tmp_path / "log-0001.mcap"
    path.write_bytes(torn)
    recovery = BackgroundRecovery([path])
    release = threading.Event()
    monkeypatch.setattr(recovery, "_run", lambda command, on_cycle: (release.wait(GIVE_UP_S), 3)[1])
    recovery.start()
    assert recovery.events() == []
    release.set()
    assert "ended with exit code 3" in first_event(recovery).text


def first_event(recovery):
    deadline = time.monotonic() + GIVE_UP_S
    while not (events := recovery.events()):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return events[0]


def test_a_process_that_is_killed_is_reported_with_its_file(tmp_path, monkeypatch, torn):
    path = tmp_path / "log-0001.mcap"
    path.write_bytes(torn)
    recovery = BackgroundRecovery([path])
    run = recovery._run
    killing = [sys.executable, "-c", "import os; os.kill(os.getpid(), 9)"]
    monkeypatch.setattr(recovery, "_run", lambda command, on_cycle: run(killing, on_cycle))
    recovery.start()
    event = first_event(recovery)
    assert str(path) in event.text and "signal 9" in event.text
    assert path.read_bytes() == torn


def test_stopping_ends_the_process_at_once(tmp_path, monkeypatch, torn):
    path = tmp_path / "log-0001.mcap"
    path.write_bytes(torn)
    recovery = BackgroundRecovery([path])
    run = recovery._run
    monkeypatch.setattr(
        recovery,
        "_run",
        lambda _, on_cycle: run([sys.executable, "-c", f"import time; time.sleep({GIVE_UP_S})"], on_cycle),
    )
    recovery.start()
    deadline = time.monotonic() + GIVE_UP_S
    while not recovery._process_id:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    begin = time.monotonic()
    recovery.stop()
    recovery._thread.join(GIVE_UP_S)
    assert time.monotonic() - begin < GIVE_UP_S / 2 and recovery.events() == []


def test_the_process_has_no_real_time_priority(tmp_path):
    """It inherits none of the daemon, and leaves nine tenths of a processor to others that compute."""
    recovery, lines = BackgroundRecovery([]), []
    show = "import os; print(os.sched_getscheduler(0), os.nice(0))\nfrom daq import background_recovery as b\n"
    show += "b.yield_to_others(); print(os.sched_getscheduler(0), os.nice(0))"
    assert recovery._run([sys.executable, "-c", show], lines.append) == 0
    before, after = ([int(word) for word in line.split()] for line in lines)
    assert before[0] == after[0] == os.SCHED_OTHER and after[1] == min(before[1] + 10, 19)


@pytest.mark.thorough
def test_twenty_logs_are_completed_within_a_minute_beside_busy_programs(tmp_path, torn):
    """Twenty kills in a row leave such logs; two programs per processor compute all the time."""
    paths = [tmp_path / f"log-{number:04}.mcap" for number in range(1, 21)]
    for path in paths:
        path.write_bytes(torn)
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2 * (os.cpu_count() or 1))]
    recovery, events, begin = BackgroundRecovery(paths), [], time.monotonic()
    try:
        recovery.start()
        while len(events) < len(paths):
            events += recovery.events()
            assert time.monotonic() - begin < 60
            time.sleep(0.05)
    finally:
        recovery.stop()
        for program in busy:
            program.kill()
            program.wait()
    assert all("has been completed" in event.text for event in events)
    assert not any(read_log(path).torn for path in paths)


def test_a_log_that_the_process_dies_of_costs_only_itself(tmp_path, monkeypatch, torn):
    """It dies of the second of three logs, and another process completes the third."""
    paths = [tmp_path / f"log-{number:04}.mcap" for number in range(1, 4)]
    for path in paths:
        path.write_bytes(torn)
    dies = f"""if True:
        import os
        from flightpower.daq import background_recovery as b
        complete = b.recovery_event
        b.recovery_event = lambda path: os.kill(os.getpid(), 9) if path.name == {paths[1].name!r} else complete(path)
        b.main()"""
    recovery = BackgroundRecovery(paths)
    run = recovery._run
    monkeypatch.setattr(
        recovery, "_run", lambda command, on_cycle: run([sys.executable, "-c", dies, *command[3:]], on_cycle)
    )
    recovery.start()
    recovery._thread.join(GIVE_UP_S)
    first, second, third = recovery.events()
    assert str(paths[1]) in second.text and "signal 9" in second.text and paths[1].read_bytes() == torn
    for path, event in ((paths[0], first), (paths[2], third)):
        assert str(path) in event.text and not read_log(path).torn


def test_completing_a_log_ends_at_its_time_limit(tmp_path):
    code = """if True:
        from flightpower.daq import background_recovery as b
        b.CPU_S = 1
        b.limit_resources(1)
        b.allow_time_for_a_log()
        try:
            while True: sum(range(1000))
        except TimeoutError as error:
            print(error, b.time.process_time() > 1)"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=GIVE_UP_S)
    assert "more than 1 s" in done.stdout and "True" in done.stdout


def test_a_small_file_with_a_huge_chunk_is_read_up_to_it_in_bounded_memory(tmp_path, bomb):
    path = tmp_path / "log-0001.mcap"
    path.write_bytes(bomb)
    assert len(bomb) < 100_000 and MAX_CHUNK_BYTES * 8 < BOMB_BYTES
    code, output, memory_KiB = resident_KiB("daq", "info", path)
    assert code == 0 and "/imu" in output and memory_KiB < MOST_RESIDENT_KiB
    assert "a chunk decompresses to more than 16 MiB, the limit" in " ".join(output.split())
    _, output, memory_KiB = resident_KiB("flightpower.daq.background_recovery", path)
    assert f"{path} is unfinished and cannot be completed (a chunk decompresses to more than 16 MiB" in output
    assert memory_KiB < MOST_RESIDENT_KiB and path.read_bytes() == bomb


def test_a_log_with_nothing_but_a_huge_chunk_is_refused_with_its_name_and_the_limit(tmp_path, bomb, complete_log):
    path = tmp_path / "bomb.mcap"
    path.write_bytes(complete_log[: chunk_starts(complete_log)[0]] + bomb[chunk_starts(bomb)[1] :])
    for command in (["daq", "info", path], ["flightpower.analysis.cli.analyze", path]):
        code, output, memory_KiB = resident_KiB(*command)
        assert code == 2 and str(path) in output and "16 MiB, the limit" in output, output
        assert len(output.strip().splitlines()) == 1
        assert memory_KiB < 2 * MOST_RESIDENT_KiB


def test_many_chunks_that_are_each_permitted_are_bounded_too(tmp_path, complete_log):
    unknown = RECORD_HEAD.pack(0x80, MAX_CHUNK_BYTES - RECORD_HEAD.size) + bytes(MAX_CHUNK_BYTES - RECORD_HEAD.size)
    chunk = chunk_record(zstandard.compress(unknown), MAX_CHUNK_BYTES)
    path = tmp_path / "bomb.mcap"
    path.write_bytes(complete_log[: chunk_starts(complete_log)[1]] + chunk * 8)
    log = read_log(path)
    assert log.entries["/imu"] and "the limit for its size" in log.torn


def test_a_record_beyond_the_limit_leaves_the_file_as_it_is(tmp_path, torn, monkeypatch):
    monkeypatch.setattr("flightpower.daq.log_recovery.MAX_RECORD_BYTES", 1000)
    path = tmp_path / "log-0001.mcap"
    path.write_bytes(torn)
    assert "a record is larger than" in recovery_event(path).text and path.read_bytes() == torn
    monkeypatch.undo()
    assert recover(path) is not None


def test_deeply_nested_json_is_one_message_that_cannot_be_decoded(tmp_path, complete_log):
    from flightpower.flight.log_writer import LogWriter
    from flightpower.flight.messages import Imu

    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        log = LogWriter(stream)
        log.write("/imu", Imu(), time_ns=1, tick=1)
        log.write_encoded(1, b'{"a":' * 200_000 + b"1" + b"}" * 200_000, time_ns=2, tick=2)
        log.write("/imu", Imu(), time_ns=3, tick=3)
        log.finish()
    read = read_log(path)
    assert [entry.tick for entry in read.entries["/imu"]] == [1, 3] and read.undecodable == 1 and not read.torn
