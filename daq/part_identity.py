"""Identifies each part for `daq check`, after the drivers have started the parts.

Serial lines are reopened for this, and read for a few seconds, independently of the sampling loop.
"""

import errno
from collections.abc import Iterator
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flightpower.daq import config
from flightpower.daq.bus import Buses, BytePort, I2CBus
from flightpower.daq.clock import Clock
from flightpower.daq.config import SensorTable
from flightpower.daq.sensors import SensorFailure
from flightpower.daq.sensors.ads1115 import CONFIG as ADS1115_CONFIG
from flightpower.daq.sensors.autopilot import OUR_COMPONENT, OUR_SYSTEM, is_autopilot
from flightpower.daq.sensors.esc_counter import FramedParser, LegacyParser
from flightpower.daq.sensors.ina2xx import INA226, INA228
from flightpower.daq.sensors.ms56xx import PROM_WORDS, READ_PROM, VARIANTS
from flightpower.daq.sensors.ublox import frame_of, take_frames
from flightpower.daq.sensors.ublox_ddc import DdcPort

MPU_WHO_AM_I = 0x75
MPU_NAMES = {0x71: "MPU-9250", 0x73: "MPU-9255"}
AK8963_WIA, AK8963_ID = 0x00, 0x48
MON_VER = b"\x0a\x04"  # UBX-MON-VER: software, hardware, then any number of extensions
SOFTWARE, HARDWARE, EXTENSION = 30, 10, 30  # lengths [bytes]; texts are padded with zeros
LISTEN_EVERY_NS = 20_000_000
RECEIVER_S = 1.5  # the receiver may be busy with a solution
COUNTER_S = 1.0
AUTOPILOT_S = 2.5  # a heartbeat is sent once a second


class PartIdentity(NamedTuple):
    """A line of text with the part and its place, or with the error if the part does not answer."""

    text: str
    in_use: bool = False  # whether another program uses the device


def identify(table: SensorTable, buses: Buses, clock: Clock) -> PartIdentity:
    """Identify the part that answers. A part that does not answer raises nothing."""
    try:
        return PartIdentity(f"{_identify(table, buses, clock)}, {_place(table)}")
    except SensorFailure as failure:
        return PartIdentity(f"{table.driver}, {_place(table)}: {failure}")
    except OSError as error:
        text = f"{table.driver}, {_place(table)}: {error.strerror or error}"
        return PartIdentity(text, in_use=error.errno == errno.EBUSY)


def _identify(table: SensorTable, buses: Buses, clock: Clock) -> str:
    match table:
        case config.Mpu9250Config():
            code = buses.i2c(table.bus).write_read(table.address, bytes([MPU_WHO_AM_I]), 1)[0]
            return MPU_NAMES.get(code, f"unknown (WHO_AM_I 0x{code:02x})")
        case config.Ak8963Config():
            code = buses.i2c(table.bus).write_read(table.address, bytes([AK8963_WIA]), 1)[0]
            return "AK8963" if code == AK8963_ID else f"unknown (WIA 0x{code:02x})"
        case config.Ms5611Config() | config.Ms5607Config() | config.Ms5805Config():
            variant = VARIANTS[table.driver]
            words = _prom(buses.i2c(table.bus), table.address)
            crc = words[variant.crc_word] >> variant.crc_shift & 0xF
            return f"{variant.name} with C1 {words[1]}, CRC 0x{crc:x}"
        case config.Ms45xxDoConfig() | config.HoneywellConfig():
            buses.i2c(table.bus).read(table.address, 4)
            return f"{table.part} (answers; the part has no identity register)"
        case config.UBloxConfig():
            return _receiver(buses.port(table.port, table.baud), clock)
        case config.UBloxDdcConfig():
            return _receiver(DdcPort(buses.i2c(table.bus), table.address), clock)
        case config.EscCounterConfig():
            return _counter(buses.port(table.port, table.baud), clock, framed=table.framed)
        case config.AutopilotConfig():
            return _autopilot(buses.port(table.port, table.baud), clock)
        case config.Ina226Config() | config.Ina228Config():
            part = INA226 if isinstance(table, config.Ina226Config) else INA228
            word = buses.i2c(table.bus).write_read(table.address, bytes([part.identity_register]), 2)
            code = int.from_bytes(word, "big")
            return part.name if code & 0xFFF0 == part.identity else f"unknown (device 0x{code:04x})"
        case config.Ads1115Config():
            buses.i2c(table.bus).write_read(table.address, bytes([ADS1115_CONFIG]), 2)
            return "ADS1115 (answers; the part has no identity register)"
    return table.identify(buses)


def _prom(bus: I2CBus, address: int) -> list[int]:
    words = [bus.write_read(address, bytes([READ_PROM + 2 * i]), 2) for i in range(PROM_WORDS)]
    return [int.from_bytes(word, "big") for word in words]


