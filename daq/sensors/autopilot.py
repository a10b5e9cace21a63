"""Driver of a MAVLink autopilot: servo and stick pulse widths, attitude, battery, and optionally motor speed.

It reads protocols 1 and 2, see `daq.mavlink_frames`. A line may also carry other senders: a gimbal sends its own
attitude, and a radio forwards other vehicles. The first autopilot heartbeat decides whose messages are read: only those
of its system and component.
"""

import math
from collections.abc import Iterator

from flightpower.daq import mavlink_frames
from flightpower.daq.bus import BytePort
from flightpower.daq.mavlink_frames import (
    BatteryStatus,
    Content,
    Heartbeat,
    MavlinkParser,
    MotorRpm,
    RcChannels,
    ServoOutput,
)
from flightpower.daq.sensors import Sample
from flightpower.daq.sensors.esc_counter import FASTEST_REVPS
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.messages import Attitude, Battery, Controls, Message, Rpm, Status

SILENCE_NS = 500_000_000
BATTERY_SILENCE_NS = 3_000_000_000  # the battery is sent a few times a second at most
HEARTBEAT_NS = 2_500_000_000  # a heartbeat comes once a second, and nothing is read before the first
REQUEST_AGAIN_NS, REQUEST_SELDOM_NS, MOST_REQUESTS = 2_000_000_000, 20_000_000_000, 3  # after so many requests, rarely
ANSWERED_NS, JUDGED_NS = 1_000_000_000, 2_000_000_000  # after a request: first no rate is judged, then over this time
COMPLAINT_NS = 6_000_000_000  # a rate that was too low is reported for this long: more than the spacing of events
# Fractions of the requested rate. Below the first the rate is requested again, since an autopilot that restarts forgets
# it, and another station can change it. Below the second it is reported; a line that is slightly too slow for the rate
# stays above.
ENOUGH, FAR_TOO_FEW = 0.8, 0.4
OUR_SYSTEM, OUR_COMPONENT = 255, 191  # a ground station's system; MAV_COMP_ID_ONBOARD_COMPUTER
NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID
SET_MESSAGE_INTERVAL = 511  # MAV_CMD
BATTERY_RATE_HZ = 2.0
UNKNOWN_MILLIVOLT = 0xFFFF
UNUSED_CHANNEL = 0xFFFF
SERVO_PULSES_US = frozenset({0, *range(500, 2501)})  # possible pulses of any servo; 0 means off
LARGEST_ANGLE_RAD, LARGEST_YAW_RAD = math.pi + 0.01, 100.0  # some senders' yaw accumulates turns
PULSE_LOW_US, PULSE_SPAN_US = 1000.0, 1000.0


