"""The status page says what the daemon does, in a browser too, and cannot change anything."""

import shutil
import socket
import subprocess
import sys
import threading
from datetime import UTC, datetime
from importlib import resources
from urllib.request import urlopen

import msgspec
import pytest
import waitress
from test_daemon import SteadySensorTruth, default_tray

from flightpower.daq import recording_status
from flightpower.daq.config import load_tray
from flightpower.daq.daemon import record
from flightpower.daq.recording_status import PublishedStatus, RecordingState, RecordingStatus, StatusFile
from flightpower.daq.sensor_health import SensorState
from flightpower.daq.status_page import SERVER, _reachable, application, page, sources_of
from flightpower.daq.still_air_zero import FORMAT, Zero
from flightpower.flight.messages import Event
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.faults import Fault
from flightpower.hw_fakes.tray import FakeTray, TrayVariant
from flightpower.sim.output_folder import TRAY
from flightpower.simulate import _record
from tests.browser import HANGS_S

EXAMPLE_TRAY = resources.files("flightpower.daq").joinpath("tray.example.toml").read_text("utf-8")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """The files that a recording with a dead barometer leaves."""
    folder = tmp_path_factory.mktemp("status")
    clock = SimulatedClock()
    faults = [Fault(kind="no_acknowledge", device="baro", start_s=3.0)]
    fake = FakeTray(SteadySensorTruth(), clock, faults=faults)
    tray = default_tray(folder, fake)
    sources = sources_of(tray, folder / "status.json")
    file = StatusFile(sources.status)
    file.add(Event(severity="warning", text="<script>alert(1)</script>"))
    record(
        tray, buses=fake, clock=clock, until_ns=clock.now_ns() + 12 * 10**9, report=file.write, on_event=file.add
    )  # fmt: skip
    return sources


def now_s(sources) -> float:
    return sources.status.stat().st_mtime + 1


def test_what_is_wrong_is_in_the_headline(sources):
    text = page(sources, now_s(sources))
    assert '<h1 class="bad">recording 0 min, 25 Hz: baro failed' in text
    assert "baro failed: " in text
    assert "log-0001_2016-05-14_093000Z.mcap" in text
    assert "<script>" not in text and "&lt;script&gt;" in text


def test_events_have_the_time_at_which_they_were_reported(sources, monkeypatch, tmp_path):
    monkeypatch.setattr(recording_status.time, "time", lambda: 1_795_358_402.0)  # 2026-11-22 14:40:02 UTC
    file = StatusFile(tmp_path / "status.json")
    file.add(Event(text="log-0002.mcap was started"))
    published = msgspec.json.decode(sources.status.read_bytes(), type=PublishedStatus)
    file.write(published.status)
    text = page(sources._replace(status=tmp_path / "status.json"), 0.0)
    assert '<td>14:40:02 info</td><td class="good">log-0002.mcap was started</td>' in text


def test_a_daemon_that_has_stopped_is_noticed(sources, tmp_path):
    """Its last values are gray, and say when they were read; what lies on the disk is as it was."""
    last_s = sources.status.stat().st_mtime
    text = page(sources, last_s + 60)
    last = f"{datetime.fromtimestamp(last_s, UTC):%H:%M:%S}"
    assert f'<h1 class="bad">No answer since {last} UTC' in text
    stale, current = text.split('<section class="stale">')[1].split("</section>")
    assert f"<h2>Last at {last}</h2>" in stale and "baro" in stale and "<h2>Logs</h2>" in current
    assert "stale" not in page(sources, last_s + 1).split("</style>")[1]
    nothing = sources._replace(status=tmp_path / "absent.json")
    assert '<h1 class="bad">The daemon does not run</h1>' in page(nothing, 0.0)
    torn = tmp_path / "torn.json"
    torn.write_bytes(sources.status.read_bytes()[:-5])
    assert "The daemon does not run" in page(sources._replace(status=torn), 0.0)


def test_zero_and_check_are_reported(sources, tmp_path):
    assert "not taken" in page(sources, now_s(sources)) and "not made" in page(sources, now_s(sources))
    zero = Zero(format=FORMAT, taken_unix_ns=1_795_358_402 * 10**9, seconds=10, temperature_K={}, readings={})
    (tmp_path / "zero.json").write_bytes(msgspec.json.encode(zero))
    (tmp_path / "check.json").write_text('{"fit": false, "lines": [{"topic": "/gps", "ok": false}], "facts": []}')
    text = page(sources._replace(zero=tmp_path / "zero.json", check=tmp_path / "check.json"), now_s(sources))
    assert "taken 2026-11-22 14:40 UTC" in text and "not fit to fly: /gps" in text


