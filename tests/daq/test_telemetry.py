"""Telemetry to a real MAVLink peer, over UDP and over a serial line; and that it can never hold up the loop.

More than 350 lines: all tests share one MAVLink peer.
"""

import math
import os
import pty
import re
import signal
import socket
import threading
import time
import tty
from itertools import pairwise
from pathlib import Path

import msgspec
import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mavlink

from flightpower.daq import telemetry as telemetry_module
from flightpower.daq.config import TelemetryConfig, parse_tray
from flightpower.daq.recording_status import RecordingState, RecordingStatus, RunNews, StatusFile
from flightpower.daq.sampling_loop import Cycle, GridTick
from flightpower.daq.sensor_health import SensorState
from flightpower.daq.sensors import Sample
from flightpower.daq.status_page import Sources, page
from flightpower.daq.still_air_zero import Zero, ZeroReading
from flightpower.daq.telemetry import MavlinkEncoder, Snapshot, TelemetryLink, airspeed_mps, sensor_bits
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import (
    TYPE_OF_TOPIC,
    AbsolutePressure,
    Controls,
    DifferentialPressure,
    Event,
    Gps,
    Imu,
    Rpm,
    Status,
)
from flightpower.flight.probe_maps import PolynomialMap, ProbeMaps

ROOT = Path(__file__).resolve().parents[2]
TICK_NS = 40_000_000
GIVE_UP_S = 60.0  # on something that hangs; generous, because the machine may be busy
IMU = '[[sensors]]\ndriver="mpu9250"\nbus="/dev/i2c-1"\n'
READINGS = {
    "/gps": Gps(
        latitude_deg=48.1,
        longitude_deg=11.2,
        height_msl_m=450.0,
        velocity_north_mps=3.0,
        velocity_east_mps=-4.0,
        velocity_down_mps=0.5,
        fix_type=3,
    ),
    "/static": AbsolutePressure(pressure_Pa=95_000.0, temperature_K=290.0),
    "/probe/alpha": DifferentialPressure(differential_pressure_Pa=30.0),
    "/probe/beta": DifferentialPressure(differential_pressure_Pa=-15.0),
    "/probe/airspeed": DifferentialPressure(differential_pressure_Pa=150.0),
    "/rpm": Rpm(motor_speed_revps=100.0),
}
SAMPLES = [Sample(topic, 0, message) for topic, message in READINGS.items()]


def tray(tmp_path, to: str):
    return parse_tray(f'[telemetry]\nto = "{to}"\nrate_Hz = 5\n' + IMU, "tray.toml", tmp_path)


def cycle_of(number: int, samples=SAMPLES) -> Cycle:
    now_ns = number * TICK_NS
    return Cycle(GridTick(number, 0, 0), now_ns, [sample._replace(time_ns=now_ns) for sample in samples], [])


def heard(link, receive, wanted, seconds=GIVE_UP_S):
    """Feed the link at its own pace until the peer has received all types in `wanted`; returns the last message of
    each type."""
    messages, number, deadline = {}, 0, time.monotonic() + seconds
    while not wanted <= set(messages):
        assert time.monotonic() < deadline, f"only {sorted(messages)} came"
        link.on_cycle(cycle_of(number), [Event(severity="error", sensor="imu", text="imu failed: Remote I/O error")])
        number += 1
        time.sleep(0.02)
        while (message := receive()) is not None:
            name = message.get_type()
            messages[f"{name} {message.name}" if name == "NAMED_VALUE_FLOAT" else name] = message
    return messages


WANTED = {
    "HEARTBEAT",
    "VFR_HUD",
    "GLOBAL_POSITION_INT",
    "STATUSTEXT",
    "NAMED_VALUE_FLOAT dpa_per_qc",
    "NAMED_VALUE_FLOAT dpb_per_qc",
    "NAMED_VALUE_FLOAT rpm",
}


