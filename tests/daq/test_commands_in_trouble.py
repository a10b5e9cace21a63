"""The installed command when something is wrong: one clear line, the right exit code, and nothing recorded is lost."""

import os
import pty
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import tty
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import pytest
from scripted_parts import counter_frame
from typer.testing import CliRunner

from flightpower.daq.__main__ import app
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import read_log

GIVE_UP_S = 120.0  # on something that hangs; generous, because the machine may be busy
needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="mounting and chattr need root")


class Counter:
    """A pulse counter on a pseudo-terminal, sending until closed."""

    def __init__(self):
        self._ours, self._theirs = pty.openpty()
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        self.path = os.ttyname(self._theirs)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._send, daemon=True)
        self._thread.start()

    def _send(self):
        sequence = 0
        while not self._stop.wait(0.01):
            try:
                os.write(self._ours, counter_frame(sequence))
            except BlockingIOError:
                pass
            sequence += 1

    def close(self):
        self._stop.set()
        self._thread.join()
        os.close(self._ours)
        os.close(self._theirs)


@pytest.fixture
def counter():
    part = Counter()
    yield part
    part.close()


def tray_file(folder: Path, port: str, extra: str = "") -> Path:
    path = folder / "tray.toml"
    sensor = f'[[sensors]]\ndriver="esc_counter"\nport="{port}"\npole_pairs=7\nframed=true\n'
    path.write_text(f'directory = "{folder}/logs"\n{extra}\n{sensor}')
    return path


def daq(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "flightpower.daq", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=GIVE_UP_S,
    )


@contextmanager
def running(tray: Path, *arguments):
    command = [sys.executable, "-m", "flightpower.daq", "run", "-c", str(tray), *arguments]
    daemon = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    lines: list[str] = []
    assert daemon.stderr is not None
    reader = threading.Thread(target=lambda: lines.extend(iter(daemon.stderr.readline, "")), daemon=True)
    reader.start()
    try:
        yield daemon, lines
    finally:
        if daemon.poll() is None:
            daemon.terminate()
            daemon.wait(GIVE_UP_S)
        reader.join(5)


def wait_for(condition, seconds=GIVE_UP_S):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)


def ticks_of(path: Path) -> list[int]:
    log = read_log(path)
    assert not log.torn
    return [entry.tick for entry in log.entries["/daq/tick"]]


@contextmanager
def card(folder: Path, option: str):
    """A folder for logs that is a file system of its own."""
    logs = folder / "logs"
    logs.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", option, "tmpfs", logs], check=True)
    try:
        yield logs
    finally:
        subprocess.run(["umount", "-l", logs], check=True)


def fill(ballast: Path):
    with ballast.open("wb", buffering=0) as stream, pytest.raises(OSError, match="No space left"):
        while True:
            stream.write(bytes(4096))


@needs_root
def test_a_card_that_fills_up_in_flight(tmp_path, counter):
    """Somebody fills a tmpfs of 3 MB and empties it again: no tick of the log is lost, and all of this is reported."""
    with card(tmp_path, "size=3m") as logs:
        tray = tray_file(tmp_path, counter.path, "[files]\nkeep_free_MB = 0")
        with running(tray) as (daemon, lines):
            wait_for(lambda: any("recording" in line for line in lines))
            ballast = logs / "ballast"
            fill(ballast)
            wait_for(lambda: any("No space left on device" in line for line in lines))
            ballast.unlink()
            wait_for(lambda: any("written again, nothing was lost" in line for line in lines))
            daemon.send_signal(signal.SIGTERM)
            assert daemon.wait(GIVE_UP_S) == 0
        ticks = ticks_of(logs / "log-0001.mcap")
        missed = sum(e.message.missed for e in read_log(logs / "log-0001.mcap").entries["/daq/tick"])
        assert len(ticks) + missed == ticks[-1] + 1


@needs_root
def test_a_card_that_stays_full_costs_only_the_rest(tmp_path, counter):
    with card(tmp_path, "size=1m") as logs:
        tray = tray_file(tmp_path, counter.path, "[files]\nkeep_free_MB = 0")
        with running(tray) as (daemon, lines):
            wait_for(lambda: (logs / "log-0001.mcap").exists() and (logs / "log-0001.mcap").stat().st_size > 9000)
            before = (logs / "log-0001.mcap").read_bytes()
            fill(logs / "ballast")
            wait_for(lambda: any("No space left on device" in line for line in lines))
            daemon.send_signal(signal.SIGTERM)
            assert daemon.wait(GIVE_UP_S) == 1
        assert "a part of the recording is missing" in lines[-1] and "No space left" in lines[-1]
        assert (logs / "log-0001.mcap").read_bytes()[: len(before)] == before
        assert len(read_log(logs / "log-0001.mcap").entries["/daq/tick"]) >= 10


@needs_root
@pytest.mark.parametrize(("option", "cure", "cause"), [
    ("ro", "remount,rw", "Read-only file system"),
    ("nr_inodes=1", "remount,nr_inodes=50", "No space left on device"),
])  # fmt: skip
def test_a_card_that_takes_no_file_at_power_on(tmp_path, counter, option, cure, cause):
    """The daemon waits and reports it, as with a full disk; the measurements of that time are in the log."""
    with card(tmp_path, option) as logs, running(tray_file(tmp_path, counter.path)) as (daemon, lines):
        wait_for(lambda: any("kept in memory" in line and cause in line for line in lines))
        assert daemon.poll() is None and not list(logs.iterdir())
        subprocess.run(["mount", "-o", cure, logs], check=True)
        wait_for(lambda: any("written again, nothing was lost" in line for line in lines))
        daemon.send_signal(signal.SIGTERM)
        assert daemon.wait(GIVE_UP_S) == 0
        assert ticks_of(logs / "log-0001.mcap")[0] == 0


