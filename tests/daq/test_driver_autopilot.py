"""The autopilot: MAVLink made by pymavlink, angles by the aircraft's tables, silence, and damaged bytes."""

import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scripted_parts import ScriptedPort, bring_up, pieces

from flightpower.daq.mavlink_frames import KINDS, MARKER_1, MARKER_2, BatteryStatus, MavlinkParser, command_frame
from flightpower.daq.sensors.autopilot import AutopilotDriver, battery, controls, motor_speed, servo_controls
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.messages import Attitude, Controls, Rpm, Status

TICK_NS = 40_000_000
NEXSTAR = load_aircraft("nexstar")
SENDER = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
PULSES = [1500, 1750, 1400, 1500, 1000, 1000, 1000, 1000]


def packed(message) -> bytes:
    return bytes(message.pack(SENDER))


def servo(pulses=PULSES) -> bytes:
    return packed(mavlink.MAVLink_servo_output_raw_message(1000, 0, *pulses))


def attitude() -> bytes:
    return packed(mavlink.MAVLink_attitude_message(1000, 0.1, -0.2, 3.0, 0, 0, 0))


def heartbeat() -> bytes:
    return packed(mavlink.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3))


def autopilot(*, heard: bool = True, **options) -> tuple[ScriptedPort, AutopilotDriver]:
    """A driver and its port; `heard` says whether the autopilot's first heartbeat has arrived."""
    port = ScriptedPort()
    sensor = AutopilotDriver(port, aircraft=NEXSTAR, rate_Hz=25, **options)
    bring_up(sensor)
    if heard:
        port.incoming = [heartbeat()]
        sensor.read(0)
    return port, sensor


def test_pulse_widths_become_angles_by_the_aircrafts_tables():
    message = controls(PULSES, NEXSTAR)
    assert message.pulse_us == PULSES
    assert message.elevator_rad == pytest.approx(math.radians(10.8))  # channel 2 at 1750 us, in the aircraft file
    assert message.aileron_rad == pytest.approx(0) and message.rudder_rad == pytest.approx(0)
    assert message.throttle == pytest.approx(0.4)


def test_an_output_that_is_off_has_no_angle():
    message = controls([1500, 0, 1400, 1500, 0, 0, 0, 0], NEXSTAR)
    assert message.elevator_rad is None and message.aileron_rad == pytest.approx(0)


def test_without_an_aircraft_only_pulse_widths_are_logged():
    assert controls(PULSES, None).elevator_rad is None


def test_messages_of_a_tick():
    port, sensor = autopilot()
    port.incoming = [servo() + attitude() + servo([1500] * 8)]
    samples = {sample.topic: sample.message for sample in sensor.read(5)}
    assert samples["/controls"].pulse_us == [1500] * 8  # the latest
    assert samples["/attitude"].pitch_rad == pytest.approx(-0.2)
    assert set(samples) == {"/controls", "/attitude"}


def battery_status(voltages, current_battery) -> BatteryStatus:
    """A battery status as it comes off the wire."""
    data = packed(mavlink.MAVLink_battery_status_message(0, 0, 1, 0, voltages, current_battery, 0, 0, 50))
    return MavlinkParser().feed(data)[0].content


def test_battery_from_either_message():
    unknown = [0xFFFF] * 6
    message = battery(battery_status([3700] * 4 + unknown, 2050))
    assert (message.voltage_V, message.current_A) == pytest.approx((14.8, 20.5))
    assert battery(battery_status([0xFFFF] * 10, -1)).status is Status.NO_DATA
    port, sensor = autopilot()
    port.incoming = [packed(mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 14800, 2050, 50, 0, 0, 0, 0, 0, 0))]
    assert sensor.read(0)[0].message == message


def of_another(message, system: int, component: int) -> bytes:
    """A message from another sender on the same line."""
    return bytes(message.pack(mavlink.MAVLink(None, srcSystem=system, srcComponent=component)))


GIMBAL, OTHER_VEHICLE, GROUND_STATION = (7, 154), (2, 1), (255, 190)  # system and component


