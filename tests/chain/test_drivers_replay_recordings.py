"""Recordings of the buses, played back: the same bytes give the same messages, and a changed driver is rejected.

Recordings in `tests/recordings/` are of parts that once were on somebody's bench; each has to stay readable.
"""

import json
import sys
from pathlib import Path

import pytest

from flightpower.daq.bus_recording import BusRecording
from flightpower.daq.config import parse_tray
from flightpower.daq.daemon import record
from flightpower.daq.driver_factory import driver_factory
from flightpower.daq.sensors.esc_counter import EscCounterDriver
from flightpower.daq.sensors.mpu9250 import MPU9250Driver, Ranges
from flightpower.daq.sensors.ms56xx import MS5611, MS56xxDriver
from flightpower.flight.aircraft import parse_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import Status
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.faults import Fault
from flightpower.hw_fakes.replay import RecordedTransfers, RecordingMismatch, load_recording, replay
from flightpower.hw_fakes.tray import FakeTray

sys.path.append(str(Path(__file__).parents[1] / "hw_fakes"))
from analytic_sensor_truth import AnalyticSensorTruth, sine

EXAMPLE = Path(__file__).parents[2] / "daq" / "tray.example.toml"
RECORDINGS = sorted((Path(__file__).parents[1] / "recordings").glob("*.jsonl"))
FAULTS = [
    Fault(kind="brown_out", device="imu", start_s=3.0, duration_s=0.5),
    Fault(kind="no_acknowledge", device="static", start_s=3.0, duration_s=0.7),
    Fault(kind="unplugged", device="gps", start_s=4.0, duration_s=1.0),
    Fault(kind="checksum_errors", device="autopilot", start_s=4.0, duration_s=1.0, rate=0.1),
]


