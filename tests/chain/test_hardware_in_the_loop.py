"""The installed, unmodified `daq run` in another process, in real time, on device files: FUSE for I2C, pseudo-terminals
for the serial lines. What it recorded of the buses is then played back. The tests skip, and say why, only where there
is no FUSE."""

import subprocess
import sys
import sysconfig
import time
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path

import pytest

from flightpower.daq.config import load_tray
from flightpower.daq.driver_factory import driver_factory
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import Status
from flightpower.hw_fakes.fuse_i2c import UNAVAILABLE, FuseI2C
from flightpower.hw_fakes.pty import PtyServer
from flightpower.hw_fakes.replay import load_recording, replay
from flightpower.hw_fakes.tray import I2C_BUS, PORTS, FakeTray

sys.path.append(str(Path(__file__).parents[1] / "hw_fakes"))
from analytic_sensor_truth import AnalyticSensorTruth, constant

EXAMPLE = Path(__file__).parents[2] / "daq" / "tray.example.toml"
DAQ = Path(sysconfig.get_path("scripts")) / "daq"
BAUDS = {"gps": 38400, "esc_counter": 115200, "autopilot": 57600}
FORCE_MPS2, DIFFERENCE_PA, STATIC_PA, MOTOR_REVPS = [0.5, 0.2, -9.7], 120.0, 98_500.0, 90.0


GIVE_UP_S = 120.0  # so that a test that hangs ends
SERIAL_TOPICS = ("/gps", "/rpm", "/controls")
TOPICS = ("/imu", "/mag", "/baro", "/static", "/probe/alpha", "/probe/beta", "/probe/airspeed", *SERIAL_TOPICS)
# Statuses that a late reader never causes. It causes others: an overflowed FIFO or line is CORRUPT, for instance.
NEVER_BY_LATENESS = {Status.FAULT, Status.SATURATED, Status.WRONG_DEVICE, Status.NO_REPLY}


def good_messages(path):
    """Messages with status OK, by topic, of a log that may still be growing."""
    try:
        entries = read_log(path).entries
    except InputError:  # no message is on disk yet
        entries = {}
    good = {topic: [] for topic in (*TOPICS, *entries)}
    for topic, entry in entries.items():
        good[topic] += [entry.message for entry in entry if entry.message.status is Status.OK]
    return good


class RealClock:
    def now_ns(self):
        return time.monotonic_ns()


@pytest.mark.slow
@pytest.mark.parametrize("messages", [30, pytest.param(150, marks=pytest.mark.thorough)])
def test_the_installed_daemon_records_from_device_files(tmp_path, messages):
    """It records until each topic has enough good messages, however long that takes."""
    sensor_truth = AnalyticSensorTruth(
        force_mps2=constant(FORCE_MPS2),
        differential_Pa=constant(DIFFERENCE_PA),
        absolute_Pa=constant(STATIC_PA),
        motor_revps=constant(MOTOR_REVPS),
    )
    fake = FakeTray(sensor_truth, RealClock(), 4)
    text = EXAMPLE.read_text()
    with ExitStack() as stack:
        try:
            bus = stack.enter_context(FuseI2C(fake.i2c(I2C_BUS), tmp_path / "i2c-1"))
        except OSError as error:
            if error.errno not in UNAVAILABLE:
                raise
            pytest.skip(f"no FUSE here: {error}")
        text = text.replace(f'"{I2C_BUS}"', f'"{bus.path}"')
        for name, device in PORTS.items():
            line = stack.enter_context(PtyServer(fake.port(device, BAUDS[name])))
            text = text.replace(f'"{device}"', f'"{line.path}"')
        (tmp_path / "tray.toml").write_text(text)
        log_path, recording_path = tmp_path / "log.mcap", tmp_path / "bench.jsonl"
        command = [DAQ, "run", "--config", tmp_path / "tray.toml", "-o", log_path, "--record-bus", recording_path]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as daemon:
            give_up_s = time.monotonic() + GIVE_UP_S + messages
            while daemon.poll() is None and time.monotonic() < give_up_s:
                good = good_messages(log_path)
                if all(len(good[topic]) >= messages for topic in TOPICS):
                    break
                time.sleep(0.5)
            daemon.terminate()
            _, output = daemon.communicate()
    assert daemon.returncode == 0, output
    log, good = read_log(log_path), good_messages(log_path)
    assert {topic for topic in TOPICS if len(good[topic]) < messages} == set(), output
    ticks = log.entries["/daq/tick"]
    assert len(ticks) + sum(entry.message.missed for entry in ticks) == ticks[-1].tick + 1
    for topic in TOPICS:
        entries = log.entries[topic]
        # A bus answers each tick once, late or not. Late bytes of a serial line join those of a later tick.
        assert topic in SERIAL_TOPICS or len({entry.tick for entry in entries}) == len(entries), topic
        # An answer that comes after the next tick has been passed over is logged behind the timeouts of that tick. A
        # barometer's `busy` has the time of its tick; the result after it has the time of its conversion, which began
        # earlier.
        unordered = (Status.TIMEOUT, Status.BUSY)
        answers = [entry.tick for entry in entries if entry.message.status not in unordered]
        assert all(a <= b for a, b in pairwise(answers)), topic
        assert not {entry.message.status for entry in entries} & NEVER_BY_LATENESS, topic
    for imu in good["/imu"]:
        force = [imu.specific_force_x_mps2, imu.specific_force_y_mps2, imu.specific_force_z_mps2]
        assert force == pytest.approx(FORCE_MPS2, abs=9.80665 / 4096)
    for alpha in good["/probe/alpha"]:
        assert alpha.differential_pressure_Pa == pytest.approx(DIFFERENCE_PA, abs=2 * 498.2 / 13107)
    for static in good["/static"]:
        assert static.pressure_Pa == pytest.approx(STATIC_PA, abs=0.1)
    for rpm in good["/rpm"]:
        assert rpm.motor_speed_revps == pytest.approx(MOTOR_REVPS, rel=1e-4)

    recording = load_recording(recording_path)
    tray, nexstar = load_tray(tmp_path / "tray.toml"), load_aircraft("nexstar")
    for table in tray.sensors:
        turns = replay(recording, table.name, lambda buses, table=table: driver_factory(table, tray, buses, nexstar)())
        played = [sample for turn in turns for sample in turn.samples]
        for topic in table.topics:
            # A reading that came after its tick's deadline is not in the log.
            again = [s.message for s in played if s.topic == topic and s.message.status is Status.OK]
            assert len(good[topic]) <= len(again) and good[topic][-1] in again, topic