def test_the_ground_station_reads_that_a_run_was_good(tmp_path):
    """Ten seconds on the ground, an acceleration from 12 to 22 m/s in 14 s, and steady flight, in fast motion."""
    peer = mavutil.mavlink_connection("udpin:127.0.0.1:0")
    udp = f"udp:127.0.0.1:{peer.port.getsockname()[1]}"
    to = parse_tray(f'aircraft = "nexstar"\n[telemetry]\nto = "{udp}"\nrate_Hz = 5\n' + IMU, "tray.toml", tmp_path)
    link, texts, number, deadline = TelemetryLink(to.telemetry, to), [], 0, time.monotonic() + GIVE_UP_S
    verdicts, progress = [], []
    quantities = (("specific_force", "mps2"), ("angular_rate", "radps"))
    still = Imu(**{f"{name}_{axis}_{unit}": 0.0 for name, unit in quantities for axis in "xyz"})
    try:
        while not (any(" good: " in text for text in texts) and verdicts):
            assert time.monotonic() < deadline
            t = number * TICK_NS / 1e9
            V = 0.0 if t < 10 else 12.0 + 10.0 * min(max((t - 18) / 14, 0.0), 1.0)
            messages = {
                "/imu": still,
                "/static": AbsolutePressure(pressure_Pa=101325.0 if t < 10 else 100600.0, temperature_K=288.15),
                "/rpm": Rpm(motor_speed_revps=0.0 if t < 10 else 80.0),
                "/probe/alpha": DifferentialPressure(differential_pressure_Pa=0.0),
                "/probe/airspeed": DifferentialPressure(differential_pressure_Pa=1.22 / 2 * V**2),
            }
            link.on_cycle(cycle_of(number, [Sample(topic, 0, message) for topic, message in messages.items()]), [])
            if number == 0:  # until the other process reads
                assert peer.recv_match(type="HEARTBEAT", blocking=True, timeout=GIVE_UP_S)
            number += 1
            time.sleep(0.001)
            while (message := peer.recv_match(type="STATUSTEXT", blocking=False)) is not None:
                texts.append(message.text)
            news = link.run_news()
            verdicts += [(event.sensor, event.text) for event in news.verdicts]
            progress += [news.progress] if [news.progress] != progress[-1:] else []
    finally:
        link.close()
        peer.close()
    good = next(text for text in texts if " good: " in text)
    assert good.startswith("acceleration good: 12")
    assert verdicts[0] == ("runs", good), "the daemon hears what the ground station reads"
    assert progress[0] == "" and progress[-1] == "" and len(progress) > 2
    assert set(progress) & set(texts), "the ground station reads how long to hold the run"


def test_verdicts_on_runs_are_in_the_log_on_the_page_and_not_sent_twice(tmp_path):
    from flightpower.daq.daemon import record
    from flightpower.hw_fakes.clock import SimulatedClock
    from flightpower.hw_fakes.tray import FakeTray
    from tests.hw_fakes.analytic_sensor_truth import AnalyticSensorTruth

    verdict = Event(severity="warning", sensor="runs", text="acceleration lost: too gentle; repeat")
    sent, message, reports = [], [], []

    class Listener:
        def __init__(self):
            self.news = [RunNews(), RunNews(verdicts=[verdict], progress="acceleration: hold 3 s more")]

        def run_news(self):
            return self.news.pop(0) if self.news else RunNews(progress="acceleration: hold 2 s more")

        def on_cycle(self, cycle, events):
            sent.extend(events)

        def on_status(self, status):
            """Not needed here."""

    clock = SimulatedClock()
    to = parse_tray('[[sensors]]\ndriver = "ms5611"\nbus = "/dev/i2c-1"\n', "tray.toml", tmp_path)
    path = record(
        to, buses=FakeTray(AnalyticSensorTruth(), clock, 0), clock=clock, log_path=tmp_path / "log.mcap",
        until_ns=clock.now_ns() + 2_000_000_000, listener=Listener(), on_event=message.append, report=reports.append,
    ).path  # fmt: skip
    assert verdict in message and verdict not in sent
    entries = read_log(path).entries
    assert verdict in [entry.message for entry in entries["/daq/event"]]
    assert entries["/daq/state"][-1].message.run == reports[-1].run == "acceleration: hold 2 s more"
    file = StatusFile(tmp_path / "status")
    file.add(verdict)
    file.write(reports[-1])
    sources = Sources(tmp_path / "status", tmp_path, tmp_path / "zero.json", tmp_path / "check.json")
    shown = page(sources, time.time())
    assert "hold 2 s more" in shown and verdict.text in shown


