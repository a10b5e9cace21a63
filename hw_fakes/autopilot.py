"""A fake autopilot that sends MAVLink 2 on a serial line, encoded by pymavlink."""

import heapq
from collections.abc import Iterable
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flightpower.flight.arrays import Array
from flightpower.hw_fakes.sample_blocks import SampleBlocks
from flightpower.sim.sensor_truth import SensorTruth

BAUD = 57600  # the usual setting of a telemetry port
PERIOD_MS = {
    "HEARTBEAT": 1000,
    "ATTITUDE": 40,
    "SERVO_OUTPUT_RAW": 40,
    "RC_CHANNELS": 100,
    "SYS_STATUS": 500,
    "BATTERY_STATUS": 500,
}
ON_REQUEST = ("RPM",)
NAME_OF_ID = {getattr(mavlink, f"MAVLINK_MSG_ID_{name}"): name for name in (*PERIOD_MS, *ON_REQUEST)}
GRID_MS = 20  # step of sampling and sending; it divides every period above
GRID_S = GRID_MS * 1e-3
REPLY_NS = 2_000_000
CELLS = 4
UNKNOWN_U16, UNKNOWN_PERCENT, UNMEASURED_RPM = 65535, -1, -1.0
OFFICIAL = 255  # FIRMWARE_VERSION_TYPE, the lowest byte of a version; the bytes above it are major, minor and patch
VERSION = mavlink.MAVLink_autopilot_version_message(
    0, 4 << 24 | 5 << 16 | 7 << 8 | OFFICIAL, 0, 0, 0, bytes(8), bytes(8), bytes(8), 0, 0, 0
)


class FakeAutopilot:
    """Sends its messages periodically; SET_MESSAGE_INTERVAL changes the periods.

    Stick positions equal the servo outputs, as in manual flight. cells: number of battery cells, all at one voltage.
    """

    baud = BAUD

    def __init__(self, sensor_truth: SensorTruth, cells: int = CELLS):
        self._sensor_truth = sensor_truth
        self._cells = cells
        self._mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._period_ms = dict(PERIOD_MS)
        self._due = [(period_ms, name) for name, period_ms in PERIOD_MS.items()]
        heapq.heapify(self._due)
        self._link = mavlink.MAVLink(None)  # parser of received bytes
        self._link.robust_parsing = True
        self._replies: list[tuple[int, Any]] = []  # time of sending [ns], and message without its number
        self._blocks = SampleBlocks(self._values, GRID_S, length=64)

    def output(self, until_ns: int) -> Iterable[tuple[int, bytes]]:
        sent = [reply for reply in self._replies if reply[0] <= until_ns]
        self._replies = self._replies[len(sent) :]
        while self._due and self._due[0][0] * 1_000_000 <= until_ns:
            at_ms, name = self._due[0]
            heapq.heapreplace(self._due, (at_ms + self._period_ms[name], name))
            sent.append((at_ms * 1_000_000, self._message(name, at_ms)))
        # MAVLink numbers the messages of a link in the order in which they are sent.
        return [(at_ns, self._packed(message)) for at_ns, message in sorted(sent, key=lambda item: item[0])]

    def receive(self, data: bytes, at_ns: int) -> None:
        for message in self._link.parse_buffer(data) or ():
            if message.get_type() == "COMMAND_LONG" and message.target_system in (0, self._mav.srcSystem):
                result = self._command(message, at_ns)
                answer = mavlink.MAVLink_command_ack_message(message.command, result)
                self._replies.append((at_ns + REPLY_NS, answer))

    def _command(self, message: Any, at_ns: int) -> Any:
        """Carry out a COMMAND_LONG. Returns the MAV_RESULT."""
        if message.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            if int(message.param1) != mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
                return mavlink.MAV_RESULT_DENIED
            self._replies.append((at_ns + REPLY_NS, VERSION))
            return mavlink.MAV_RESULT_ACCEPTED
        if message.command != mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            return mavlink.MAV_RESULT_UNSUPPORTED
        name, interval_us = NAME_OF_ID.get(int(message.param1)), message.param2
        if name is None or (name in ON_REQUEST and interval_us == 0):
            return mavlink.MAV_RESULT_DENIED
        self._due = [(at_ms, other) for at_ms, other in self._due if other != name]
        if interval_us >= 0:  # -1 stops the message, 0 restores its default period
            wanted_ms = interval_us / 1e3 or PERIOD_MS[name]
            self._period_ms[name] = GRID_MS * max(1, round(wanted_ms / GRID_MS))
            self._due.append(((at_ns // (GRID_MS * 1_000_000) + 1) * GRID_MS, name))
        heapq.heapify(self._due)
        return mavlink.MAV_RESULT_ACCEPTED

    def _values(self, t_s: Array) -> np.ndarray:
        """Rows of roll, pitch, yaw and their rates, voltage, current, eight pulse widths, and motor speed."""
        attitude = self._sensor_truth.autopilot_attitude_rad(t_s)
        rates = np.gradient(np.unwrap(attitude, axis=0), GRID_S, axis=0)
        voltage, current = self._sensor_truth.battery(t_s)
        pulses, speed = self._sensor_truth.servo_pulses_us(t_s), self._sensor_truth.motor_speed_revps(t_s)
        return np.column_stack([attitude, rates, voltage, current, pulses, speed])

    def _message(self, name: str, at_ms: int) -> Any:
        row = self._blocks.row(round(at_ms * 1e-3 / GRID_S)).tolist()
        voltage_mV, current_cA = round(row[6] * 1e3), round(row[7] * 1e2)
        pulses = [round(pulse) for pulse in row[8:16]]
        match name:
            case "HEARTBEAT":
                return mavlink.MAVLink_heartbeat_message(
                    mavlink.MAV_TYPE_FIXED_WING,
                    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
                    mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED | mavlink.MAV_MODE_FLAG_SAFETY_ARMED,
                    0,
                    mavlink.MAV_STATE_ACTIVE,
                    3,
                )
            case "ATTITUDE":
                return mavlink.MAVLink_attitude_message(at_ms, *row[0:6])
            case "SERVO_OUTPUT_RAW":
                return mavlink.MAVLink_servo_output_raw_message(at_ms * 1000 % 2**32, 0, *pulses)
            case "RC_CHANNELS":
                unused = [UNKNOWN_U16] * 10
                return mavlink.MAVLink_rc_channels_message(at_ms, 8, *pulses, *unused, 200)
            case "RPM":
                return mavlink.MAVLink_rpm_message(60 * row[16], UNMEASURED_RPM)
            case "SYS_STATUS":
                return mavlink.MAVLink_sys_status_message(
                    0, 0, 0, 500, voltage_mV, current_cA, UNKNOWN_PERCENT, 0, 0, 0, 0, 0, 0
                )
            case _:
                cells = [voltage_mV // self._cells] * self._cells + [UNKNOWN_U16] * (10 - self._cells)
                return mavlink.MAVLink_battery_status_message(
                    0,
                    mavlink.MAV_BATTERY_FUNCTION_ALL,
                    mavlink.MAV_BATTERY_TYPE_LIPO,
                    32767,
                    cells,
                    current_cA,
                    -1,
                    -1,
                    UNKNOWN_PERCENT,
                )

    def _packed(self, message: Any) -> bytes:
        """The message's bytes, with the link's next sequence number."""
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return data