@needs_root
def test_a_read_only_file_is_asked_for(tmp_path, counter):
    """A log file that was named has to be written: the command ends with one line before it reads anything."""
    with card(tmp_path, "ro") as logs:
        done = daq("run", "-c", tray_file(tmp_path, counter.path), "-o", logs / "mine.mcap")
        assert done.returncode == 2
        assert "Read-only file system" in done.stderr and len(done.stderr.strip().splitlines()) == 1


def test_sighup_begins_a_new_log_and_nothing_is_lost_between(tmp_path, counter):
    with running(tray_file(tmp_path, counter.path)) as (daemon, lines):
        for number in (1, 2, 3):
            path = tmp_path / "logs" / f"log-{number:04d}.mcap"
            wait_for(lambda path=path: path.exists() and path.stat().st_size > 7000)
            if number < 3:
                daemon.send_signal(signal.SIGHUP)
        daemon.send_signal(signal.SIGTERM)
        assert daemon.wait(GIVE_UP_S) == 0
    logs = [read_log(path) for path in sorted((tmp_path / "logs").glob("*.mcap"))]
    ticks = [entry for log in logs for entry in log.entries["/daq/tick"]]
    assert len(logs) == 3 and not any(log.torn for log in logs)
    assert all(b.tick - a.tick == 1 + b.message.missed for a, b in pairwise(ticks))
    assert sum("recording" in line and "log-000" in line for line in lines) >= 3


def test_an_unwritable_device(tmp_path):
    """The only device may not be opened, which is a failure, and the message names it."""
    device = tmp_path / "tty"
    device.touch(mode=0o000)
    done = daq("run", "-c", tray_file(tmp_path, str(device)))
    assert done.returncode == 1
    assert str(device) in done.stderr and len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "logs").exists()


@pytest.mark.parametrize("command", ["run", "check", "zero"])
def test_a_wrong_tray_file_is_refused_with_its_key(tmp_path, command):
    """Each mistake is one of test_tray_config; here each command reads the file first."""
    tray = tray_file(tmp_path, "/dev/ttyUSB0", '[files]\nwhen_full = "panic"\n')
    result = CliRunner().invoke(app, [command, "-c", str(tray)])
    assert isinstance(result.exception, InputError)
    assert "files.when_full" in str(result.exception) and "\n" not in str(result.exception)
    assert not (tmp_path / "logs").exists()


def test_check_says_what_is_wrong_and_leaves_with_1(tmp_path):
    done = daq("check", "-c", tray_file(tmp_path, "/dev/ttyUSB-none"), "--seconds", "1")
    assert done.returncode == 1
    assert "/rpm" in done.stdout and "BAD" in done.stdout and "wiring" in done.stdout
    assert "not fit to fly" in done.stdout


@pytest.mark.parametrize("command", ["check", "zero"])
def test_away_from_the_aircraft_s_computer_one_line_says_so(tmp_path, command):
    two = tray_file(tmp_path, "/dev/ttyUSB-none")
    autopilot = '[[sensors]]\ndriver = "autopilot"\nport = "/dev/ttyACM-none"\nbaud = 57600\n'
    two.write_text(two.read_text() + autopilot)
    done = daq(command, "-c", two, "--seconds", "4")
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith(
        "daq: none of the tray's devices is here (/dev/ttyUSB-none, /dev/ttyACM-none): run this"
    )
    assert done.stderr.count("\n") == 1


def test_a_terminal_that_is_closed_finishes_the_log(tmp_path, counter):
    """A hang-up from the terminal does not ask for a new file, since nobody could stop that recording any more."""
    tray = tray_file(tmp_path, counter.path)
    log = tmp_path / "logs" / "log-0001.mcap"
    pid, terminal = pty.fork()
    if pid == 0:
        os.execv(sys.executable, [sys.executable, "-m", "flightpower.daq", "run", "-c", str(tray)])
    os.set_blocking(terminal, False)
    shown = b""

    def recording():
        nonlocal shown
        try:
            shown += os.read(terminal, 65536)
        except BlockingIOError:
            pass
        return log.exists() and log.stat().st_size > 7000

    wait_for(recording)
    os.close(terminal)
    wait_for(lambda: os.waitpid(pid, os.WNOHANG)[0] == pid)
    assert not read_log(log).torn
    assert b"\r" in shown and b"ticks" in shown  # the status line


def test_systemd_is_reported_when_it_is_ready_that_it_ticks_and_how_it_goes(tmp_path, counter, monkeypatch):
    address = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(address))
        manager.settimeout(GIVE_UP_S)
        monkeypatch.setenv("NOTIFY_SOCKET", str(address))
        with running(tray_file(tmp_path, counter.path)) as (daemon, _):
            contents = [manager.recv(4096).decode() for _ in range(3)]
            daemon.terminate()
            last = manager.recv(4096).decode()
            while "STOPPING" not in last:
                last = manager.recv(4096).decode()
    assert contents[0].startswith("READY=1\nSTATUS=recording ")
    assert re.match(r"WATCHDOG=1\nSTATUS=recording .*, \d+ ticks, \d+ missed", contents[1])
    assert last == "STOPPING=1"
