"""What each part says of itself, for `daq check`; asked after the drivers have brought the parts up.

Parts on a line are listened to for a moment, on the line opened afresh: the sampling knows nothing of this.
"""

from collections.abc import Iterator
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from daq import config
from daq.bus import Buses, BytePort, I2CBus
from daq.clock import Clock
from daq.config import SensorTable
from daq.sensors.autopilot import OUR_COMPONENT, OUR_SYSTEM, is_autopilot
from daq.sensors.esc_counter import FramedParser, LegacyParser
from daq.sensors.ms56xx import MS5611, MS5805, PROM_WORDS, READ_PROM
from daq.sensors.ublox import frame_of, take_frames
from daq.sensors.ublox_ddc import DdcPort

MPU_WHO_AM_I = 0x75
MPU_NAMES = {0x71: "MPU-9250", 0x73: "MPU-9255"}
AK8963_WIA, AK8963_ID = 0x00, 0x48
MON_VER = b"\x0a\x04"  # UBX-MON-VER: software, hardware, then any number of extensions
SOFTWARE, HARDWARE, EXTENSION = 30, 10, 30  # bytes, filled with zeros
LISTEN_EVERY_NS = 20_000_000
RECEIVER_S = 1.5  # it may be in the middle of a solution
COUNTER_S = 1.0
AUTOPILOT_S = 2.5  # a heartbeat comes once a second


def identity(table: SensorTable, buses: Buses, clock: Clock) -> str:
    """One line: the part and where it is; a part that does not answer says why."""
    try:
        return f"{_of_itself(table, buses, clock)}, {_place(table)}"
    except OSError as error:
        return f"{_driver(table)}, {_place(table)}: {error.strerror or error}"


def _of_itself(table: SensorTable, buses: Buses, clock: Clock) -> str:
    match table:
        case config.Mpu9250():
            code = buses.i2c(table.bus).write_read(table.address, bytes([MPU_WHO_AM_I]), 1)[0]
            return MPU_NAMES.get(code, f"unknown (WHO_AM_I 0x{code:02x})")
        case config.Ak8963():
            code = buses.i2c(table.bus).write_read(table.address, bytes([AK8963_WIA]), 1)[0]
            return "AK8963" if code == AK8963_ID else f"unknown (WIA 0x{code:02x})"
        case config.Ms5611() | config.Ms5805():
            variant = MS5611 if isinstance(table, config.Ms5611) else MS5805
            words = _prom(buses.i2c(table.bus), table.address)
            crc = words[variant.crc_word] >> variant.crc_shift & 0xF
            return f"{variant.name} with C1 {words[1]}, CRC 0x{crc:x}"
        case config.Ms45xxDo() | config.Honeywell():
            buses.i2c(table.bus).read(table.address, 4)
            return f"{table.part} (answers; it has no identity)"
        case config.UBlox():
            return _receiver(buses.port(table.port, table.baud), clock)
        case config.UBloxDdc():
            return _receiver(DdcPort(buses.i2c(table.bus), table.address), clock)
        case config.EscCounter():
            return _counter(buses.port(table.port, table.baud), clock, framed=table.framed)
        case config.Autopilot():
            return _autopilot(buses.port(table.port, table.baud), clock)
    return _driver(table)


def _prom(bus: I2CBus, address: int) -> list[int]:
    words = [bus.write_read(address, bytes([READ_PROM + 2 * i]), 2) for i in range(PROM_WORDS)]
    return [int.from_bytes(word, "big") for word in words]


def _heard(port: BytePort, clock: Clock, seconds: float) -> Iterator[bytes]:
    """What arrives within `seconds`, piece by piece."""
    until_ns = clock.now_ns() + round(seconds * 1e9)
    while clock.now_ns() < until_ns:
        clock.sleep_until_ns(clock.now_ns() + LISTEN_EVERY_NS)
        yield port.read_available()


