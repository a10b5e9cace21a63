"""A fake u-blox M8 on its serial or I2C port: UBX navigation solutions, NMEA sentences until disabled, configuration.

Section numbers refer to the u-blox 8 / M8 receiver description including protocol specification (UBX-13003221).
"""

import struct
from collections.abc import Callable, Iterable
from datetime import UTC, datetime, timedelta

import numpy as np

from flightpower.flight.arrays import Array
from flightpower.hw_fakes.sample_blocks import SampleBlocks
from flightpower.sim.sensor_truth import SensorTruth

SYNC = b"\xb5\x62"
NAV, ACK, CFG, MON, NMEA = 0x01, 0x05, 0x06, 0x0A, 0xF0  # message classes
NAV_PVT, CFG_PRT, CFG_MSG, CFG_RST, CFG_RATE, CFG_CFG, CFG_NAV5, MON_VER = (
    0x07,
    0x00,
    0x01,
    0x04,
    0x08,
    0x09,
    0x24,
    0x04,
)
ACCEPTED_UNREAD = {(CFG, i) for i in (CFG_CFG, 0x16, 0x23, 0x3B, 0x3E, 0x86)}  # no effect on the messages sent
PORTABLE, FIRST_AIRBORNE, DYNAMIC_MODELS = 0, 6, (0, 2, 3, 4, 5, 6, 7, 8)  # CFG-NAV5 dynModel (sec. 32.10.19)
# u-blox does not publish its filters. Assumed here: velocity follows with a first-order lag unless the dynamic model is
# airborne. Half a second is a tenth of the shortest run, so that tests of whole flights reveal it.
SMOOTHING_S, SMOOTHING_STEP_S = 0.5, 0.05
PORT_DDC, PORT_UART1 = 0, 1  # CFG-PRT port numbers
PROTOCOL_UBX, PROTOCOL_NMEA = 0x01, 0x02  # CFG-PRT protocol masks
SHORTEST_MEASUREMENT_MS = 50
GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)
LEAP_SECONDS = 18  # GPS minus UTC since 2017
WEEK_MS = 7 * 86400 * 1000
REPLY_NS = 2_000_000  # time from a command to its acknowledgment
SATELLITES_WITH_FIX, SATELLITES_WITHOUT = 12, 2
# UBX-MON-VER: software, hardware, extensions; each is padded with zeros.
VERSION = b"ROM CORE 3.01 (107888)".ljust(30, b"\0") + b"00080000".ljust(10, b"\0")
VERSION += b"".join(text.ljust(30, b"\0") for text in (b"FWVER=SPG 3.01", b"PROTVER=18.00", b"GPS;GLO;GAL;BDS"))
DEFAULT_NMEA = {
    0x00: "GGA",
    0x01: "GLL",
    0x02: "GSA",
    0x03: "GSV",
    0x04: "RMC",
    0x05: "VTG",
}  # sec. 31.2, sent once per epoch


def ubx(message_class: int, message_id: int, payload: bytes) -> bytes:
    """A UBX frame (sec. 32.2) with its 8-bit Fletcher checksum (sec. 32.4)."""
    body = bytes([message_class, message_id]) + struct.pack("<H", len(payload)) + payload
    return SYNC + body + fletcher(body)


def fletcher(body: bytes) -> bytes:
    a = b = 0
    for byte in body:
        a = (a + byte) & 0xFF
        b = (b + a) & 0xFF
    return bytes([a, b])


def nmea(sentence: str) -> bytes:
    """An NMEA sentence with its checksum."""
    checksum = 0
    for character in sentence.encode():
        checksum ^= character
    return f"${sentence}*{checksum:02X}\r\n".encode()