@pytest.mark.parametrize(
    ("method", "path", "status"),
    [("GET", "/", "200"), ("HEAD", "/", "200"), ("POST", "/", "405"), ("GET", "/../etc/passwd", "404")],
)
def test_it_can_only_be_read(sources, method, path, status):
    answers = []
    application(sources)({"REQUEST_METHOD": method, "PATH_INFO": path}, lambda line, headers: answers.append(line))
    assert answers[0].startswith(status)


def test_connections_that_ask_for_nothing_do_not_shut_others_out(sources):
    with socket.create_server(("127.0.0.1", 0), backlog=256) as listener:
        server = waitress.create_server(application(sources), sockets=[listener], **SERVER)
        threading.Thread(target=server.run, daemon=True).start()
        address = listener.getsockname()
        idle = [socket.create_connection(address) for _ in range(150)]
        with socket.create_connection(address, timeout=HANGS_S) as phone:
            phone.sendall(b"GET / HTTP/1.0\r\n\r\n")
            answer = phone.recv(12)
        for connection in idle:
            connection.close()
        server.close()
    assert answer == b"HTTP/1.0 200"


def test_the_command_prints_the_address_at_which_the_page_answers(tmp_path):
    (tmp_path / "tray.toml").write_text(EXAMPLE_TRAY, "utf-8")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "flightpower.daq", "status", "--config", str(tmp_path / "tray.toml")]
    arguments = ["--file", str(tmp_path / "absent.json"), "--listen", f"127.0.0.1:{port}"]
    with subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, text=True) as served:
        try:
            address = served.stdout.readline().strip()
            assert address == f"http://127.0.0.1:{port}/"
            with urlopen(address, timeout=HANGS_S) as answer:
                assert "The daemon does not run" in answer.read().decode()
        finally:
            served.terminate()


def test_a_simulated_flight_shows_its_state_while_it_is_recorded(tmp_path):
    """Away from a Pi it is in the same file as from `daq run --status`, and there is none once the flight has ended."""
    (tmp_path / TRAY).write_text(EXAMPLE_TRAY, "utf-8")
    flight, shown = SteadySensorTruth(), []
    flight.duration_s = 4.0
    sources = sources_of(load_tray(tmp_path / TRAY), tmp_path / "status.json")

    def look(elapsed_s: float) -> None:
        if sources.status.exists():
            shown.append(page(sources, now_s(sources)))

    _record(
        tmp_path, flight, TrayVariant(), seed=0, faults=(), real_time=False, status=sources.status, report=look
    )  # fmt: skip
    assert shown and "recording 0 min, 25 Hz" in shown[-1] and " info</td>" in shown[-1]
    assert not sources.status.exists()


def test_an_address_of_all_networks_is_shown_as_one_that_a_browser_reaches():
    assert _reachable("0.0.0.0") not in ("0.0.0.0", "")
    assert _reachable("192.168.4.1") == "192.168.4.1" and _reachable("::1") == "[::1]"


def test_a_state_that_cannot_be_written_is_reported_once(tmp_path, capsys):
    file = StatusFile(tmp_path / "absent" / "status.json")
    status = RecordingStatus(
        state=RecordingState.RECORDING, log="log-0001.mcap", elapsed_s=1.0, ticks=25, missed=0, rate_Hz=25.0,
        free_bytes=None, error="", sensors={}, slow=[],
    )  # fmt: skip
    for _ in range(3):
        file.write(status)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and "absent/status.json: the status cannot be written (No such file" in lines[0]


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)")
def test_a_browser_shows_it(sources, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as listener:
        server = waitress.create_server(application(sources), sockets=[listener], threads=1)
        threading.Thread(target=server.run, daemon=True).start()
        address = f"http://127.0.0.1:{listener.getsockname()[1]}/"
        quiet = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-sync"]
        arguments = [*quiet, f"--user-data-dir={tmp_path}", "--enable-logging=stderr", "--dump-dom", address]
        shown = subprocess.run([str(CHROMIUM), *arguments], capture_output=True, text=True, timeout=HANGS_S)
        server.close()
    assert "baro failed" in shown.stdout or "No answer since" in shown.stdout
    assert ":CONSOLE" not in shown.stderr


def test_what_is_free_on_the_card_is_reported_in_gigabytes(sources, tmp_path):
    file = StatusFile(tmp_path / "status.json")
    status = RecordingStatus(
        state=RecordingState.RECORDING, log="log-0001.mcap", elapsed_s=750.0, ticks=18750, missed=3, rate_Hz=25.0,
        free_bytes=12_340_000_000, error="", sensors={"imu": SensorState.OK}, slow=[],
    )  # fmt: skip
    file.write(status)
    text = page(sources._replace(status=tmp_path / "status.json"), (tmp_path / "status.json").stat().st_mtime + 1)
    assert "recording 12 min, 25 Hz, all well" in text and "12.3 GB" in text and "18750, 3 missed" in text
    assert ", 12.3 GB free" in status.line