def drivers(recording: RecordedTransfers):
    """(sensor, its topics, maker of its driver) for each sensor of a recording."""
    tray = parse_tray(recording.tray, "recorded tray", Path())
    aircraft = parse_aircraft(recording.aircraft, "recorded aircraft") if recording.aircraft else None
    return [
        (table.name, table.topics, lambda buses, table=table: driver_factory(table, tray, buses, aircraft)())
        for table in tray.sensors
    ]


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Eight seconds of the whole fake tray, with some failures: the recording, and the log that was written."""
    folder = tmp_path_factory.mktemp("bench")
    clock = SimulatedClock(start_ns=3_000_000_000)
    fake = FakeTray(AnalyticSensorTruth(differential_Pa=sine(100.0, 50.0, 0.5)), clock, 2, faults=FAULTS)
    tray = parse_tray(EXAMPLE.read_text(), "tray.toml", folder)
    buses = BusRecording(folder / "bench.jsonl", clock)
    recording = record(tray, buses=fake, clock=clock, until_ns=clock.now_ns() + 8 * 10**9, bus_recording=buses)
    assert buses.close() == ""
    return folder / "bench.jsonl", read_log(recording.path)


def test_the_same_bytes_give_the_same_messages(bench):
    path, log = bench
    recording = load_recording(path)
    for sensor, topics, make in drivers(recording):
        played = [sample for turn in replay(recording, sensor, make) for sample in turn.samples]
        for topic in topics:
            measured = [e.message for e in log.entries[topic] if e.message.status is Status.OK]
            again = [s.message for s in played if s.topic == topic and s.message.status is Status.OK]
            assert again == measured and len(again) > 10, topic


def test_what_failed_on_the_bench_fails_again(bench):
    path, _ = bench
    recording = load_recording(path)
    makers = {sensor: make for sensor, _, make in drivers(recording)}
    failures = {
        sensor: [t.failure for t in replay(recording, sensor, make) if t.failure] for sensor, make in makers.items()
    }
    assert {error.errno for error in failures["static"]} == {121}
    assert {error.errno for error in failures["gps"]} >= {5}  # unplugged; then gone, errno 2
    assert failures["imu"] and not failures["baro"]


def as_json(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_the_file_is_lines_of_json_that_belong_to_one_sensor_each(bench):
    path, _ = bench
    head, *lines = as_json(path)
    assert head["tray"] == EXAMPLE.read_text() and "Nexstar" in head["aircraft"]
    assert {line["do"] for line in lines} == {"make", "open", "turn", "read", "write", "write_read"}
    transfers = [line for line in lines if "address" in line]
    assert all("errno" in line or "received" in line or line["do"] == "write" for line in transfers)
    assert [line["t_ns"] for line in lines] == sorted(line["t_ns"] for line in lines)
    assert {line["sensor"] for line in lines} == {name for name, _, _ in drivers(load_recording(path))}


@pytest.mark.parametrize(
    ("sensor", "changed"),
    [
        ("imu", lambda buses: MPU9250Driver(buses.i2c("/dev/i2c-1"), ranges=Ranges(g=16))),  # another byte
        ("imu", lambda buses: MPU9250Driver(buses.i2c("/dev/i2c-1"), address=0x69)),  # another place
        ("imu", lambda buses: MPU9250Driver(buses.i2c("/dev/i2c-1"), fifo=False)),  # another way of reading
        ("imu", lambda buses: MPU9250Driver(buses.i2c("/dev/i2c-7"))),  # another bus
        ("baro", lambda buses: MS56xxDriver(buses.i2c("/dev/i2c-1"), 0x77, MS5611, topic="/baro", period_s=0.01)),
        ("rpm", lambda buses: EscCounterDriver(buses.port("/dev/ttyUSB0", 9600), pole_pairs=7)),
    ],
)
def test_a_driver_that_does_something_else_is_objected_to(bench, sensor, changed):
    with pytest.raises(RecordingMismatch, match="was recorded"):
        list(replay(load_recording(bench[0]), sensor, changed))


class Lazy(MPU9250Driver):
    def read(self, now_ns):
        return []


class Eager(MPU9250Driver):
    def read(self, now_ns):
        super().read(now_ns)
        return super().read(now_ns)


@pytest.mark.parametrize("changed", [Lazy, Eager])
def test_a_driver_that_does_less_or_more_is_objected_to(bench, changed):
    with pytest.raises(RecordingMismatch):
        list(replay(load_recording(bench[0]), "imu", lambda buses: changed(buses.i2c("/dev/i2c-1"))))


def test_a_recording_torn_by_a_power_cut_is_played_to_its_tear(bench, tmp_path):
    path, _ = bench
    content = path.read_bytes()
    for cut in range(len(content) // 2, len(content) // 2 + 400, 7):
        (tmp_path / "torn.jsonl").write_bytes(content[:cut])
        recording = load_recording(tmp_path / "torn.jsonl")
        for sensor, _, make in drivers(recording):
            assert all(turn.samples is not None for turn in replay(recording, sensor, make))


@pytest.mark.parametrize("content", [None, b"", b"{}\n", b"[1]\n", b'{"format": "other"}\n', b"\xff\n"])
def test_what_is_no_recording_is_refused_in_one_line(tmp_path, content):
    if content is not None:
        (tmp_path / "x.jsonl").write_bytes(content)
    with pytest.raises(InputError, match=r"x\.jsonl"):
        load_recording(tmp_path / "x.jsonl")


def test_a_recording_is_never_overwritten(bench):
    with pytest.raises(InputError, match="exists already"):
        BusRecording(bench[0], SimulatedClock())


@pytest.mark.parametrize("path", RECORDINGS, ids=[path.stem for path in RECORDINGS])
def test_what_was_recorded_on_a_bench_is_still_understood(path):
    recording = load_recording(path)
    for sensor, topics, make in drivers(recording):
        played = [s for turn in replay(recording, sensor, make) for s in turn.samples]
        for topic in topics:
            assert any(s.topic == topic and s.message.status is Status.OK for s in played), (sensor, topic)


def test_the_page_on_bench_recordings_is_true(monkeypatch):
    """The page's example runs as it stands there."""
    root = Path(__file__).parents[2]
    monkeypatch.chdir(root)
    example = (root / "docs" / "understand" / "fake-tray.md").read_text().split("```python\n")[1].split("```")[0]
    names: dict = {}
    exec(example, names)
    assert len(names["pressures"]) == 74
