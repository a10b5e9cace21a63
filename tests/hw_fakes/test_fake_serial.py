"""Pulse counter and autopilot, and the lines they send on."""

import io
import os
import time

import numpy as np
import pytest
from analytic_sensor_truth import AnalyticSensorTruth, constant, sine
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flightpower.hw_fakes import esc_counter
from flightpower.hw_fakes.pty import PtyServer
from flightpower.hw_fakes.tray import FakeTray

ESC, AUTOPILOT = "/dev/ttyUSB0", "/dev/ttyUSB1"
GIVE_UP_S = 60.0  # so that a test that hangs ends


class RealClock:
    def now_ns(self):
        return time.monotonic_ns()


def listen(port, clock, seconds, step_s=0.04):
    """The arrival [ns] of the end of each piece, and the pieces."""
    pieces = []
    for _ in range(round(seconds / step_s)):
        clock.advance_ns(round(step_s * 1e9))
        pieces.append((clock.now_ns(), port.read_available()))
    return pieces


def heard(port, clock, seconds, step_s=0.04):
    return b"".join(data for _, data in listen(port, clock, seconds, step_s))


@pytest.mark.parametrize(("pole_pairs", "revps"), [(7, 100.0), (7, 17.3), (6, 166.6)])
def test_the_legacy_period_gives_the_speed_back(powered, clock, pole_pairs, revps):
    port = powered(pole_pairs=pole_pairs, motor_revps=constant(revps)).port(ESC, 115200)
    data = heard(port, clock, 2.0)
    start = data.index(b"x")
    frames = [data[i : i + 4] for i in range(start, len(data) - 3, 4)]
    assert len(frames) >= 20 and all(frame[:1] == b"x" for frame in frames)
    for frame in frames:
        period_us = int.from_bytes(frame[1:], "big")
        # Rounded to whole microseconds.
        assert 60e6 / (period_us / 10 * pole_pairs) == pytest.approx(60 * revps, rel=0.5 / period_us + 1e-6)


def test_at_most_a_hundred_frames_a_second(powered, clock):
    port = powered(motor_revps=constant(160.0)).port(ESC, 115200)
    assert len(heard(port, clock, 5.0)) / 4 <= 501


def test_a_changing_speed_is_the_mean_over_its_period(powered, clock):
    """The period of a speed swinging by 10 % at 1 Hz lies within the speeds of that swing, and reaches both sides."""
    port = powered(motor_revps=sine(100.0, 10.0, 1.0)).port(ESC, 115200)
    data = heard(port, clock, 3.0)
    frames = [data[i : i + 4] for i in range(data.index(b"x"), len(data) - 3, 4)]
    revps = [1e6 * 10 / 7 / int.from_bytes(f[1:], "big") for f in frames]
    assert 89.9 <= min(revps) <= 90.2 and 109.8 <= max(revps) <= 110.1


def test_a_standing_motor_is_silent_in_the_legacy_frame(powered, clock):
    assert heard(powered(motor_revps=constant(0.0)).port(ESC, 115200), clock, 5.0) == b""


def test_crc8_of_the_catalog():
    assert esc_counter.crc8(b"123456789") == 0xF4


def test_the_framed_variant_counts_and_checks(powered, clock):
    port = powered(rpm_with_crc=True).port(ESC, 115200)
    data = heard(port, clock, 4.0)
    frames = [data[i : i + 11] for i in range(data.index(0xA6), len(data) - 10, 11)]
    assert len(frames) > 256  # the sequence wraps
    assert all(frame[0] == 0xA6 and frame[2] == 0 and esc_counter.crc8(frame[1:10]) == frame[10] for frame in frames)
    assert set(np.diff([frame[1] for frame in frames]) % 256) == {1}
    assert {int.from_bytes(frame[3:7], "big") for frame in frames} <= {14285, 14286}  # 10 / (7 x 100 Hz)


def test_the_framed_variant_says_that_the_motor_stands(powered, clock):
    port = powered(rpm_with_crc=True, motor_revps=constant(0.0)).port(ESC, 115200)
    data = heard(port, clock, 10.0)
    assert len(data) / 11 == pytest.approx(20, abs=1)
    assert all(data[i + 2 : i + 10] == bytes([1, *[0] * 7]) for i in range(0, len(data) - 10, 11))


def mavlink_messages(data):
    parser = mavlink.MAVLink(io.BytesIO())
    parser.robust_parsing = False  # a bad byte raises
    return parser.parse_buffer(data) or []


def test_the_autopilot_speaks_mavlink_at_its_rates(powered, clock):
    port = powered(after_s=0.0).port(AUTOPILOT, 57600)
    messages = mavlink_messages(heard(port, clock, 10.0))
    counts = {kind: sum(m.get_type() == kind for m in messages) for kind in {m.get_type() for m in messages}}
    expected = {
        "HEARTBEAT": 10,
        "ATTITUDE": 250,
        "SERVO_OUTPUT_RAW": 250,
        "RC_CHANNELS": 100,
        "SYS_STATUS": 20,
        "BATTERY_STATUS": 20,
    }
    assert counts.keys() == expected.keys()
    for kind, count in expected.items():
        assert count - 1 <= counts[kind] <= count, kind
    assert set(np.diff([m.get_seq() for m in messages]) % 256) == {1}


