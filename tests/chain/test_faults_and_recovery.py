"""The daemon through each fault: it goes on, says so in the topic's status, and has the sensor back within 2 s."""

import sys
from pathlib import Path

import pytest

from daq.config import parse_tray
from daq.daemon import record
from flight.log_reader import read_log
from flight.messages import Status
from hw_fakes.clock import SimulatedClock
from hw_fakes.faults import Fault
from hw_fakes.tray import FakeTray

sys.path.append(str(Path(__file__).parents[1] / "hw_fakes"))
from analytic_felt import AnalyticFelt

EXAMPLE = Path(__file__).parents[2] / "daq" / "tray.example.toml"
START_S, LASTS_S, RECOVERY_S, SECONDS = 4.0, 2.5, 2.0, 10
TOPICS = {
    "imu": ["/imu"],
    "magnetometer": ["/mag"],
    "baro": ["/baro"],
    "static": ["/static"],
    "alpha": ["/probe/alpha"],
    "airspeed": ["/probe/airspeed"],
    "gps": ["/gps"],
    "esc_counter": ["/rpm"],
    "autopilot": ["/controls", "/attitude"],
}
I2C_TOPICS = [t for name in ("imu", "magnetometer", "baro", "static", "alpha", "airspeed") for t in TOPICS[name]]

# What is not said by a status: nothing tells a stuck value, or a bit turned over in a plain number, from a measurement.
CASES = [
    ("no_acknowledge", "imu", {Status.NO_REPLY}),
    ("no_acknowledge", "static", {Status.NO_REPLY}),
    ("no_acknowledge", "i2c", {Status.NO_REPLY}),
    ("timeout", "i2c", {Status.TIMEOUT}),
    ("timeout", "baro", {Status.TIMEOUT}),
    ("brown_out", "imu", {Status.NO_REPLY}),
    ("brown_out", "magnetometer", {Status.NO_REPLY}),
    ("brown_out", "baro", {Status.NO_REPLY}),
    ("brown_out", "airspeed", {Status.NO_REPLY}),
    ("brown_out", "gps", {Status.NO_DATA}),
    ("wrong_device", "imu", {Status.WRONG_DEVICE, Status.FAULT, Status.CORRUPT}),
    ("wrong_device", "magnetometer", {Status.WRONG_DEVICE, Status.FAULT}),
    ("stale", "alpha", {Status.STALE}),
    ("latched_fault", "airspeed", {Status.FAULT}),
    ("no_fix", "gps", None),
    ("silent", "esc_counter", {Status.NO_DATA}),
    ("silent", "autopilot", {Status.NO_DATA}),
    ("unplugged", "gps", None),
    ("unplugged", "esc_counter", None),
    ("unplugged", "autopilot", None),
    ("checksum_errors", "gps", None),
    ("checksum_errors", "autopilot", None),
    ("bit_flips", "i2c", None),
    ("bit_flips", "imu", None),
    ("wrong_prom_crc", "baro", None),
    ("stuck_value", "airspeed", None),
]


def flown(tmp_path, fault):
    clock = SimulatedClock(start_ns=3_000_000_000)
    fake = FakeTray(AnalyticFelt(), clock, 2, faults=[fault])
    tray = parse_tray(EXAMPLE.read_text(), "tray.toml", tmp_path)
    start_ns = clock.now_ns()
    recording = record(tray, buses=fake, clock=clock, until_ns=start_ns + SECONDS * 10**9)
    log = read_log(recording.path)
    first_ns = log.entries["/daq/tick"][0].time_ns
    return recording, {
        topic: [((entry.time_ns - first_ns) * 1e-9, entry.message) for entry in entries]
        for topic, entries in log.entries.items()
    }


@pytest.mark.parametrize(("kind", "device", "statuses"), CASES, ids=[f"{k}-{d}" for k, d, _ in CASES])
def test_it_is_said_and_it_passes(tmp_path, kind, device, statuses):
    fault = Fault(kind=kind, device=device, start_s=START_S, duration_s=LASTS_S, rate=0.05)
    recording, log = flown(tmp_path, fault)
    assert recording.write_error == ""
    for topic in I2C_TOPICS if device == "i2c" else TOPICS[device]:
        before = [m.status for t_s, m in log[topic] if 3.0 < t_s < START_S]
        during = {m.status for t_s, m in log[topic] if START_S + 1.0 < t_s < START_S + LASTS_S - 0.1}
        after = [m.status for t_s, m in log[topic] if t_s > START_S + LASTS_S + RECOVERY_S]
        assert before.count(Status.OK) >= 0.7 * len(before) > 0, topic
        if statuses is not None:
            assert during & statuses and Status.OK not in during, (topic, during)
        assert after.count(Status.OK) >= 0.7 * len(after) > 0, (topic, set(after))


def test_a_driver_never_fails_by_its_own_mistake(tmp_path):
    fault = Fault(kind="bit_flips", device="i2c", start_s=0.0, rate=0.2)
    _, log = flown(tmp_path, fault)
    assert [m.text for _, m in log["/daq/event"] if "driver error" in m.text] == []
