"""Drivers and fakes talk with pymavlink's own connections at the far end of a real line, which were not written
here."""

import fcntl
import os
import sys
import termios
import time
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flightpower.daq.linux_bus import LinuxBuses
from flightpower.daq.sensors.autopilot import AutopilotDriver
from flightpower.flight.messages import Status
from flightpower.hw_fakes.pty import PtyServer
from flightpower.hw_fakes.tray import AUTOPILOT_PORT, FakeTray

os.environ["MAVLINK20"] = "1"  # mavutil reads it when it is imported
from pymavlink import mavutil

sys.path.append(str(Path(__file__).parents[1] / "hw_fakes"))
from analytic_sensor_truth import AnalyticSensorTruth

pytest.importorskip("serial")
PATIENCE_S = 60.0  # so that a test that hangs ends
PULSES = [1500, 1750, 1400, 1500, 1000, 1000, 1000, 1000]


class ReadersClock:
    """A clock that advances 2 ms at each look, but not while bytes wait at `path`: a slow reader loses nothing."""

    path = None

    def __init__(self):
        self._now_ns = 0

    def now_ns(self):
        if self.path is None or not self._waiting():
            self._now_ns += 2_000_000
        return self._now_ns

    def _waiting(self):
        line = os.open(self.path, os.O_RDONLY | os.O_NOCTTY)
        try:
            return int.from_bytes(fcntl.ioctl(line, termios.FIONREAD, bytes(4)), sys.byteorder)
        finally:
            os.close(line)


def until(results):
    """Waits until `found()` returns something, and fails if that takes too long."""
    give_up_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < give_up_s:
        if result := results():
            return result
        time.sleep(0.005)
    raise AssertionError("nothing came")


def test_the_fake_autopilot_talks_with_a_ground_station_of_pymavlink():
    clock = ReadersClock()
    tray = FakeTray(AnalyticSensorTruth(), clock)
    with PtyServer(tray.port(AUTOPILOT_PORT, 57600)) as server:
        clock.path = server.path
        station = mavutil.mavlink_connection(server.path, baud=57600, dialect="ardupilotmega", source_system=255)
        assert station.wait_heartbeat(timeout=PATIENCE_S) is not None
        attitude = station.recv_match(type="ATTITUDE", blocking=True, timeout=PATIENCE_S)
        assert (attitude.roll, attitude.pitch, attitude.yaw) == pytest.approx((0.1, 0.05, -2.0), abs=1e-6)
        station.mav.command_long_send(
            station.target_system,
            station.target_component,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
            0,
            mavlink.MAVLINK_MSG_ID_RPM,
            40_000,
            *[0] * 5,
        )
        answer = station.recv_match(type="COMMAND_ACK", blocking=True, timeout=PATIENCE_S)
        assert answer.result == mavlink.MAV_RESULT_ACCEPTED
        assert station.recv_match(type="RPM", blocking=True, timeout=PATIENCE_S).rpm1 == pytest.approx(6000)
        assert station.mav_count > 3 and station.mav_loss == 0
        station.close()


def test_the_driver_talks_with_an_autopilot_of_pymavlink():
    """They talk over UDP, as the telemetry of an autopilot or its simulator arrives."""
    with_free_port = LinuxBuses().port("udp:127.0.0.1:0", 0)
    number = with_free_port._socket.getsockname()[1]
    sensor = AutopilotDriver(with_free_port, aircraft=None, rate_Hz=25, rpm=True)
    for _ in sensor.start():
        pass
    vehicle = mavutil.mavlink_connection(f"udpout:127.0.0.1:{number}", dialect="ardupilotmega", source_system=1)
    vehicle.mav.heartbeat_send(mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 0, 0, 4)
    vehicle.mav.rc_channels_send(1, 8, *reversed(PULSES), *[65535] * 10, 100)
    vehicle.mav.servo_output_raw_send(1, 0, *PULSES)
    vehicle.mav.attitude_send(1, 0.1, -0.2, 3.0, 0, 0, 0)
    vehicle.mav.battery_status_send(0, 0, 1, 0, [3700] * 4 + [65535] * 6, 2050, -1, -1, 50)
    vehicle.mav.rpm_send(7200.0, -1.0)
    heard = {}

    def all_topics():
        heard.update({s.topic: s.message for s in sensor.read(time.monotonic_ns()) if s.message.status is Status.OK})
        return len(heard) == 4

    until(all_topics)
    assert heard["/controls"].pulse_us == PULSES and heard["/controls"].stick_pulse_us == PULSES[::-1]
    assert heard["/attitude"].pitch_rad == pytest.approx(-0.2)
    assert heard["/battery"].voltage_V == pytest.approx(14.8)
    assert heard["/rpm"].motor_speed_revps == pytest.approx(120)
    request = until(lambda: vehicle.recv_match(type="COMMAND_LONG"))
    assert request.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL and request.get_srcComponent() == 191
    vehicle.close()
    with_free_port.close()