@pytest.mark.parametrize("step_s", [0.002, 0.04])
def test_the_autopilot_numbers_messages_in_the_order_they_are_sent(powered, clock, step_s):
    """A ground station would interpret a backward step of the numbers as lost messages, whenever its command
    arrives."""
    request = mavlink.MAVLink_command_long_message(
        1, 1, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, mavlink.MAVLINK_MSG_ID_RPM, 40_000, *[0] * 5
    ).pack(mavlink.MAVLink(io.BytesIO(), srcSystem=255))
    for phase_ms in range(100):  # over the periods of 40 and of 100 ms
        port = powered(after_s=0.0).port(AUTOPILOT, 57600)
        clock.advance_ns(phase_ms * 1_000_000)
        data = port.read_available()
        port.write(request)
        messages = mavlink_messages(data + heard(port, clock, 0.2, step_s))
        assert {"COMMAND_ACK", "RPM"} < {m.get_type() for m in messages}
        steps = np.diff([m.get_seq() for m in messages]) % 256
        assert set(steps) == {1}, f"command {phase_ms} ms after power-on"


def test_what_the_autopilot_says_is_what_it_feels(powered, clock):
    port = powered().port(AUTOPILOT, 57600)
    by_type = {m.get_type(): m for m in mavlink_messages(heard(port, clock, 3.0)[: -1 * 100])}
    attitude, servo = by_type["ATTITUDE"], by_type["SERVO_OUTPUT_RAW"]
    assert (attitude.roll, attitude.pitch, attitude.yaw) == pytest.approx((0.1, 0.05, -2.0), abs=1e-6)
    assert [getattr(servo, f"servo{i}_raw") for i in range(1, 9)] == [1500, 1480, 1200, 1500, 1000, 1000, 1000, 2000]
    assert by_type["SYS_STATUS"].voltage_battery == 15200
    battery = by_type["BATTERY_STATUS"]
    assert sum(v for v in battery.voltages if v != 65535) == pytest.approx(15200, abs=4)
    assert battery.current_battery == 1234


def test_what_was_sent_before_opening_is_lost(powered, clock):
    tray = powered(after_s=30.0)
    assert len(tray.port(ESC, 115200).read_available()) <= 4


def test_an_unread_line_keeps_what_the_kernel_would(powered, clock):
    port = powered().port(ESC, 115200)
    clock.advance_ns(60_000_000_000)
    assert len(port.read_available()) == 4095


@pytest.mark.parametrize("name", ["/dev/ttyUSB7", "/dev/i2c-9"])
def test_an_unknown_device_is_missing_as_in_the_system(powered, name):
    tray = powered()
    with pytest.raises(FileNotFoundError) as caught:
        tray.i2c(name) if "i2c" in name else tray.port(name, 9600)
    assert caught.value.filename == name


def test_an_absent_address_does_not_acknowledge(bus_of):
    with pytest.raises(OSError) as caught:
        bus_of().read(0x50, 1)
    assert caught.value.errno == 121


def test_transfers_take_their_time_on_the_clock(bus_of, clock):
    bus, before_ns = bus_of(), clock.now_ns()
    bus.read(0x28, 4)
    assert clock.now_ns() - before_ns == 5 * 9 * 2500  # five bytes of nine bits at 400 kHz


def test_pyserial_reads_a_pseudo_terminal():
    serial = pytest.importorskip("serial")
    tray = FakeTray(AnalyticSensorTruth(), RealClock())
    with PtyServer(tray.port(ESC, 115200)) as server, serial.Serial(server.path, 115200, timeout=0) as line:
        data, give_up = b"", time.monotonic() + GIVE_UP_S
        while len(data) < 80 and time.monotonic() < give_up:
            os.sched_yield()
            data += line.read(line.in_waiting or 1)
    periods = [int.from_bytes(data[i + 1 : i + 4], "big") for i in range(data.index(b"x"), len(data) - 3, 4)]
    assert len(periods) >= 15 and set(periods) <= {14285, 14286}


def test_a_receiver_is_configured_over_a_pseudo_terminal():
    serial = pytest.importorskip("serial")
    tray = FakeTray(AnalyticSensorTruth(), RealClock())
    with PtyServer(tray.port("/dev/ttyAMA0", 9600)) as server, serial.Serial(server.path, 38400, timeout=0.05) as line:
        # The server looks at the line's speed after bytes have arrived and before it passes them on.
        line.write(bytes.fromhex("b562060806006400010001007a12"))
        data, give_up = b"", time.monotonic() + GIVE_UP_S
        while b"\xb5\x62\x05\x01\x02\x00\x06\x08" not in data and time.monotonic() < give_up:
            data += line.read(64)
    assert b"\xb5\x62\x05\x01\x02\x00\x06\x08" in data