def test_what_a_process_leaves_unfinished_spoils_no_news(tmp_path, monkeypatch):
    monkeypatch.setattr(TelemetryLink, "_keep_alive", lambda self: None)
    to = tray(tmp_path, "udp:127.0.0.1:9")
    link = TelemetryLink(to.telemetry, to)
    assert link.run_news() == RunNews()
    complete = msgspec.json.encode(RunNews(verdicts=[Event(text="good")], progress="on")) + b"\n"
    os.write(link._news_write_end, complete[:10] + complete + complete[:7])
    assert link.run_news() == RunNews()
    os.write(link._news_write_end, complete[7:])
    assert link.run_news() == RunNews(verdicts=[Event(text="good")], progress="on")
    assert link.run_news() == RunNews(progress="on")
    link.close()


NO_VEHICLES = (
    mavlink.MAV_TYPE_GCS, mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_TYPE_GIMBAL, mavlink.MAV_TYPE_ADSB,
)  # fmt: skip


def creates_a_vehicle(heartbeat) -> None:
    """Assert what makes QGroundControl create a vehicle (MultiVehicleManager) and not request parameters, as there are
    none."""
    assert heartbeat.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1
    assert heartbeat.type not in NO_VEHICLES and heartbeat.type == mavlink.MAV_TYPE_FIXED_WING
    assert heartbeat.autopilot == mavlink.MAV_AUTOPILOT_GENERIC


def assert_right(result):
    creates_a_vehicle(result["HEARTBEAT"])
    hud = result["VFR_HUD"]
    # q_c for qbar without a calibration; rho = p/(R T) = 1.1412 kg/m^3
    assert hud.airspeed == pytest.approx((2 * 150 / 1.1412) ** 0.5, rel=1e-3)
    assert (hud.groundspeed, hud.alt, hud.climb) == pytest.approx((5.0, 450.0, -0.5))
    assert hud.heading == 307  # 360 - atan(4/3)
    position = result["GLOBAL_POSITION_INT"]
    assert (position.lat, position.lon, position.alt) == (481_000_000, 112_000_000, 450_000)
    assert (position.vx, position.vy, position.vz) == (300, -400, 50)
    assert position.relative_alt == 0  # above the first position
    assert result["STATUSTEXT"].text == "imu failed: Remote I/O error" and result["STATUSTEXT"].severity == 3
    assert result["NAMED_VALUE_FLOAT rpm"].value == 6000
    assert result["NAMED_VALUE_FLOAT dpa_per_qc"].value == pytest.approx(0.2)
    assert result["NAMED_VALUE_FLOAT dpb_per_qc"].value == pytest.approx(-0.1)


def test_a_ground_station_over_udp_sees_the_flight(tmp_path):
    peer = mavutil.mavlink_connection("udpin:127.0.0.1:0")
    port = peer.port.getsockname()[1]
    to = tray(tmp_path, f"udp:127.0.0.1:{port}")
    link = TelemetryLink(to.telemetry, to)
    try:
        assert_right(heard(link, lambda: peer.recv_match(blocking=False), WANTED))
    finally:
        link.close()
        peer.close()


def test_a_ground_station_on_a_serial_line_sees_the_flight(tmp_path):
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    waiting = []

    def receive():
        try:
            waiting.extend(parser.parse_buffer(os.read(ours, 4096)) or [])
        except BlockingIOError:
            pass
        return waiting.pop(0) if waiting else None

    to = tray(tmp_path, os.ttyname(theirs))
    link = TelemetryLink(to.telemetry, to)
    try:
        assert_right(heard(link, receive, WANTED))
    finally:
        link.close()
        os.close(ours)
        os.close(theirs)


def assert_returns(call):
    """Assert that `call` does not wait for a process that never reads, which would take for ever."""
    thread = threading.Thread(target=call, daemon=True)
    thread.start()
    thread.join(GIVE_UP_S)
    assert not thread.is_alive(), "it waits for telemetry"


