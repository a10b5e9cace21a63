"""An autopilot that speaks MAVLink 2 on a serial line, encoded by pymavlink."""

import heapq
from collections.abc import Iterable

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from hw_fakes.blocks import Blocks
from sim.felt import Array, Felt

BAUD = 57600  # the usual setting of a telemetry port
PERIOD_MS = {
    "HEARTBEAT": 1000,
    "ATTITUDE": 40,
    "SERVO_OUTPUT_RAW": 40,
    "RC_CHANNELS": 100,
    "SYS_STATUS": 500,
    "BATTERY_STATUS": 500,
}
GRID_S = 20e-3  # of the physical values; divides every period above
CELLS = 4
UNKNOWN_U16, UNKNOWN_PERCENT = 65535, -1


class Autopilot:
    """Sends on its own, listens to nobody. Stick positions equal the servo outputs: it is flown by hand.

    cells: of the battery; they share its voltage equally.
    """

    baud = BAUD

    def __init__(self, felt: Felt, cells: int = CELLS):
        self._felt = felt
        self._cells = cells
        self._mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._due = [(period_ms, name) for name, period_ms in PERIOD_MS.items()]
        heapq.heapify(self._due)
        self._blocks = Blocks(self._values, GRID_S, length=64)

    def output(self, until_ns: int) -> Iterable[tuple[int, bytes]]:
        sent = []
        while self._due[0][0] * 1_000_000 <= until_ns:
            at_ms, name = self._due[0]
            heapq.heapreplace(self._due, (at_ms + PERIOD_MS[name], name))
            sent.append((at_ms * 1_000_000, self._encode(name, at_ms)))
        return sent

    def receive(self, data: bytes, at_ns: int) -> None:
        """It takes no commands."""

    def _values(self, t_s: Array) -> np.ndarray:
        """Rows: roll pitch yaw and their rates, voltage, current, eight pulse widths."""
        attitude = self._felt.autopilot_attitude_rad(t_s)
        rates = np.gradient(np.unwrap(attitude, axis=0), GRID_S, axis=0)
        voltage, current = self._felt.battery(t_s)
        return np.column_stack([attitude, rates, voltage, current, self._felt.servo_pulses_us(t_s)])

    def _encode(self, name: str, at_ms: int) -> bytes:
        row = self._blocks.row(round(at_ms * 1e-3 / GRID_S)).tolist()
        voltage_mV, current_cA = round(row[6] * 1e3), round(row[7] * 1e2)
        pulses = [round(pulse) for pulse in row[8:16]]
        match name:
            case "HEARTBEAT":
                message = mavlink.MAVLink_heartbeat_message(
                    mavlink.MAV_TYPE_FIXED_WING,
                    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
                    mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED | mavlink.MAV_MODE_FLAG_SAFETY_ARMED,
                    0,
                    mavlink.MAV_STATE_ACTIVE,
                    3,
                )
            case "ATTITUDE":
                message = mavlink.MAVLink_attitude_message(at_ms, *row[0:6])
            case "SERVO_OUTPUT_RAW":
                message = mavlink.MAVLink_servo_output_raw_message(at_ms * 1000 % 2**32, 0, *pulses)
            case "RC_CHANNELS":
                unused = [UNKNOWN_U16] * 10
                message = mavlink.MAVLink_rc_channels_message(at_ms, 8, *pulses, *unused, 200)
            case "SYS_STATUS":
                message = mavlink.MAVLink_sys_status_message(
                    0, 0, 0, 500, voltage_mV, current_cA, UNKNOWN_PERCENT, 0, 0, 0, 0, 0, 0
                )
            case _:
                cells = [voltage_mV // self._cells] * self._cells + [UNKNOWN_U16] * (10 - self._cells)
                message = mavlink.MAVLink_battery_status_message(
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
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return data