@pytest.mark.parametrize("sender", [GIMBAL, OTHER_VEHICLE, GROUND_STATION])
def test_what_others_on_the_line_send_is_not_the_aircrafts(sender):
    port, sensor = autopilot()
    port.incoming = [
        of_another(mavlink.MAVLink_attitude_message(0, 0, 1.0, 0, 0, 0, 0), *sender)
        + of_another(mavlink.MAVLink_servo_output_raw_message(0, 0, *[1111] * 8), *sender)
        + of_another(mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 7000, 10, 50, 0, 0, 0, 0, 0, 0), *sender)
    ]
    assert sensor.read(TICK_NS) == []
    port.incoming = [of_another(mavlink.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3), *sender) + attitude()]
    (own,) = sensor.read(2 * TICK_NS)
    assert own.message.pitch_rad == pytest.approx(-0.2) and sensor.system_id == 7


@pytest.mark.parametrize("before", [b"", "gimbal's heartbeat"])
def test_nothing_is_read_before_an_autopilot_has_said_that_it_is_one(before):
    port, sensor = autopilot(heard=False)
    gimbals = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GIMBAL, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
    port.incoming = [(of_another(gimbals, *GIMBAL) if before else b"") + attitude(), heartbeat() + attitude()]
    assert sensor.read(0) == [] and sensor.system_id is None
    assert [s.message.pitch_rad for s in sensor.read(TICK_NS)] == [pytest.approx(-0.2)]


def test_each_kind_that_stays_away_is_said_to_and_the_others_are_not():
    port, sensor = autopilot()
    statuses: dict[str, list[Status]] = {}
    for tick in range(1, 27):
        port.incoming.append(attitude())
        for sample in sensor.read(tick * TICK_NS):
            statuses.setdefault(sample.topic, []).append(sample.message.status)
    assert statuses["/attitude"] == [Status.OK] * 26
    assert set(statuses["/controls"]) == {Status.NO_DATA} and len(statuses["/controls"]) == 14
    assert "/battery" not in statuses


def test_streams_are_asked_for_when_a_heartbeat_is_heard():
    port, sensor = autopilot(heard=False)
    sensor.read(0)
    assert port.written == []
    port.incoming = [heartbeat()]
    sensor.read(TICK_NS)
    requests = [mavlink.MAVLink(None).parse_buffer(data)[0] for data in port.written]
    assert {message.get_type() for message in requests} == {"COMMAND_LONG"}
    assert {message.target_system for message in requests} == {7}
    intervals_us = {int(message.param1): message.param2 for message in requests}
    assert intervals_us[mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW] == pytest.approx(40_000)


@pytest.mark.parametrize(
    "message", [mavlink.MAVLink_raw_rpm_message(0, 7200.0), mavlink.MAVLink_rpm_message(7200.0, -1.0)]
)
def test_motor_speed_only_when_wanted(message):
    for wanted in (True, False):
        port, sensor = autopilot(rpm=wanted)
        port.incoming = [packed(message)]
        assert [s.message.motor_speed_revps for s in sensor.read(0)] == ([pytest.approx(120)] if wanted else [])


@pytest.mark.parametrize("rpm", [-1.0, math.nan, math.inf])
def test_a_motor_speed_that_was_not_measured_is_no_data(rpm):
    assert motor_speed(rpm) == Rpm(status=Status.NO_DATA)


def test_a_motor_speed_of_no_motor_is_corrupt():
    assert motor_speed(149_000.0).motor_speed_revps == pytest.approx(2483, abs=1)
    assert motor_speed(1e30) == Rpm(status=Status.CORRUPT)


@pytest.mark.parametrize("angles", [(0.1, 3.5, 0), (-4.0, 0, 0), (0, 0, -1e9)])
def test_an_attitude_that_cannot_be_is_corrupt(angles):
    port, sensor = autopilot()
    port.incoming = [packed(mavlink.MAVLink_attitude_message(1000, *angles, 0, 0, 0))]
    assert sensor.read(0)[0].message == Attitude(status=Status.CORRUPT)


@pytest.mark.parametrize(
    ("output", "pulse", "status"),
    [(2, 65535, Status.CORRUPT), (3, 300, Status.CORRUPT), (7, 65535, Status.OK), (2, 0, Status.OK)],
)
def test_what_is_no_pulse_of_a_servo_is_no_angle(output, pulse, status):
    """Outputs 2 and 3 move elevator and throttle; output 7 is unused and hides nothing."""
    message = servo_controls([*PULSES[: output - 1], pulse, *PULSES[output:]], NEXSTAR)
    assert message.status is status
    if status is Status.OK:
        assert message.pulse_us[output - 1] == 0 and message.throttle == pytest.approx(0.4)
        assert (message.elevator_rad is None) == (output == 2)
    assert servo_controls([65535] * 8, None) == Controls(status=Status.CORRUPT)