@pytest.mark.parametrize("trouble", ["stopped", "killed", "nobody", "no such line"])
def test_nothing_that_happens_to_telemetry_holds_up_a_tick(tmp_path, monkeypatch, trouble):
    """Minutes of cycles go to a process that is stopped, dead or without a peer: a blocking pipe would block for ever.

    They are some thirty times the capacity of a pipe.
    """

    def minutes_of_cycles():
        for number in range(5000):
            link.on_cycle(cycle_of(number), [Event(text="x" * 200)])

    monkeypatch.setattr(telemetry_module, "RESTART_AFTER_S", 0.1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"udp:127.0.0.1:{taken.getsockname()[1]}"
    to = tray(tmp_path, "/dev/no-such-line" if trouble == "no such line" else address)
    link = TelemetryLink(to.telemetry, to)
    deadline = time.monotonic() + GIVE_UP_S
    while link._process is None:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    if trouble in ("stopped", "killed"):
        link._process.send_signal(signal.SIGSTOP if trouble == "stopped" else signal.SIGKILL)
    assert_returns(minutes_of_cycles)
    if trouble == "stopped":
        link._process.send_signal(signal.SIGCONT)
    assert_returns(link.close)


@pytest.mark.parametrize("extra", ["x", "\u20ac"])
def test_events_too_long_for_a_line_reach_the_other_process(tmp_path, monkeypatch, extra):
    """An event may hold the text of an exception; a line of more than PIPE_BUF bytes is not written."""
    monkeypatch.setattr(TelemetryLink, "_keep_alive", lambda self: None)
    to = tray(tmp_path, "udp:127.0.0.1:9")
    link = TelemetryLink(to.telemetry, to)
    full = [Sample(topic, 0, TYPE_OF_TOPIC[topic](**every_field(topic))) for topic in telemetry_module.TOPICS]
    link.on_cycle(cycle_of(0, full), [Event(text=f"driver error {number}: " + 5000 * extra) for number in range(4)])
    (line,) = os.read(link._read_end, 2**16).splitlines()
    link.close()
    texts = [event.text[:14] for event in msgspec.json.decode(line, type=Snapshot).events]
    assert len(line) < 4096 and texts == [f"driver error {number}" for number in range(4)]


def every_field(topic: str) -> dict:
    """A message's fields, with a value of many digits in each, and many items in each list."""
    fields = msgspec.structs.fields(TYPE_OF_TOPIC[topic])
    return {f.name: [65535] * 300 if "list" in str(f.type) else -1.23456789012345e-200 for f in fields[1:]}


def test_telemetry_needs_only_the_dialect_that_is_installed():
    """install.sh removes the others from the card."""
    keep = re.search(r"! -path '\*/(v20/\w+)\*'", (ROOT / "systemd" / "install.sh").read_text())[1]
    sources = [path.read_text() for path in (ROOT / "daq").rglob("*.py")]
    imported = {name for text in sources for name in re.findall(r"dialects\.v20 import (\w+)", text)}
    assert {f"v20/{name}" for name in imported} == {keep}


def test_a_telemetry_process_that_died_is_started_again(tmp_path, monkeypatch):
    monkeypatch.setattr(telemetry_module, "RESTART_AFTER_S", 0.05)
    to = tray(tmp_path, "udp:127.0.0.1:9")
    link = TelemetryLink(to.telemetry, to)
    deadline, seen = time.monotonic() + GIVE_UP_S, set()
    while len(seen) < 2:
        assert time.monotonic() < deadline
        if link._process is not None and link._process.pid not in seen:
            seen.add(link._process.pid)
            link._process.kill()
        time.sleep(0.01)
    link.close()


def decoded(packets):
    parser = mavlink.MAVLink(None)
    return [message for packet in packets for message in parser.parse_buffer(packet)]


def snapshot(readings, age_s=0.0, elapsed_s=10.0, autopilot_system=None):
    messages = {topic: msgspec.to_builtins(message) for topic, message in readings.items()}
    ages_s = dict.fromkeys(messages, age_s)
    return Snapshot(elapsed_s=elapsed_s, messages=messages, ages_s=ages_s, autopilot_system=autopilot_system)


def named(ground, readings, **options):
    return {
        m.name: m.value
        for m in decoded(ground.packets(snapshot(readings, **options)))
        if m.get_type() == "NAMED_VALUE_FLOAT"
    }


def test_with_a_calibration_it_shows_flow_angles(tmp_path):
    """alpha = 0.5 C_alpha + C_alpha C_beta, by hand: C_alpha = 0.2, C_beta = -0.1."""
    probe = ProbeMaps(
        format="flightpower-probe-1",
        alpha_rad=PolynomialMap([(1, 0), (1, 1)], [0.5, 1.0]),
        beta_rad=PolynomialMap([(0, 1)], [0.4]),
        q_ratio=PolynomialMap([(0, 0)], [0.75]),
        hull=[(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)],
    )
    ground = MavlinkEncoder(TelemetryConfig(to="udp:127.0.0.1:9"), probe, None)
    values = named(ground, READINGS)
    assert values["alpha_deg"] == pytest.approx(57.29578 * (0.1 - 0.02), rel=1e-5)
    assert values["beta_deg"] == pytest.approx(57.29578 * -0.04, rel=1e-5)
    hud = next(m for m in decoded(ground.packets(snapshot(READINGS))) if m.get_type() == "VFR_HUD")
    assert hud.airspeed == pytest.approx(airspeed_mps(150 / 0.75, 95_000, 290), rel=1e-6)


def test_what_is_old_or_failed_is_not_shown_as_if_it_were_new():
    ground = MavlinkEncoder(TelemetryConfig(to="udp:127.0.0.1:9"), None, None)
    assert named(ground, READINGS, age_s=5.0) == {}
    kinds = [m.get_type() for m in decoded(ground.packets(snapshot(READINGS, age_s=5.0)))]
    assert "GLOBAL_POSITION_INT" not in kinds


def test_a_failed_reading_is_not_handed_on(tmp_path):
    to = tray(tmp_path, "udp:127.0.0.1:9")
    link = TelemetryLink(to.telemetry, to)
    link.on_cycle(cycle_of(0, [Sample("/rpm", 0, Rpm(status=Status.NO_DATA))]), [])
    link.on_cycle(cycle_of(1, [Sample("/static", 0, AbsolutePressure(pressure_Pa=1e5))]), [])
    assert list(link._latest) == ["/static"]
    link.close()


def test_lines_come_at_the_rate_of_the_tray_with_the_age_of_each_reading(tmp_path, monkeypatch):
    """5 Hz: every 5th tick of 40 ms, on the same grid after a second of silence; ages and times in seconds."""

    def cannot_start(*_arguments, **_options):
        raise OSError("no process here: this test reads the other end of the pipe itself")

    monkeypatch.setattr(telemetry_module.subprocess, "Popen", cannot_start)
    to = tray(tmp_path, "udp:127.0.0.1:9")
    link = TelemetryLink(to.telemetry, to)
    first, silent = 50, range(62, 87)
    for number in range(first, 102):
        if number not in silent:
            link.on_cycle(cycle_of(number, SAMPLES if number == first else []), [])
    lines = os.read(link._read_end, 1 << 16).splitlines()
    link.close()
    snapshots = [msgspec.json.decode(line, type=Snapshot) for line in lines]
    times_s = [0.0, 0.2, 0.4, 1.48, 1.6, 1.8, 2.0]
    assert [snapshot.elapsed_s for snapshot in snapshots] == pytest.approx(times_s)
    for snapshot in snapshots:
        assert snapshot.ages_s == pytest.approx(dict.fromkeys(READINGS, snapshot.elapsed_s))


def test_height_is_given_above_the_first_position_too():
    ground = MavlinkEncoder(TelemetryConfig(to="udp:127.0.0.1:9"), None, None)
    higher = msgspec.structs.replace(READINGS["/gps"], height_msl_m=530.0)
    list(ground.packets(snapshot(READINGS)))
    position = next(
        m for m in decoded(ground.packets(snapshot({"/gps": higher}))) if m.get_type() == "GLOBAL_POSITION_INT"
    )
    assert (position.alt, position.relative_alt) == (530_000, 80_000)


def test_every_number_of_a_position_has_the_unit_of_the_protocol():
    """South-west of the equator and of Greenwich, flying east by south, climbing; 12.3456 s after the start."""
    gps = Gps(
        latitude_deg=-12.3456789, longitude_deg=-45.6789012, height_msl_m=123.456, velocity_north_mps=-5.0,
        velocity_east_mps=12.0, velocity_down_mps=-1.5,
    )  # fmt: skip
    ground = MavlinkEncoder(TelemetryConfig(to="udp:127.0.0.1:9"), None, None)
    controls = Controls(throttle=0.42)
    readings = {"/gps": gps, "/controls": controls, "/rpm": Rpm(motor_speed_revps=80.0)}
    messages = {m.get_type(): m for m in decoded(ground.packets(snapshot(readings, elapsed_s=12.3456)))}
    position, hud, named = (messages[kind] for kind in ("GLOBAL_POSITION_INT", "VFR_HUD", "NAMED_VALUE_FLOAT"))
    assert (position.time_boot_ms, named.time_boot_ms) == (12346, 12346)
    assert (position.lat, position.lon, position.alt) == (-123456789, -456789012, 123456)
    assert (position.vx, position.vy, position.vz) == (-500, 1200, -150)
    course_deg = 90 + math.degrees(math.atan2(5, 12))
    assert position.hdg == round(100 * course_deg) and hud.heading == round(course_deg)
    assert (hud.groundspeed, hud.climb, hud.throttle) == (13.0, 1.5, 42)
    assert hud.alt == pytest.approx(123.456) and (named.name, named.value) == ("rpm", 4800.0)


def sent(readings, system, **config):
    ground = MavlinkEncoder(TelemetryConfig(to="udp:127.0.0.1:9", **config), None, None)
    return decoded(ground.packets(snapshot(readings, autopilot_system=system)))


def test_beside_an_autopilot_it_is_a_companion_of_the_same_system():
    """The daemon sends no message that the autopilot also sends, since a ground station could not distinguish them."""
    messages = sent(READINGS, 7, vehicle=False)
    assert {(m.get_srcSystem(), m.get_srcComponent()) for m in messages} == {(7, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)}
    kinds = {m.get_type() for m in messages}
    assert kinds == {"HEARTBEAT", "NAMED_VALUE_FLOAT"}
    heartbeat = next(m for m in messages if m.get_type() == "HEARTBEAT")
    assert heartbeat.type == mavlink.MAV_TYPE_ONBOARD_CONTROLLER
    assert heartbeat.autopilot == mavlink.MAV_AUTOPILOT_INVALID
    values = {m.name: m.value for m in messages if m.get_type() == "NAMED_VALUE_FLOAT"}
    assert values["airspeed"] == pytest.approx((2 * 150 / 1.1412) ** 0.5, rel=1e-3)


@pytest.mark.parametrize(
    ("system", "config", "expected"),
    [(None, {}, 25), (None, {"system_id": 9}, 9), (None, {"vehicle": False}, 1), (7, {"vehicle": False}, 7),
     (7, {"vehicle": False, "system_id": 9}, 9)],
)  # fmt: skip
def test_the_system_is_the_autopilot_s_if_none_is_given(system, config, expected):
    assert {m.get_srcSystem() for m in sent(READINGS, system, **config)} == {expected}


@pytest.mark.parametrize(
    ("sensors", "key", "expected"),
    [("", "", True), ('[[sensors]]\ndriver="autopilot"\nport="/dev/ttyUSB1"\n', "", False),
     ('[[sensors]]\ndriver="autopilot"\nport="/dev/ttyUSB1"\n', "vehicle = true\n", True)],
)  # fmt: skip
def test_with_an_autopilot_in_the_tray_it_is_a_companion_unless_the_tray_says_otherwise(
    tmp_path, sensors, key, expected
):
    to = parse_tray(f'[telemetry]\nto = "udp:127.0.0.1:9"\n{key}{IMU}{sensors}', "tray.toml", tmp_path)
    link = TelemetryLink(to.telemetry, to)
    link.close()
    assert msgspec.json.decode(link._command[3])["vehicle"] is expected


def test_the_autopilot_that_the_daemon_hears_gives_its_system_to_the_ground_station(tmp_path):
    """It goes from the fake autopilot's serial line through the sampling loop to a ground station."""
    from flightpower.daq.daemon import record
    from flightpower.hw_fakes.clock import SimulatedClock
    from flightpower.hw_fakes.tray import FakeTray
    from tests.hw_fakes.analytic_sensor_truth import AnalyticSensorTruth

    cycles = []

    class Listener:
        def on_cycle(self, cycle, events):
            cycles.append(cycle)

        def run_news(self):
            return RunNews()

        def on_status(self, status):
            """Not needed here."""

    clock = SimulatedClock()
    to = parse_tray('[[sensors]]\ndriver = "autopilot"\nport = "/dev/ttyUSB1"\n', "tray.toml", tmp_path)
    record(
        to, buses=FakeTray(AnalyticSensorTruth(), clock, 0), clock=clock, log_path=tmp_path / "log.mcap",
        until_ns=clock.now_ns() + 3_000_000_000, listener=Listener(),
    )  # fmt: skip
    assert cycles[0].autopilot_system is None and cycles[-1].autopilot_system == 1


def status(**changes) -> RecordingStatus:
    values = {
        "state": RecordingState.RECORDING, "log": "log-0001.mcap", "elapsed_s": 740.0, "ticks": 18500, "missed": 0,
        "rate_Hz": 25.0, "free_bytes": 10**9, "error": "", "sensors": {"imu": SensorState.OK}, "slow": [],
    }  # fmt: skip
    return RecordingStatus(**(values | changes))


@pytest.mark.parametrize(
    ("changes", "state"),
    [
        (None, mavlink.MAV_STATE_BOOT),
        ({}, mavlink.MAV_STATE_ACTIVE),
        ({"sensors": {"imu": SensorState.FAILED}}, mavlink.MAV_STATE_CRITICAL),
        ({"sensors": {"imu": SensorState.WAITING}}, mavlink.MAV_STATE_ACTIVE),
        ({"error": "Input/output error"}, mavlink.MAV_STATE_CRITICAL),
        ({"state": RecordingState.CARD_FULL}, mavlink.MAV_STATE_CRITICAL),
        ({"state": RecordingState.WAITING}, mavlink.MAV_STATE_STANDBY),
    ],
)
def test_the_heartbeat_says_whether_it_records_and_all_is_well(changes, state):
    ground = MavlinkEncoder(TelemetryConfig(to="udp:127.0.0.1:9"), None, None)
    latest_status = None if changes is None else status(**changes)
    messages = decoded(ground.packets(Snapshot(elapsed_s=10.0, status=latest_status)))
    assert [m.system_status for m in messages if m.get_type() == "HEARTBEAT"] == [state]


def test_a_ground_station_that_joins_late_knows_the_state_within_five_seconds():
    ground = MavlinkEncoder(TelemetryConfig(to="udp:127.0.0.1:9"), None, None)
    told_s = [
        i / 4
        for i in range(80)
        for m in decoded(ground.packets(Snapshot(elapsed_s=i / 4, status=status())))
        if m.get_type() == "STATUSTEXT" and m.text == "recording 12 min, 25 Hz, all well"
    ]
    assert max(later - earlier for earlier, later in pairwise(told_s)) <= 5.0
    failed = status(sensors={"imu": SensorState.FAILED})
    last = next(
        m for m in decoded(ground.packets(Snapshot(elapsed_s=100.0, status=failed))) if m.get_type() == "STATUSTEXT"
    )
    assert (last.text, last.severity) == ("recording 12 min, 25 Hz: imu failed", mavlink.MAV_SEVERITY_WARNING)


def test_sys_status_has_a_bit_for_each_kind_of_sensor_and_only_an_aircraft_of_its_own_sends_it():
    topics = {"imu": ("/imu",), "gps": ("/gps",), "esc_counter": ("/rpm",)}
    states = {"imu": SensorState.OK, "gps": SensorState.FAILED, "esc_counter": SensorState.WAITING}
    bits = sensor_bits(status(sensors=states), topics)
    gps, logging = mavlink.MAV_SYS_STATUS_SENSOR_GPS, mavlink.MAV_SYS_STATUS_LOGGING
    imu = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    motor = mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    assert bits.present == imu | gps | motor | logging
    assert bits.present & bits.healthy == imu | motor | logging
    assert bits.healthy & mavlink.MAV_SYS_STATUS_GEOFENCE, "without a fence none is breached"
    assert not sensor_bits(status(state=RecordingState.CARD_FULL), topics).healthy & logging
    for vehicle in (True, False):
        ground = MavlinkEncoder(TelemetryConfig(to="udp:127.0.0.1:9", vehicle=vehicle), None, None)
        sent = decoded(ground.packets(Snapshot(elapsed_s=1.0, status=status(), bits=bits)))
        results = [m for m in sent if m.get_type() == "SYS_STATUS"]
        assert len(results) == vehicle
        assert all((m.onboard_control_sensors_health, m.onboard_control_sensors_present) == bits[::-1] for m in results)


@pytest.mark.parametrize("length", [1, 49, 50, 51, 99, 100, 101, 200])
def test_a_long_text_arrives_whole(length):
    """Its chunks have one id and come in order; a ground station recognizes the end by a zero byte."""
    text = ("0123456789" * 20)[:length]
    ground = MavlinkEncoder(TelemetryConfig(to="udp:127.0.0.1:9"), None, None)
    packets = [*ground.packets(Snapshot(elapsed_s=1.0, events=[Event(text=text), Event(text=text)]))]
    chunks = [m for m in decoded(packets) if m.get_type() == "STATUSTEXT"]
    by_id = [[m for m in chunks if m.id == number] for number in dict.fromkeys(m.id for m in chunks)]
    if length <= 50:
        assert [m.text for m in chunks] == [text, text] and {m.id for m in chunks} == {0}
        return
    assert len(by_id) == 2
    for these in by_id:
        assert "".join(m.text for m in these) == text
        assert [m.chunk_seq for m in these] == list(range(len(these)))
        assert len(these[-1].text) < 50


def test_heartbeats_come_once_a_second():
    ground = MavlinkEncoder(TelemetryConfig(to="udp:127.0.0.1:9"), None, None)
    beats = [
        sum(m.get_type() == "HEARTBEAT" for m in decoded(ground.packets(snapshot({}, elapsed_s=i / 4))))
        for i in range(40)
    ]
    assert sum(beats) == 10


def test_a_line_that_a_sensor_has_is_refused(tmp_path):
    text = '[telemetry]\nto="/dev/ttyUSB1"\n[[sensors]]\ndriver="autopilot"\nport="/dev/ttyUSB1"\n'
    with pytest.raises(InputError, match=r"telemetry\.to: /dev/ttyUSB1 is already used by a sensor"):
        parse_tray(text, "tray.toml", tmp_path)
    with pytest.raises(InputError, match="udp:HOST:PORT"):
        tray(tmp_path, "udp:14550")


def test_the_zero_is_subtracted_before_anything_is_sent():
    """30 Pa at alpha and 150 Pa of dynamic pressure, of which 6 and 10 Pa are the transducers' zeros."""

    def reading(mean):
        return {"differential_pressure_Pa": ZeroReading(mean=mean, standard_deviation=0.1, samples=250)}

    readings = {"/probe/alpha": reading(6.0), "/probe/airspeed": reading(10.0)}
    zero = Zero(format="flightpower-zero-1", taken_unix_ns=0, seconds=10.0, temperature_K={}, readings=readings)
    values = named(MavlinkEncoder(TelemetryConfig(to="udp:127.0.0.1:9"), None, zero), READINGS)
    assert values["dpa_per_qc"] == pytest.approx((30 - 6) / (150 - 10))
    assert values["dpb_per_qc"] == pytest.approx(-15 / (150 - 10))  # without a zero of its own