def _receive(port: BytePort, clock: Clock, seconds: float) -> Iterator[bytes]:
    """The bytes that arrive within `seconds`, in pieces."""
    until_ns = clock.now_ns() + round(seconds * 1e9)
    while clock.now_ns() < until_ns:
        clock.sleep_until_ns(clock.now_ns() + LISTEN_EVERY_NS)
        yield port.read_available()


def _receiver(port: BytePort, clock: Clock) -> str:
    """The answer of a u-blox receiver to MON-VER."""
    port.write(frame_of(MON_VER, b""))
    buffer = bytearray()
    for data in _receive(port, clock, RECEIVER_S):
        buffer += data
        for frame in take_frames(buffer)[0]:
            if frame[2:4] == MON_VER:
                return f"u-blox {receiver_version(frame[6:-2])}"
    return "u-blox (no answer to MON-VER)"


def receiver_version(payload: bytes) -> str:
    """Software, hardware, and the extensions that name module, firmware and protocol."""
    fields = [payload[:SOFTWARE], payload[SOFTWARE : SOFTWARE + HARDWARE]]
    fields += [payload[start : start + EXTENSION] for start in range(SOFTWARE + HARDWARE, len(payload), EXTENSION)]
    software, hardware, *extensions = (field.partition(b"\0")[0].decode("ascii", "replace") for field in fields)
    named = [text for text in extensions if text.startswith(("MOD=", "FWVER=", "PROTVER"))]
    return ", ".join([software, f"hardware {hardware}", *named])


def _counter(port: BytePort, clock: Clock, *, framed: bool) -> str:
    """Find which variant of frames the pulse counter sends, and their rate, whatever is configured."""
    frames = {True: 0, False: 0}
    parsers: dict[bool, FramedParser | LegacyParser] = {True: FramedParser(), False: LegacyParser()}
    for data in _receive(port, clock, COUNTER_S):
        for variant, parser in parsers.items():
            frames[variant] += len(parser.feed(data))
    framed_found = frames[True] > 0  # a correct CRC is no coincidence
    if not frames[framed_found]:
        return "pulse counter (no frames)"
    mismatch = "" if framed_found == framed else f", but the tray says framed = {str(framed).lower()}"
    return f"pulse counter, {FRAMES[framed_found]} frames, {frames[framed_found] / COUNTER_S:.0f} a second{mismatch}"


FRAMES = {True: "framed", False: "legacy"}


def _autopilot(port: BytePort, clock: Clock) -> str:
    """Describe the autopilot by its heartbeat, and by AUTOPILOT_VERSION if it sends that on request."""
    link = mavlink.MAVLink(None, srcSystem=OUR_SYSTEM, srcComponent=OUR_COMPONENT)
    link.robust_parsing = True
    heartbeat = None
    version = ""
    for data in _receive(port, clock, AUTOPILOT_S):
        for message in link.parse_buffer(data) or ():
            if message.get_type() == "HEARTBEAT" and is_autopilot(message) and heartbeat is None:
                heartbeat = message
                port.write(_version_request(link, message.get_srcSystem(), message.get_srcComponent()))
            elif message.get_type() == "AUTOPILOT_VERSION":
                version = autopilot_version(message.flight_sw_version)
        if heartbeat is not None and version:
            break
    if heartbeat is None:
        return "autopilot (no heartbeat)"
    kind = _enum_name("MAV_AUTOPILOT", heartbeat.autopilot), _enum_name("MAV_TYPE", heartbeat.type)
    return f"{' '.join(filter(None, (kind[0], version)))}, {kind[1]}, system {heartbeat.get_srcSystem()}"


def autopilot_version(number: int) -> str:
    """Major, minor and patch version, the upper three bytes of flight_sw_version in AUTOPILOT_VERSION; empty for 0."""
    return ".".join(str(byte) for byte in number.to_bytes(4, "big")[:3]) if number else ""


def _version_request(link: Any, system: int, component: int) -> bytes:
    message_id = mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
    command = mavlink.MAV_CMD_REQUEST_MESSAGE
    return bytes(link.command_long_encode(system, component, command, 0, message_id, *[0.0] * 6).pack(link))


def _enum_name(enum: str, number: int) -> str:
    """The name of a MAVLink enum entry in words: MAV_TYPE_FIXED_WING is "fixed wing"."""
    entry = mavlink.enums[enum].get(number)
    return entry.name.removeprefix(f"{enum}_").replace("_", " ").lower() if entry else f"{enum} {number}"


def _place(table: SensorTable) -> str:
    address = getattr(table, "address", None)
    return f"0x{address:02x} on {table.device}" if address is not None else table.device