def test_a_stick_without_a_pulse_has_none():
    port, sensor = autopilot()
    port.incoming = [sticks([1500, 40_000, 1300, 1500]) + servo()]
    assert sensor.read(0)[0].message.stick_pulse_us[:4] == [1500, 0, 1300, 1500]


def sticks(pulses, count=8) -> bytes:
    return packed(mavlink.MAVLink_rc_channels_message(1000, count, *pulses, *[0xFFFF] * (18 - len(pulses)), 200))


def test_what_the_sticks_say_stands_once_beside_what_the_servos_are_reported():
    """Sticks and servo outputs differ when the autopilot flies; neither replaces the other."""
    moved = [1600, 1400, 1300, 1500]
    port, sensor = autopilot()
    port.incoming = [sticks(moved, count=5), servo(), servo()]
    messages = [[s.message for s in sensor.read(tick)] for tick in range(1, 4)]
    assert messages[0] == []
    assert (messages[1][0].pulse_us, messages[1][0].stick_pulse_us) == (PULSES, [*moved, 0])  # 65535: no such channel
    assert (messages[2][0].pulse_us, messages[2][0].stick_pulse_us) == (PULSES, None)


def streaming(sensor, port, rate_Hz: float, seconds: float, begin_s: float) -> float:
    """Stream attitude and servo outputs at a rate, and a heartbeat a second; return the end [s]."""
    for tick in range(round(seconds * 25)):
        now_s = begin_s + tick / 25
        due = tick * rate_Hz % 25 < rate_Hz
        port.incoming.append((heartbeat() if tick % 25 == 0 else b"") + ((attitude() + servo()) if due else b""))
        sensor.read(round(now_s * 1e9))
    return begin_s + seconds


def requested(port) -> int:
    """How often attitude was requested."""
    decoded_ = [mavlink.MAVLink(None).parse_buffer(data)[0] for data in port.written]
    return sum(int(message.param1) == mavlink.MAVLINK_MSG_ID_ATTITUDE for message in decoded_)


def test_rates_that_the_autopilot_does_not_keep_are_requested_again_and_reported():
    port, sensor = autopilot(battery=False)
    at_s = streaming(sensor, port, 25, 10, begin_s=1)
    assert requested(port) == 1 and sensor.complaint == ""
    at_s = streaming(sensor, port, 4, 5, begin_s=at_s)  # it has restarted and uses its own message rates
    assert requested(port) == 2 and "4 of /attitude, 4 of /controls a second, asked for 25" in sensor.complaint
    at_s = streaming(sensor, port, 25, 10, begin_s=at_s)
    before = requested(port)
    assert before <= 3 and sensor.complaint == ""
    streaming(sensor, port, 15, 60, begin_s=at_s)  # as fast as the line can: asked three times, and then seldom
    assert 4 <= requested(port) - before <= 7 and sensor.complaint == ""


def test_damaged_messages_are_corrupt_rather_than_silent():
    port, sensor = autopilot()
    damaged = bytearray(attitude())
    damaged[15] ^= 1
    statuses = set()
    for tick in range(20):
        port.incoming.append(bytes(damaged))
        statuses |= {(sample.topic, sample.message.status) for sample in sensor.read(tick * TICK_NS)}
    assert statuses == {("/attitude", Status.CORRUPT), ("/controls", Status.CORRUPT)}


@given(st.binary(max_size=400), st.lists(st.integers(0, 10_000), max_size=6))
def test_any_bytes_in_any_pieces_never_raise_and_messages_after_them_are_found(noise, cuts):
    port, sensor = autopilot()
    port.incoming = pieces(noise + servo() * 20, cuts)
    samples = [s for tick in range(len(port.incoming)) for s in sensor.read(tick)]
    assert samples[-1].message.pulse_us == PULSES


def values_of(content) -> list:
    """All values of a message, in one list."""
    return [each for value in content for each in (value if isinstance(value, tuple) else [value])]