class FakeUbloxM8:
    """The receiver on the port that is connected to the computer: UART1, or DDC (I2C, `hw_fakes.ublox`).

    utc_at_start: true UTC at time 0. geoid_m: height of the geoid above the ellipsoid. baud: baud rate of the saved
    configuration (9600 in a new receiver). While `fix_lost` is set, the receiver has no fix.
    """

    def __init__(
        self,
        sensor_truth: SensorTruth,
        utc_at_start: datetime,
        geoid_m: float = 0.0,
        baud: int = 38400,
        *,
        powered_ns: int = 0,
        port_id: int = PORT_UART1,
    ):
        self._sensor_truth = sensor_truth
        self._utc_at_start = utc_at_start
        self._geoid_m = geoid_m
        self._kept_baud = baud
        self._port_id = port_id
        self.fix_lost = False
        self.power_cycle(powered_ns)

    def power_cycle(self, at_ns: int) -> None:
        """Switch the supply off and on: the settings return to the saved configuration."""
        self.baud = self._kept_baud
        self._protocols_out = PROTOCOL_UBX | PROTOCOL_NMEA
        self._dynamic_model = PORTABLE
        self._rates = {(NMEA, i): 1 for i in DEFAULT_NMEA}
        self._received = bytearray()
        self._replies: list[tuple[int, bytes]] = []
        self._set_period(1000, at_ns)

    def _set_period(self, period_ms: int, now_ns: int) -> None:
        self._period_ms = period_ms
        self._epoch = now_ns // (period_ms * 1_000_000) + 1
        self._blocks = SampleBlocks(self._solutions, period_ms * 1e-3, length=max(1, 2000 // period_ms))

    # --- output ---

    def output(self, until_ns: int) -> Iterable[tuple[int, bytes]]:
        sent, self._replies = self._replies, []
        while self._epoch * self._period_ms * 1_000_000 <= until_ns:
            at_ns = self._epoch * self._period_ms * 1_000_000
            data = self._navigation_output()
            if data:
                sent.append((at_ns, data))
            self._epoch += 1
        return sorted(sent, key=lambda item: item[0])

    def _navigation_output(self) -> bytes:
        data = b""
        if self._protocols_out & PROTOCOL_NMEA:
            data += self._nmea_output()
        if self._protocols_out & PROTOCOL_UBX and self._due(NAV, NAV_PVT):
            data += ubx(NAV, NAV_PVT, self._nav_pvt())
        return data

    def _due(self, message_class: int, message_id: int) -> bool:
        rate = self._rates.get((message_class, message_id), 0)
        return rate > 0 and self._epoch % rate == 0

    def _solutions(self, t_s: Array) -> np.ndarray:
        """Rows: time of validity, fix, latitude, longitude, height, velocity north east down, accuracies h v speed."""
        g = self._sensor_truth.gps(t_s)
        velocity = g.velocity_ned_mps if self._dynamic_model >= FIRST_AIRBORNE else self._smoothed_velocity(t_s)
        return np.column_stack(
            [
                g.valid_at_s,
                g.fix,
                g.latitude_deg,
                g.longitude_deg,
                g.height_msl_m,
                velocity,
                g.horizontal_accuracy_m,
                g.vertical_accuracy_m,
                g.speed_accuracy_mps,
            ]
        )

    def _smoothed_velocity(self, t_s: Array) -> Array:
        """The true velocity with a lag of SMOOTHING_S, (n, 3): north, east, down."""
        ages_s = np.arange(0, 6 * SMOOTHING_S, SMOOTHING_STEP_S)
        weights = np.exp(-ages_s / SMOOTHING_S)
        earlier = self._sensor_truth.gps(np.maximum(t_s[:, None] - ages_s, 0.0).ravel()).velocity_ned_mps
        smoothed: Array = weights @ earlier.reshape(len(t_s), len(ages_s), 3) / weights.sum()
        return smoothed

    def _time(self, valid_at_s: float) -> tuple[datetime, int, int]:
        """UTC rounded to a second, the remaining nanoseconds, and the GPS time of week [ms]."""
        utc = self._utc_at_start + timedelta(microseconds=round(valid_at_s * 1e6))
        second = (utc + timedelta(milliseconds=500)).replace(microsecond=0)
        gps = utc - GPS_EPOCH + timedelta(seconds=LEAP_SECONDS)
        return (
            second,
            round((utc - second) / timedelta(microseconds=1)) * 1000,
            round(gps / timedelta(milliseconds=1)) % WEEK_MS,
        )

    def _solution(self) -> list[float]:
        solution: list[float] = self._blocks.row(self._epoch).tolist()
        solution[1] = solution[1] and not self.fix_lost
        return solution

    def _nav_pvt(self) -> bytes:
        """UBX-NAV-PVT, sec. 32.17.15."""
        valid_at_s, fix, latitude, longitude, height_m, north, east, down, h_acc, v_acc, s_acc = self._solution()
        second, nano, itow_ms = self._time(valid_at_s)
        ground_speed = float(np.hypot(north, east))
        heading_1e5 = round(float(np.degrees(np.arctan2(east, north))) % 360 * 1e5)
        if not fix:
            latitude = longitude = height_m = north = east = down = ground_speed = 0.0
            h_acc = v_acc = 4294967.0
            s_acc = 1000.0
        return struct.pack(
            "<IHBBBBBBIiBBBBiiiiIIiiiiiIIHH4sihH",
            itow_ms,
            second.year,
            second.month,
            second.day,
            second.hour,
            second.minute,
            second.second,
            0x37 if fix else 0x00,  # date, time, fully resolved; confirmed
            20 if fix else 0xFFFFFFFF,  # time accuracy, ns
            nano,
            3 if fix else 0,
            0x01 if fix else 0x00,  # gnssFixOK
            0xE0 if fix else 0x00,
            SATELLITES_WITH_FIX if fix else SATELLITES_WITHOUT,
            round(longitude * 1e7),
            round(latitude * 1e7),
            round((height_m + self._geoid_m) * 1e3),
            round(height_m * 1e3),
            round(h_acc * 1e3),
            round(v_acc * 1e3),
            round(north * 1e3),
            round(east * 1e3),
            round(down * 1e3),
            round(ground_speed * 1e3),
            heading_1e5,
            round(s_acc * 1e3),
            180 * 100000 if not fix else 100000,
            150 if fix else 9999,
            0,
            b"",
            0,
            0,
            0,
        )

    def _nmea_output(self) -> bytes:
        due = [name for i, name in DEFAULT_NMEA.items() if self._due(NMEA, i)]
        if not due:
            return b""
        valid_at_s, fix, latitude, longitude, height_m, north, east, *_ = self._solution()
        second, _, _ = self._time(valid_at_s)
        clock, status = second.strftime("%H%M%S.00"), "A" if fix else "V"
        place = f"{_degrees_minutes(latitude, 2, 'NS')},{_degrees_minutes(longitude, 3, 'EW')}" if fix else ",,,"
        course = f"{np.degrees(np.arctan2(east, north)) % 360:.2f}" if fix else ""
        speed_mps = float(np.hypot(north, east))
        knots = f"{speed_mps * 3600 / 1852:.3f}" if fix else ""
        height = f"{height_m:.1f},M,{self._geoid_m:.1f},M"
        sentence = {
            "GGA": f"GNGGA,{clock},{place},{int(fix)},{SATELLITES_WITH_FIX:02d},0.80,{height},,",
            "GLL": f"GNGLL,{place},{clock},{status},A",
            "GSA": f"GNGSA,A,{3 if fix else 1},,,,,,,,,,,,,1.50,0.80,1.27",
            "GSV": "GPGSV,1,1,00",
            "RMC": f"GNRMC,{clock},{status},{place},{knots},{course},{second:%d%m%y},,,A",
            "VTG": f"GNVTG,{course},T,,M,{knots},N,{speed_mps * 3.6:.3f},K,A",
        }
        return b"".join(nmea(sentence[name]) for name in due)

    # --- commands ---

    def receive(self, data: bytes, at_ns: int) -> None:
        self._received += data
        while (start := self._received.find(SYNC)) >= 0:
            del self._received[:start]
            if len(self._received) < 8:
                return
            length = int.from_bytes(self._received[4:6], "little")
            if length > 1024:  # no command is this long, so these were not sync characters
                del self._received[:2]
                continue
            if len(self._received) < 8 + length:
                return
            body = bytes(self._received[2 : 6 + length])
            if fletcher(body) == self._received[6 + length : 8 + length]:
                del self._received[: 8 + length]
                self._command(body[0], body[1], body[4:], at_ns)
            else:
                del self._received[:2]
        del self._received[:-1]

    def _command(self, message_class: int, message_id: int, payload: bytes, at_ns: int) -> None:
        handlers = {
            (CFG, CFG_PRT): self._configure_port,
            (CFG, CFG_MSG): self._configure_message,
            (CFG, CFG_RATE): self._configure_rate,
            (CFG, CFG_NAV5): self._configure_navigation,
        }
        reply_ns = at_ns + REPLY_NS
        if message_class == MON and message_id == MON_VER:
            self._replies.append((reply_ns, ubx(MON, MON_VER, VERSION)))
        elif message_class == NAV and message_id == NAV_PVT:
            self._replies.append((reply_ns, ubx(NAV, NAV_PVT, self._nav_pvt())))
        elif message_class == CFG:
            handler = handlers.get((message_class, message_id))
            accepted_unread = (message_class, message_id) in ACCEPTED_UNREAD
            accepted = handler(payload, at_ns) if handler else accepted_unread
            answer = ubx(ACK, 0x01 if accepted else 0x00, bytes([message_class, message_id]))
            self._replies.append((reply_ns, answer))

    def _configure_port(self, payload: bytes, at_ns: int) -> bool:
        """UBX-CFG-PRT (sec. 32.10.25): 20 bytes set the port; 0 or 1 byte polls it."""
        if len(payload) in (0, 1):
            protocols = struct.pack("<HHHxx", PROTOCOL_UBX | PROTOCOL_NMEA, self._protocols_out, 0)
            settings = struct.pack("<BxHII", self._port_id, 0, self._mode(), self._baud_setting()) + protocols
            self._replies.append((at_ns + REPLY_NS, ubx(CFG, CFG_PRT, settings)))
            return True
        if len(payload) != 20 or payload[0] != self._port_id:
            return False
        _, _, _, baud, _, protocols_out, _ = struct.unpack("<BxHIIHHHxx", payload)
        if self._port_id == PORT_UART1:
            self.baud = baud
        self._protocols_out = protocols_out
        return True

    def _mode(self) -> int:
        """The port's mode: 8N1, or the address on the bus in bits 1 to 7."""
        return 0x42 << 1 if self._port_id == PORT_DDC else 0x000008D0

    def _baud_setting(self) -> int:
        return 0 if self._port_id == PORT_DDC else self.baud

    def _configure_message(self, payload: bytes, at_ns: int) -> bool:
        """UBX-CFG-MSG (sec. 32.10.18): for this port (3 bytes), for all six (8 bytes), or a poll (2 bytes)."""
        if len(payload) < 2:
            return False
        key = (payload[0], payload[1])
        if key != (NAV, NAV_PVT) and payload[0] not in (NAV, NMEA, MON):
            return False
        if len(payload) == 3:
            self._rates[key] = payload[2]
        elif len(payload) == 8:
            self._rates[key] = payload[2 + self._port_id]
        elif len(payload) == 2:
            rates = bytes(self._rates.get(key, 0) if port == self._port_id else 0 for port in range(6))
            self._replies.append((at_ns + REPLY_NS, ubx(CFG, CFG_MSG, payload + rates)))
        else:
            return False
        return True

    def _configure_navigation(self, payload: bytes, at_ns: int) -> bool:
        """UBX-CFG-NAV5 (sec. 32.10.19): 36 bytes set the settings in their mask, none polls. Only the model has
        effect."""
        if not payload:
            settings = struct.pack("<HBB32x", 0xFFFF, self._dynamic_model, 3)
            self._replies.append((at_ns + REPLY_NS, ubx(CFG, CFG_NAV5, settings)))
            return True
        if len(payload) != 36 or payload[2] not in DYNAMIC_MODELS:
            return False
        if payload[0] & 0x01:
            self._dynamic_model = payload[2]
            self._blocks = SampleBlocks(self._solutions, self._period_ms * 1e-3, length=max(1, 2000 // self._period_ms))
        return True

    def _configure_rate(self, payload: bytes, at_ns: int) -> bool:
        """UBX-CFG-RATE (sec. 32.10.27)."""
        if not payload:
            settings = struct.pack("<HHH", self._period_ms, 1, 1)
            self._replies.append((at_ns + REPLY_NS, ubx(CFG, CFG_RATE, settings)))
            return True
        if len(payload) != 6:
            return False
        measurement_ms, navigation_ratio, _ = struct.unpack("<HHH", payload)
        if measurement_ms < SHORTEST_MEASUREMENT_MS or not 1 <= navigation_ratio <= 127:
            return False
        self._set_period(measurement_ms * navigation_ratio, at_ns)
        return True


VALSET, VALGET, IN_RAM = 0x8A, 0x8B, 0x01
VALUE_BYTES = {1: 1, 2: 1, 3: 2, 4: 4}  # size by bits 28 to 30 of a key (UBX-21035062 sec. 5.2)
KEY_BAUD, KEY_MODEL, KEY_MEASUREMENT, KEY_NAVIGATION = 0x40520001, 0x20110021, 0x30210001, 0x30210002
# Keys that differ by port: NAV-PVT, and output of UBX and NMEA.
KEYS_PVT = {PORT_DDC: 0x20910006, PORT_UART1: 0x20910007}
KEYS_UBX, KEYS_NMEA = {PORT_DDC: 0x10720001, PORT_UART1: 0x10740001}, {PORT_DDC: 0x10720002, PORT_UART1: 0x10740002}
KEYS_WITHOUT_EFFECT = frozenset({0x20210003})  # CFG-RATE-TIMEREF
VERSION_M10 = b"ROM SPG 5.10 (7b202e)".ljust(30, b"\0") + b"000A0000".ljust(10, b"\0")
VERSION_M10 += b"".join(text.ljust(30, b"\0") for text in (b"FWVER=SPG 5.10", b"PROTVER=34.10", b"GPS;GAL;BDS"))


class FakeUbloxM10(FakeUbloxM8):
    """A receiver of the generation M10 (u-blox M10 SPG 5.10 interface description, UBX-21035062).

    It refuses the configuration messages of the M8, and is configured by keys: CFG-VALSET and CFG-VALGET (sec. 3.10).
    """

    def _command(self, message_class: int, message_id: int, payload: bytes, at_ns: int) -> None:
        if message_class == MON and message_id == MON_VER:
            self._replies.append((at_ns + REPLY_NS, ubx(MON, MON_VER, VERSION_M10)))
        elif message_class == CFG:
            handler = {VALSET: self._set_values, VALGET: self._get_values}.get(message_id)
            accepted = handler is not None and handler(payload, at_ns)
            answer = ubx(ACK, 0x01 if accepted else 0x00, bytes([message_class, message_id]))
            self._replies.append((at_ns + REPLY_NS, answer))
        else:
            super()._command(message_class, message_id, payload, at_ns)

    def _set_values(self, payload: bytes, at_ns: int) -> bool:
        """Set all values, or none of them if one key is unknown."""
        values, rest = {}, payload[4:]
        while len(rest) > 4:
            key = int.from_bytes(rest[:4], "little")
            size = VALUE_BYTES.get(key >> 28, len(rest))
            values[key], rest = int.from_bytes(rest[4 : 4 + size], "little"), rest[4 + size :]
        supported = self._values().keys() | KEYS_WITHOUT_EFFECT
        if rest or not payload[1] & IN_RAM or not values.keys() <= supported:
            return False
        values = self._values() | values
        if values[KEY_MODEL] not in DYNAMIC_MODELS or values[KEY_MEASUREMENT] < SHORTEST_MEASUREMENT_MS:
            return False
        port, period_ms = self._port_id, values[KEY_MEASUREMENT] * values[KEY_NAVIGATION]
        self.baud = values[KEY_BAUD]
        self._protocols_out = PROTOCOL_UBX * values[KEYS_UBX[port]] | PROTOCOL_NMEA * values[KEYS_NMEA[port]]
        self._rates[(NAV, NAV_PVT)] = values[KEYS_PVT[port]]
        if values[KEY_MODEL] != self._dynamic_model or period_ms != self._period_ms:
            self._dynamic_model = values[KEY_MODEL]
            self._set_period(period_ms, at_ns)
        return True

    def _values(self) -> dict[int, int]:
        port = self._port_id
        return {
            KEY_BAUD: self.baud,
            KEY_MODEL: self._dynamic_model,
            KEY_MEASUREMENT: self._period_ms,
            KEY_NAVIGATION: 1,
            KEYS_UBX[port]: self._protocols_out & PROTOCOL_UBX,
            KEYS_NMEA[port]: int(self._protocols_out & PROTOCOL_NMEA > 0),
            KEYS_PVT[port]: self._rates.get((NAV, NAV_PVT), 0),
        }

    def _get_values(self, payload: bytes, at_ns: int) -> bool:
        keys = [int.from_bytes(payload[start : start + 4], "little") for start in range(4, len(payload), 4)]
        values = self._values()
        if not keys or not set(keys) <= values.keys():
            return False
        pairs = (struct.pack("<I", key) + values[key].to_bytes(VALUE_BYTES[key >> 28], "little") for key in keys)
        self._replies.append((at_ns + REPLY_NS, ubx(CFG, VALGET, b"\x01\x00\x00\x00" + b"".join(pairs))))
        return True


def _degrees_minutes(angle_deg: float, digits: int, letters: str) -> str:
    degrees, minutes = divmod(abs(angle_deg) * 60, 60)
    return f"{int(degrees):0{digits}d}{minutes:08.5f},{letters[angle_deg < 0]}"


# The I2C side ("DDC") has the stream of messages behind three register addresses (section "DDC port"). Clock stretching
# by the receiver is not simulated.
DDC_ADDRESS = 0x42
WAITING_HIGH, WAITING_LOW, STREAM = 0xFD, 0xFE, 0xFF
NOTHING = 0xFF  # value read from a register without content
BUFFER_BYTES = 4096  # size of waiting messages; a message that does not fit is lost
EMPTIED_AFTER_NS = 1_500_000_000  # of no access clear the buffer (CFG-PRT, extendedTxTimeout not set)


class FakeUbloxDdc:
    """The receiver at 0x42. now_ns: gives the time since the start of the simulation [ns]."""

    def __init__(self, receiver: FakeUbloxM8, now_ns: Callable[[], int]):
        self._receiver = receiver
        self._now_ns = now_ns
        self._register = STREAM
        self._waiting = bytearray()
        self._touched_ns: float = float("-inf")

    def power_cycle(self, at_ns: int) -> None:
        """Switch the supply off and on."""
        self._receiver.power_cycle(at_ns)
        self._register = STREAM
        self._waiting.clear()

    def write(self, data: bytes) -> None:
        """Receive a write: one byte selects a register; more bytes go to the receiver as part of its input stream."""
        self._catch_up()
        if len(data) == 1:
            self._register = data[0]
        elif data:
            self._receiver.receive(data, self._now_ns())

    def read(self, count: int) -> bytes:
        """Read from the selected register on. The stream register, which power-on selects, stays selected."""
        self._catch_up()
        length = len(self._waiting).to_bytes(2, "big")
        reply = bytearray()
        while len(reply) < count:
            if self._register == STREAM:
                wanted = count - len(reply)
                reply += self._waiting[:wanted].ljust(wanted, bytes([NOTHING]))
                del self._waiting[:wanted]
                break
            reply.append(length[self._register - WAITING_HIGH] if self._register >= WAITING_HIGH else NOTHING)
            self._register += 1
        return bytes(reply)

    def write_read(self, data: bytes, count: int) -> bytes:
        self.write(data)
        return self.read(count)

    def _catch_up(self) -> None:
        """Buffer what the receiver has sent since the last access."""
        now_ns = self._now_ns()
        if now_ns - self._touched_ns > EMPTIED_AFTER_NS:
            self._waiting.clear()
        for sent_ns, data in self._receiver.output(now_ns):
            wanted = sent_ns - self._touched_ns <= EMPTIED_AFTER_NS and now_ns - self._touched_ns <= EMPTIED_AFTER_NS
            if wanted and len(self._waiting) + len(data) <= BUFFER_BYTES:
                self._waiting += data
        self._touched_ns = now_ns