class AutopilotDriver:
    """The autopilot on `port`.

    aircraft: converts pulse widths into angles; without it only pulse widths are logged. rate_Hz: requested rate of
    attitude and pulse widths. rpm: also read motor speed, from RPM (ArduPilot, first sensor) or RAW_RPM (index 0).
    battery: read the battery.

    Stick positions are added to the next message on /controls, once.
    """

    def __init__(
        self, port: BytePort, *, aircraft: Aircraft | None, rate_Hz: float, rpm: bool = False, battery: bool = True
    ):
        self._port = port
        self._aircraft = aircraft
        self._rate_Hz = rate_Hz
        self._parser = MavlinkParser()
        self._silence_ns = {"/controls": SILENCE_NS, "/attitude": SILENCE_NS}
        if battery:
            self._silence_ns["/battery"] = BATTERY_SILENCE_NS
        if rpm:
            self._silence_ns["/rpm"] = SILENCE_NS
        self._sender: tuple[int, int] | None = None  # system and component of the autopilot, once it has been heard
        self._last_ns: dict[str, int] = {}
        self._first_ns: int | None = None
        self._requested_ns: int | None = None
        self._requests = 0  # successive requests after which the rates were still too low
        self._received: dict[str, int] = {}  # number of messages by topic since rates are counted again
        self._judged_from_ns = 0
        self._slow = False
        self._complaint_ns = 0
        self.complaint = ""
        self._has_battery_status = False
        self._sticks: list[int] | None = None
        self._damaged = False  # whether damaged bytes came since the last valid message

    @property
    def system_id(self) -> int | None:
        """MAVLink system of the autopilot, once it has been heard."""
        return None if self._sender is None else self._sender[0]

    def start(self) -> Iterator[float]:
        """There is nothing to wait for."""
        yield 0.0

    def read(self, now_ns: int) -> list[Sample]:
        """The latest message on each topic. An overdue topic gets `no_data`, or `corrupt` after damaged bytes."""
        newest: dict[str, Message] = {}
        received = False
        rejected = self._parser.rejected
        for system, component, content in self._parser.feed(self._port.read_available()):
            sender = system, component
            if isinstance(content, Heartbeat):
                if self._sender is None and is_autopilot(content):
                    self._sender = sender
                received |= sender == self._sender
            elif sender == self._sender:
                self._take(content, newest)
        self._damaged |= self._parser.rejected > rejected
        self._damaged &= not newest
        newest = {topic: message for topic, message in newest.items() if topic in self._silence_ns}
        silent = False
        self._first_ns = self._first_ns or now_ns
        waiting = self._sender is None and now_ns - self._first_ns < HEARTBEAT_NS
        for topic, limit_ns in self._silence_ns.items():
            if waiting or topic in newest or topic not in self._last_ns:
                self._last_ns[topic] = now_ns
            elif now_ns - self._last_ns[topic] >= limit_ns:
                newest[topic] = SILENT[topic](status=Status.CORRUPT if self._damaged else Status.NO_DATA)
                silent = True
        self._judge_rates(now_ns)
        if received and self._request_is_due(silent or self._slow, now_ns):
            self._request_messages()
            self._requested_ns, self._judged_from_ns = now_ns, now_ns + ANSWERED_NS
            self._requests += self._slow
            self._slow = False
            self._received.clear()
        return [Sample(topic, now_ns, message) for topic, message in newest.items()]

    def _request_is_due(self, missing: bool, now_ns: int) -> bool:
        """Whether the messages must be requested. missing: whether some are absent or too rare."""
        if self._requested_ns is None:
            return True
        spacing_ns = REQUEST_AGAIN_NS if self._requests < MOST_REQUESTS else REQUEST_SELDOM_NS
        return missing and now_ns - self._requested_ns >= spacing_ns

    def _judge_rates(self, now_ns: int) -> None:
        """Compare the number of messages in two seconds with the number requested. Silence is shown by a status."""
        elapsed_ns = now_ns - self._judged_from_ns
        if self._requested_ns is None or elapsed_ns < 0:
            self._received.clear()
            return
        if elapsed_ns < JUDGED_NS:
            return
        wanted = self._rate_Hz * elapsed_ns * 1e-9
        self._slow = any(n < ENOUGH * wanted for n in self._received.values())
        self._requests = self._requests if self._slow else 0
        few = {topic: n for topic, n in self._received.items() if n < ENOUGH * wanted}
        rates = ", ".join(f"{n / elapsed_ns * 1e9:.0f} of {topic}" for topic, n in few.items())
        if few and (self._requests == 0 or min(few.values()) < FAR_TOO_FEW * wanted):
            self.complaint = f"sends {rates} a second, asked for {self._rate_Hz:g}: raise its baud rate"
            self._complaint_ns = now_ns
        elif now_ns - self._complaint_ns >= COMPLAINT_NS:
            self.complaint = ""
        self._received.clear()
        self._judged_from_ns = now_ns

    def _take(self, content: Content, newest: dict[str, Message]) -> None:
        match content:
            case ServoOutput():
                if content.port == 0:
                    self._count("/controls")
                    newest["/controls"] = message = servo_controls(pulses_us(content), self._aircraft)
                    message.stick_pulse_us, self._sticks = self._sticks, None
            case mavlink_frames.Attitude():
                self._count("/attitude")
                newest["/attitude"] = attitude(content)
            case RcChannels():
                self._sticks = sticks_us(content)
            case BatteryStatus():
                if content.id == 0:
                    self._has_battery_status = True
                    newest["/battery"] = battery(content)
            case mavlink_frames.SysStatus():
                if not self._has_battery_status:
                    newest["/battery"] = _battery(content.voltage_battery, content.current_battery)
            case MotorRpm():
                if content.sensor == 0:
                    self._count("/rpm")
                    newest["/rpm"] = motor_speed(content.rpm)

    def _count(self, topic: str) -> None:
        self._received[topic] = self._received.get(topic, 0) + 1

    def _request_messages(self) -> None:
        wanted = {
            mavlink_frames.SERVO_OUTPUT_RAW: self._rate_Hz,
            mavlink_frames.RC_CHANNELS: self._rate_Hz,
            mavlink_frames.ATTITUDE: self._rate_Hz,
            mavlink_frames.BATTERY_STATUS: BATTERY_RATE_HZ,
        }
        if "/rpm" in self._silence_ns:
            wanted[mavlink_frames.RPM] = wanted[mavlink_frames.RAW_RPM] = self._rate_Hz
        assert self._sender is not None
        ours = (OUR_SYSTEM, OUR_COMPONENT)
        for message_id, rate_Hz in wanted.items():
            parameters = (message_id, 1e6 / rate_Hz)
            self._port.write(mavlink_frames.command_frame(0, ours, self._sender, SET_MESSAGE_INTERVAL, parameters))