def expected(message) -> list:
    """The reading of a message decoded by pymavlink."""
    pulses = [getattr(message, f"servo{i}_raw", None) for i in range(1, 17)]
    channels = [getattr(message, f"chan{i}_raw", None) for i in range(1, 19)]
    match message.get_type():
        case "HEARTBEAT":
            return [message.autopilot]
        case "SYS_STATUS":
            return [message.voltage_battery, message.current_battery]
        case "ATTITUDE":
            return [message.roll, message.pitch, message.yaw]
        case "SERVO_OUTPUT_RAW":
            return [message.port, *pulses]
        case "RC_CHANNELS":
            return [message.chancount, *channels]
        case "BATTERY_STATUS":
            return [message.id, *message.voltages, message.current_battery]
        case "RPM":
            return [message.rpm1, 0]
        case _:
            return [message.frequency, message.index]


@given(
    st.lists(st.tuples(st.sampled_from(sorted(KINDS)), st.binary(min_size=80, max_size=80), st.booleans()), max_size=5),
    st.lists(st.integers(0, 10_000), max_size=5),
)
@settings(max_examples=60)
def test_messages_are_those_that_pymavlink_reads(chosen, cuts):
    """Any values are in every message of both protocols, in any pieces, between others that the daemon skips."""
    other, stream = packed(mavlink.MAVLink_raw_pressure_message(0, 1, 2, 3, 4)), b""
    for number, payload, first_protocol in chosen:
        kind = mavlink.mavlink_map[number]
        first_protocol &= number < 256
        message = kind(*decoded(kind, payload))
        stream += other + bytes(message.pack(SENDER, force_mavlink1=first_protocol))
    ours, theirs = MavlinkParser(), mavlink.MAVLink(None)
    received = [each for piece in pieces(stream + other, cuts) for each in ours.feed(piece)]
    wanted = [message for message in theirs.parse_buffer(stream) or () if message.get_msgId() in KINDS]
    assert repr([values_of(each.content) for each in received]) == repr([expected(message) for message in wanted])
    assert ours.rejected == 0 and {each[:2] for each in received} <= {(7, 1)}


def decoded(kind, payload) -> list:
    """The arguments of a message, from the bytes of its payload."""
    values = list(kind.unpacker.unpack(payload[: kind.unpacker.size]))
    fields = []
    for name in kind.ordered_fieldnames:
        length = kind.array_lengths[kind.ordered_fieldnames.index(name)]
        fields.append(values[:length] if length else values[0])
        del values[: length or 1]
    return [fields[kind.ordered_fieldnames.index(name)] for name in kind.fieldnames]


@given(st.binary(max_size=300), st.integers(0, 30))
@example(noise=b"\xfd\x00\xff" + bytes(9), lost=0)
@example(noise=b"\xfeO\x00\x00\x00\x02" + bytes(6), lost=9)  # ends where a message begins
@settings(max_examples=60)
def test_a_message_after_noise_or_a_loss_is_found_when_its_successors_are_there(noise, lost):
    """Bytes that look like the head of a frame delay what follows by the length of a frame, and lose none of it; but an
    unknown message that ends where another begins cannot be recognized as false: at most 280 bytes are lost."""
    parser, message = MavlinkParser(), attitude()
    before = noise + message[lost:]
    received = parser.feed(before + message * 10)
    if not any(unknown(before + message, i) for i in range(len(before) if lost else len(noise))):
        assert len(received) >= 10 or len(noise) + lost == 0
    assert len(received) >= 10 - 280 // len(message) - 1


def unknown(data: bytes, i: int) -> bool:
    """Whether the head of a message whose checksum is unknown here may begin at byte `i`."""
    if data[i] == MARKER_1:
        return data[i + 5] not in KINDS
    return data[i] == MARKER_2 and int.from_bytes(data[i + 7 : i + 10], "little") not in KINDS


def test_a_signed_message_is_read():
    sender = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    sender.signing.secret_key, sender.signing.sign_outgoing = bytes(32), True
    data = bytes(mavlink.MAVLink_attitude_message(1000, 0.1, -0.2, 3.0, 0, 0, 0).pack(sender))
    assert len(data) > len(attitude()) and len(MavlinkParser().feed(data + attitude())) == 2


def test_the_command_is_what_pymavlink_sends():
    link = mavlink.MAVLink(None, srcSystem=255, srcComponent=191)
    command = mavlink.MAVLink_command_long_message(7, 1, 511, 0, 30, 40_000.0, 0, 0, 0, 0, 0)
    assert command_frame(0, (255, 191), (7, 1), 511, (30, 40_000.0)) == bytes(command.pack(link))
