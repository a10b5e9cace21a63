"""Decodes the few MAVLink messages that the daemon reads, and encodes the command that requests them.

pymavlink decodes every message of a dialect, one field at a time; with an autopilot's usual messages it took a third of
the daemon's processor time, and half of its startup time. Here other messages are skipped by their length. The tests
compare the results with pymavlink's (https://mavlink.io/en/guide/serialization.html; fields and CRC_EXTRA: common.xml,
ardupilotmega.xml).
"""

import re
import struct
from binascii import crc_hqx
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

MARKER_1, MARKER_2 = 0xFE, 0xFD
MARKER = re.compile(b"[\xfd\xfe]")
HEAD_1, HEAD_2 = 6, 10  # bytes of the header
CRC_BYTES, SIGNATURE_BYTES = 2, 13
SIGNED = 0x01  # incompatibility flag
REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))  # each byte with its bits in reverse order
COMMAND_LONG, COMMAND_LONG_EXTRA = 76, 152
COMMAND_FIELDS = struct.Struct("<7fHBBB")


class Heartbeat(NamedTuple):
    autopilot: int  # MAV_AUTOPILOT


class SysStatus(NamedTuple):
    voltage_battery: int  # [mV]
    current_battery: int  # [cA]


class Attitude(NamedTuple):
    roll: float  # [rad]
    pitch: float
    yaw: float


class ServoOutput(NamedTuple):
    port: int
    pulses_us: tuple[int, ...]  # outputs 1 to 16; 0 for outputs that the sender does not have


class RcChannels(NamedTuple):
    channels: int  # number of valid channels
    pulses_us: tuple[int, ...]  # channels 1 to 18


class BatteryStatus(NamedTuple):
    id: int
    voltages: tuple[int, ...]  # voltages of cells 1 to 10 [mV]
    current_battery: int  # [cA]


class MotorRpm(NamedTuple):
    """Motor speed from RPM (its first sensor) or RAW_RPM."""

    rpm: float
    sensor: int


Content = Heartbeat | SysStatus | Attitude | ServoOutput | RcChannels | BatteryStatus | MotorRpm


class Kind(NamedTuple):
    """Describes how a message is decoded. payload: its fields on the wire, from the first to the last needed field."""

    crc_extra: int
    payload: struct.Struct
    content: Callable[..., Content]


KINDS: dict[int, Kind] = {
    0: Kind(50, struct.Struct("<5xB"), Heartbeat),
    1: Kind(124, struct.Struct("<14xHh"), SysStatus),
    30: Kind(39, struct.Struct("<4x3f"), Attitude),
    36: Kind(222, struct.Struct("<4x8HB8H"), lambda *f: ServoOutput(f[8], f[:8] + f[9:])),
    65: Kind(118, struct.Struct("<4x18HB"), lambda *f: RcChannels(f[18], f[:18])),
    147: Kind(154, struct.Struct("<10x10HhB"), lambda *f: BatteryStatus(f[11], f[:10], f[10])),
    226: Kind(207, struct.Struct("<f"), partial(MotorRpm, sensor=0)),
    339: Kind(199, struct.Struct("<fB"), MotorRpm),
}
SERVO_OUTPUT_RAW, RC_CHANNELS, ATTITUDE, BATTERY_STATUS, RPM, RAW_RPM = 36, 65, 30, 147, 226, 339  # keys of KINDS


class Received(NamedTuple):
    """A message, and the system and component that sent it."""

    system: int
    component: int
    content: Content


class MavlinkParser:
    """Finds messages of protocols 1 and 2 in a stream of bytes. Messages that are not in KINDS are skipped.

    rejected: number of bytes outside valid frames. Signatures are not checked.
    """

    def __init__(self) -> None:
        self._buffer = b""
        self.rejected = 0

    def feed(self, data: bytes) -> list[Received]:
        """The messages that `data` completes."""
        buffer = self._buffer + data
        received: list[Received] = []
        offset, size = 0, len(buffer)
        while offset < size:
            if buffer[offset] not in (MARKER_1, MARKER_2):
                match = MARKER.search(buffer, offset)
                start = match.start() if match else size
                self.rejected += start - offset
                offset = start
                continue
            head = HEAD_2 if buffer[offset] == MARKER_2 else HEAD_1
            if size - offset < head:
                break
            flags = buffer[offset + 2] if head == HEAD_2 else 0
            if flags & ~SIGNED:  # a frame of a later protocol, or no frame
                self.rejected += 1
                offset += 1
                continue
            if head == HEAD_2:
                system, component = buffer[offset + 5], buffer[offset + 6]
                number = int.from_bytes(buffer[offset + 7 : offset + 10], "little")
            else:
                system, component, number = buffer[offset + 3], buffer[offset + 4], buffer[offset + 5]
            end = offset + head + buffer[offset + 1] + CRC_BYTES
            after = end + SIGNATURE_BYTES if flags else end
            if after > size:
                break
            kind = KINDS.get(number)
            if kind is not None:
                intact = checksum(buffer[offset + 1 : end - CRC_BYTES], kind.crc_extra) == buffer[end - CRC_BYTES : end]
            else:  # its CRC_EXTRA is unknown here, but a frame ends where the next frame begins
                intact = after == size or buffer[after] in (MARKER_1, MARKER_2)
            if not intact:
                self.rejected += 1
                offset += 1
                continue
            if kind is not None:
                layout = kind.payload
                payload = buffer[offset + head : end - CRC_BYTES][: layout.size].ljust(layout.size, b"\0")
                received.append(Received(system, component, kind.content(*layout.unpack(payload))))
            offset = after
        self._buffer = buffer[offset:]
        return received


def checksum(body: bytes, crc_extra: int) -> bytes:
    """CRC-16/MCRF4XX, as sent: crc_hqx of the bytes with reversed bits, with the bits of the result reversed."""
    crc = crc_hqx((body + bytes([crc_extra])).translate(REVERSED), 0xFFFF)
    return bytes([REVERSED[crc >> 8], REVERSED[crc & 0xFF]])


def command_frame(
    sequence: int, sender: tuple[int, int], target: tuple[int, int], command: int, parameters: tuple[float, ...]
) -> bytes:
    """Encode COMMAND_LONG (protocol 2). sender, target: system and component; parameters: up to 7."""
    values = (*parameters, *[0.0] * (7 - len(parameters)))
    payload = COMMAND_FIELDS.pack(*values, command, *target, 0).rstrip(b"\0")
    body = bytes([len(payload), 0, 0, sequence & 0xFF, *sender]) + COMMAND_LONG.to_bytes(3, "little") + payload
    return bytes([MARKER_2]) + body + checksum(body, COMMAND_LONG_EXTRA)