SILENT: dict[str, type[Message]] = {"/controls": Controls, "/attitude": Attitude, "/battery": Battery, "/rpm": Rpm}


def is_autopilot(received: Heartbeat) -> bool:
    """Whether this is the autopilot's own heartbeat, not one forwarded from a ground station or camera."""
    return received.autopilot != NO_AUTOPILOT


def pulses_us(received: ServoOutput) -> list[int]:
    """Pulse widths of outputs 1 to 8, or 1 to 16 if any output above 8 is used."""
    pulses = list(received.pulses_us)
    return pulses if any(pulses[8:]) else pulses[:8]


def sticks_us(received: RcChannels) -> list[int]:
    """Pulse widths of the receiver's channels; 0 for an unused channel, or for a value that is no servo pulse."""
    return [pulse if pulse in SERVO_PULSES_US else 0 for pulse in received.pulses_us[: received.channels]]


def attitude(received: mavlink_frames.Attitude) -> Attitude:
    """The message for an attitude. NaN means "not estimated"; roll or pitch beyond half a turn is invalid."""
    if not all(map(math.isfinite, received)):
        return Attitude(status=Status.NO_DATA)
    if max(abs(received.roll), abs(received.pitch)) > LARGEST_ANGLE_RAD or abs(received.yaw) > LARGEST_YAW_RAD:
        return Attitude(status=Status.CORRUPT)
    return Attitude(roll_rad=received.roll, pitch_rad=received.pitch, yaw_rad=received.yaw)


def motor_speed(rpm: float) -> Rpm:
    """The message for a speed in rev/min. A negative or non-finite value means "not measured"."""
    if not 0 <= rpm < math.inf:
        return Rpm(status=Status.NO_DATA)
    return Rpm(motor_speed_revps=rpm / 60) if rpm / 60 <= FASTEST_REVPS else Rpm(status=Status.CORRUPT)


def servo_controls(pulse_us: list[int], aircraft: Aircraft | None) -> Controls:
    """`controls` of the servo outputs. The message has no values if an output that the aircraft uses has no valid servo
    pulse, or no output has one; other outputs without a valid pulse count as off.
    """
    if SERVO_PULSES_US.issuperset(pulse_us):
        return controls(pulse_us, aircraft)
    wrong = {channel for channel, pulse in enumerate(pulse_us, 1) if pulse not in SERVO_PULSES_US}
    if wrong & channels_of(aircraft) or len(wrong) == len(pulse_us):
        return Controls(status=Status.CORRUPT)
    return controls([0 if channel in wrong else pulse for channel, pulse in enumerate(pulse_us, 1)], aircraft)


def channels_of(aircraft: Aircraft | None) -> set[int]:
    """The outputs that move a surface of the aircraft or its throttle."""
    if aircraft is None:
        return set()
    surfaces = (aircraft.elevator, aircraft.aileron, aircraft.rudder)
    return {aircraft.propulsion.throttle_channel, *(surface.channel for surface in surfaces if surface is not None)}


def controls(pulse_us: list[int], aircraft: Aircraft | None) -> Controls:
    """Surface angles from the aircraft file's tables. A pulse of 0 is an output that is off and has no angle."""
    message = Controls(pulse_us=pulse_us)
    if aircraft is None:
        return message

    def pulse(channel: int) -> int:
        return pulse_us[channel - 1] if channel <= len(pulse_us) else 0

    for name in ("elevator", "aileron", "rudder"):
        surface = getattr(aircraft, name)
        if surface is not None and pulse(surface.channel):
            setattr(message, f"{name}_rad", surface.angle_of_pulse_rad(pulse(surface.channel)))
    throttle_us = pulse(aircraft.propulsion.throttle_channel)
    if throttle_us:
        message.throttle = min(max((throttle_us - PULSE_LOW_US) / PULSE_SPAN_US, 0.0), 1.0)
    return message


def battery(received: BatteryStatus) -> Battery:
    """The message for a battery. Its voltage is the sum over cells; a pack measured as a whole counts as one cell."""
    cells = [cell for cell in received.voltages if cell != UNKNOWN_MILLIVOLT]
    return _battery(sum(cells) if cells else UNKNOWN_MILLIVOLT, received.current_battery)


def _battery(millivolt: int, centiampere: int) -> Battery:
    """The message for raw values. A current of -1 or a voltage of 65535 means "not measured"."""
    voltage_V = None if millivolt == UNKNOWN_MILLIVOLT else millivolt / 1e3
    current_A = None if centiampere < 0 else centiampere / 1e2
    if voltage_V is None and current_A is None:
        return Battery(status=Status.NO_DATA)
    return Battery(voltage_V=voltage_V, current_A=current_A)