def _receiver(port: BytePort, clock: Clock) -> str:
    """What a u-blox answers to MON-VER."""
    port.write(frame_of(MON_VER, b""))
    buffer = bytearray()
    for data in _heard(port, clock, RECEIVER_S):
        buffer += data
        for frame in take_frames(buffer)[0]:
            if frame[2:4] == MON_VER:
                return f"u-blox {receiver_version(frame[6:-2])}"
    return "u-blox (does not tell its version)"


def receiver_version(payload: bytes) -> str:
    """Software, hardware, and of the extensions those that name module, firmware and protocol."""
    fields = [payload[:SOFTWARE], payload[SOFTWARE : SOFTWARE + HARDWARE]]
    fields += [payload[at : at + EXTENSION] for at in range(SOFTWARE + HARDWARE, len(payload), EXTENSION)]
    software, hardware, *extensions = (field.partition(b"\0")[0].decode("ascii", "replace") for field in fields)
    named = [text for text in extensions if text.startswith(("MOD=", "FWVER=", "PROTVER"))]
    return ", ".join([software, f"hardware {hardware}", *named])


def _counter(port: BytePort, clock: Clock, *, framed: bool) -> str:
    """Which variant the pulse counter speaks, whatever the tray says, and how often."""
    frames = {True: 0, False: 0}
    parsers: dict[bool, FramedParser | LegacyParser] = {True: FramedParser(), False: LegacyParser()}
    for data in _heard(port, clock, COUNTER_S):
        for variant, parser in parsers.items():
            frames[variant] += len(parser.feed(data))
    spoken = frames[True] > 0  # a CRC is not right by chance
    if not frames[spoken]:
        return "pulse counter (no frames)"
    trouble = "" if spoken == framed else f", but the tray says framed = {str(framed).lower()}"
    return f"pulse counter, {VARIANTS[spoken]} frames, {frames[spoken] / COUNTER_S:.0f} a second{trouble}"


VARIANTS = {True: "framed", False: "legacy"}


def _autopilot(port: BytePort, clock: Clock) -> str:
    """What a heartbeat says, and AUTOPILOT_VERSION if it comes when it is asked for."""
    link = mavlink.MAVLink(None, srcSystem=OUR_SYSTEM, srcComponent=OUR_COMPONENT)
    link.robust_parsing = True
    heartbeat = None
    version = ""
    for data in _heard(port, clock, AUTOPILOT_S):
        for message in link.parse_buffer(data) or ():
            if is_autopilot(message) and heartbeat is None:
                heartbeat = message
                port.write(_ask_version(link, message.get_srcSystem(), message.get_srcComponent()))
            elif message.get_type() == "AUTOPILOT_VERSION":
                version = autopilot_version(message.flight_sw_version)
        if heartbeat is not None and version:
            break
    if heartbeat is None:
        return "autopilot (no heartbeat)"
    kind = _called("MAV_AUTOPILOT", heartbeat.autopilot), _called("MAV_TYPE", heartbeat.type)
    return f"{' '.join(filter(None, (kind[0], version)))}, {kind[1]}, system {heartbeat.get_srcSystem()}"


def autopilot_version(number: int) -> str:
    """Major, minor and patch of AUTOPILOT_VERSION's flight_sw_version, a byte each from the top; nothing for 0."""
    return ".".join(str(byte) for byte in number.to_bytes(4, "big")[:3]) if number else ""


def _ask_version(link: Any, system: int, component: int) -> bytes:
    message_id = mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
    command = mavlink.MAV_CMD_REQUEST_MESSAGE
    return link.command_long_encode(system, component, command, 0, message_id, *[0.0] * 6).pack(link)


def _called(enum: str, number: int) -> str:
    """MAV_TYPE_FIXED_WING as "fixed wing"."""
    entry = mavlink.enums[enum].get(number)
    return entry.name.removeprefix(f"{enum}_").replace("_", " ").lower() if entry else f"{enum} {number}"


def _place(table: SensorTable) -> str:
    address = getattr(table, "address", None)
    return f"0x{address:02x} on {table.lane}" if address is not None else table.lane


def _driver(table: SensorTable) -> str:
    return str(type(table).__struct_config__.tag)
