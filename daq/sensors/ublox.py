"""Driver of a u-blox receiver: UBX NAV-PVT over a byte stream (u-blox 8 / M8 Receiver Description, UBX-13003221).

The receiver is configured while the sampling loop runs, one command at a time, each after the acknowledge of the one
before. A receiver that refuses a command of the M8 is asked for its version; a later generation (M10) is configured by
keys, with CFG-VALSET (u-blox M10 Interface Description, UBX-21035062).

A receiver loses its configuration when its supply is interrupted, and may go on with another one. Therefore the time
between solutions is compared with the configured time, and the dynamic model is polled every two seconds; wrong
settings are set again. The model is logged only if no solution has been missed since it was last read.

Numbers in brackets are sections of the description of the M8. The tests compare the results with pyubx2's, which takes
ten times as long.
"""

import calendar
import struct
from collections.abc import Callable, Iterator, Mapping
from itertools import accumulate

from flightpower.daq.bus import BytePort
from flightpower.daq.sensors import Sample, SensorFailure
from flightpower.flight.messages import OK, Gps, Status

SYNC = b"\xb5\x62"
OVERHEAD = 8  # sync, class, id, length, checksum
PVT_PAYLOAD = 92
# NAV-PVT (32.17.17) after class, id and length: iTOW; year, month, day, hour, minute, second, validity; nano; fixType,
# flags, numSV. Longitude, latitude, two heights, two accuracies, three velocities, accuracy of the speed.
PVT_TIME, PVT_PLACE = struct.Struct("<6x I H6B 4xi 2BxB"), struct.Struct("<30x 2i 2i 2I 3i 8xI")
VALID_DATE_AND_TIME, FIX_OK = 0x07, 0x01  # with fullyResolved, which excludes the time of the battery's clock
DEGREE, DEGREE_DIGITS = 1e-7, 7
LONGEST_PAYLOAD = 1024  # a frame longer than any requested message is none
NAV_PVT, ACK_ACK, ACK_NAK = b"\x01\x07", b"\x05\x01", b"\x05\x00"
CFG_PRT, CFG_MSG, CFG_RATE = b"\x06\x00", b"\x06\x01", b"\x06\x08"  # 32.10.25, 32.10.18, 32.10.27
CFG_NAV5, NAV5_PAYLOAD, ONLY_DYNAMIC_MODEL = b"\x06\x24", 36, 0x0001  # 32.10.19; its mask of the settings to change
MON_VER = b"\x0a\x04"  # software (30 bytes), hardware (10), extensions of 30 bytes; it is not acknowledged
SOFTWARE_AND_HARDWARE, EXTENSION = 40, 30
PROTOCOL, FIRST_BY_KEYS = b"PROTVER", 27.0  # an extension in MON-VER; from then on CFG-VALSET is complete
CFG_VALSET, CFG_VALGET, IN_RAM = b"\x06\x8a", b"\x06\x8b", 1
VALUE_BYTES = {1: 1, 2: 1, 3: 2, 4: 4}  # size by bits 28 to 30 of a key
UART1_BAUD, MODEL_KEY = 0x40520001, 0x20110021  # CFG-UART1-BAUDRATE, CFG-NAVSPG-DYNMODEL
RATE_MEAS, RATE_NAV, RATE_TIMEREF = 0x30210001, 0x30210002, 0x20210003
OUT_UBX, OUT_NMEA = {False: 0x10720001, True: 0x10740001}, {False: 0x10720002, True: 0x10740002}  # on I2C, on UART 1
OUT_NAV_PVT = {False: 0x20910006, True: 0x20910007}
NAMES = {
    CFG_PRT: "CFG-PRT",
    CFG_MSG: "CFG-MSG",
    CFG_RATE: "CFG-RATE",
    CFG_NAV5: "CFG-NAV5",
    CFG_VALSET: "CFG-VALSET",
    CFG_VALGET: "CFG-VALGET",
    MON_VER: "MON-VER",
}
WEEK_MS = 7 * 86_400_000
AIRBORNE_4G = 8  # dynModel (8.1); the factory setting 0, portable, smooths velocity
FACTORY_BAUDS = (9600, 38400)  # of the M8, and of the M9 and M10
SWITCH_S = 0.1  # both commands last 50 ms at 9600 baud, and the receiver takes a moment to change
AUDIT_NS = 2_000_000_000  # time between two polls of the dynamic model
KNOWN_NS = 5_000_000_000  # after this time without an answer the model is unknown
REPAIR_NS, SELDOM_NS, MOST_REPAIRS = 3_000_000_000, 20_000_000_000, 3  # after so many in a row, only rarely
COMPLAINT_NS = 6_000_000_000  # lost settings are reported for this long: more than the spacing of a sensor's events
COUNTED_NS, LEAST_ARRIVING = 2_000_000_000, 0.5  # least share of the expected solutions in this time
SPACING_TOLERANCE = 0.2  # relative, of the time between solutions
MAX_FRAME_NS = 300_000_000  # a frame incomplete for this long is discarded; 100 bytes take 0.1 s at 9600 baud
ACK_TIMEOUT_NS = 1_000_000_000
SILENCE_NS = 1_500_000_000  # no solution for this long is `no_data`; a receiver without fix still sends solutions
LOWEST_M, HIGHEST_M = -600.0, 15_000.0  # above the ellipsoid: the shore of the Dead Sea is at -420
FASTEST_MPS = 200.0  # in a dive with a tailwind
WITH_POSITION = (2, 3, 4)  # fixType: 2D, 3D, GNSS with dead reckoning


class UBloxDriver:
    """The receiver on `port`. rate_Hz: rate of solutions, 1 to 10. baud: of the port, None on I2C.

    reopen: opens the same port at another rate. With it, a receiver at its factory rate (new, or after a loss of
    supply) is first set to `baud`.
    """

    def __init__(
        self,
        port: BytePort,
        *,
        rate_Hz: float = 10.0,
        baud: int | None = 38400,
        reopen: Callable[[int], BytePort] | None = None,
        topic: str = "/gps",
    ):
        self._port, self._topic = port, topic
        self._baud = baud
        self._reopen = reopen
        self._silences = 0
        self._rate_Hz = rate_Hz
        self._commands = configuration(rate_Hz, baud)
        self._by_keys = False  # whether this generation is configured by keys
        self._version_asked = False
        self._buffer = bytearray()
        self._begun_ns = 0  # latest possible start of the first frame in the buffer
        self._to_send: list[bytes] = []
        self._sent_ns: int | None = None
        self._last_ns: int | None = None
        self._itow_ms: int | None = None  # time of week of the latest solution
        self._corrupt = False
        self.refused: list[str] = []  # names of the commands that the receiver rejected
        self._dynamic_model: int | None = None  # model that the receiver reports, after it was set
        self._model_ns = 0  # when the receiver last reported the model
        self._audited_ns = 0
        self._repaired_ns, self._repairs = -REPAIR_NS, 0
        self._repaired_lately = False
        self._solved = self._counted_ns = 0  # solutions since the time `_counted_ns`
        self._few = False
        self._spacing_ms: int | None = None  # wrong time between the latest two solutions
        self._wrong_spacing_ms: int | None = None  # wrong time that occurred twice in a row

    @property
    def complaint(self) -> str:
        """How the receiver departs from its configuration; empty if no departure is known."""
        if not (self.refused or self._wrong_spacing_ms or self._few or self._repaired_lately):
            return ""
        complaints = []
        if self.refused and not (self._to_send and self._to_send[0][2:4] == MON_VER):
            advice = "set another rate_Hz" if self.refused == [NAMES[CFG_RATE]] else "a u-blox M8 or M10 is needed"
            complaints.append(f"refuses {', '.join(self.refused)}: {advice}")
        if self._wrong_spacing_ms is not None:
            rate_Hz = 1000 / self._wrong_spacing_ms
            complaints.append(f"solves {rate_Hz:.3g} times a second, and is set to {self._rate_Hz:g}")
        elif self._few:
            complaints.append("most solutions are lost: check baud rate, ground and cable length")
        elif self._repaired_lately and not self.refused:
            complaints.append("had lost its settings, which were set again: check its supply for interruptions")
        return "; ".join(complaints)

    def start(self) -> Iterator[float]:
        """Set the receiver's baud rate. The rest of the configuration is sent in `read`."""
        self._to_send = list(self._commands)
        if self._reopen is not None and self._baud is not None:
            for baud in FACTORY_BAUDS:
                if baud != self._baud:  # a receiver at another rate ignores both commands
                    line = self._reopen(baud)
                    line.write(frame_of_keys({UART1_BAUD: self._baud}))  # refused by an M8
                    line.write(self._commands[0])
                    yield SWITCH_S
            self._port = self._reopen(self._baud)
        yield 0.0

    def read(self, now_ns: int) -> list[Sample]:
        """Every solution that has arrived since the last tick; a repeated solution is `stale`.

        Each 1.5 s without a new solution gives `no_data`.
        """
        if self._last_ns is None:
            self._last_ns = self._begun_ns = self._audited_ns = now_ns
        frames, rejected = self._take(now_ns)
        self._corrupt |= rejected > 0
        samples = []
        solved = False
        for frame in frames:
            kind = frame[2:4]
            if kind == NAV_PVT:
                message = self._solution(frame, now_ns)
                solved |= message.status is not Status.STALE
                samples.append(Sample(self._topic, now_ns, message))
            elif (model := model_in(frame)) is not None:
                self._judge_model(model, now_ns)
            elif kind == MON_VER:
                self._identified(frame)
            elif kind in (ACK_ACK, ACK_NAK) and self._to_send and frame[6:8] == self._to_send[0][2:4]:
                command = self._done()
                if kind == ACK_NAK:
                    self._refused(command)
                elif NAMES[command] in self.refused:
                    self.refused.remove(NAMES[command])
        self._count(solved, now_ns)
        if solved:
            self._last_ns, self._corrupt, self._silences = now_ns, False, 0
        elif samples:  # it answers, and a restarted driver would not know which solution it repeats
            self._silences = 0
        if not solved and now_ns - self._last_ns >= SILENCE_NS:
            silence = self._silence(now_ns)
            if not samples:
                samples.append(Sample(self._topic, now_ns, silence))
        self._configure(now_ns)
        self._repaired_lately = self._repairs > 0 and now_ns - self._repaired_ns < COMPLAINT_NS
        return samples

    def _count(self, solved: bool, now_ns: int) -> None:
        """Count solutions, to notice if many are lost on their way."""
        self._solved += solved
        if now_ns - self._counted_ns >= COUNTED_NS:
            wanted = self._rate_Hz * (now_ns - self._counted_ns) * 1e-9
            self._few = bool(self._solved) and self._solved < LEAST_ARRIVING * wanted and self._counted_ns > 0
            self._solved, self._counted_ns = 0, now_ns

    def _take(self, now_ns: int) -> tuple[list[bytes], int]:
        """Read the port and extract frames from the buffer. A frame incomplete for too long is discarded."""
        self._buffer += self._port.read_available()
        frames, rejected = take_frames(self._buffer)
        if frames or rejected or not self._buffer:
            self._begun_ns = now_ns
        elif now_ns - self._begun_ns >= MAX_FRAME_NS:
            del self._buffer[:1]
            frames, rejected = take_frames(self._buffer)
            rejected += 1
            self._begun_ns = now_ns
        return frames, rejected

    def _solution(self, frame: bytes, now_ns: int) -> Gps:
        """The message of a NAV-PVT frame: `stale` and empty if its time of week equals the preceding solution's."""
        message = solution(frame)
        itow_ms, before_ms = message.itow_ms, self._itow_ms
        if message.status is OK and itow_ms == before_ms:
            return Gps(status=Status.STALE)
        self._itow_ms = itow_ms
        if itow_ms is not None and before_ms is not None:
            self._judge_spacing((itow_ms - before_ms) % WEEK_MS, now_ns)
        if now_ns - self._model_ns > KNOWN_NS:
            self._dynamic_model = None
        if message.status is OK:
            message.dynamic_model = self._dynamic_model
        return believed(message)

    def _judge_spacing(self, spacing_ms: int, now_ns: int) -> None:
        """Compare the time between two solutions with the configured time."""
        if abs(spacing_ms * self._rate_Hz / 1000 - 1) <= SPACING_TOLERANCE:
            self._spacing_ms = self._wrong_spacing_ms = None
            return
        if spacing_ms != self._spacing_ms:
            # A solution was lost on its way, or the receiver has restarted, perhaps with other settings.
            self._spacing_ms = spacing_ms
            self._dynamic_model, self._audited_ns = None, now_ns - AUDIT_NS
        elif not self._to_send and spacing_ms < WEEK_MS // 2:
            self._wrong_spacing_ms = spacing_ms
            self._repair(self._commands, now_ns)

    def _judge_model(self, model: int, now_ns: int) -> None:
        self._dynamic_model, self._model_ns = model, now_ns
        if model == AIRBORNE_4G:
            if self._wrong_spacing_ms is None and now_ns - self._repaired_ns >= COMPLAINT_NS:
                self._repairs = 0
        elif len(self._to_send) <= 1:  # this was only a poll
            self._repair(self._commands, now_ns)

    def _repair(self, commands: list[bytes], now_ns: int) -> None:
        """Configure the receiver again, unless that was tried recently."""
        if now_ns - self._repaired_ns >= (REPAIR_NS if self._repairs < MOST_REPAIRS else SELDOM_NS):
            self._to_send, self._sent_ns = list(commands), None
            self._repaired_ns, self._repairs = now_ns, self._repairs + 1

    def _done(self) -> bytes:
        """Remove the first command, which was answered, from the list. Returns its kind."""
        self._sent_ns = None
        return self._to_send.pop(0)[2:4]

    def _refused(self, command: bytes) -> None:
        """Note a refused command for the report, and ask the receiver for its version, once."""
        if command == MON_VER:
            return
        if NAMES[command] not in self.refused:
            self.refused.append(NAMES[command])
        if not self._by_keys and not self._version_asked:
            self._version_asked = True
            self._to_send.insert(0, frame_of(MON_VER, b""))

    def _identified(self, frame: bytes) -> None:
        """Configure the receiver by keys if its version shows a later generation."""
        if self._to_send and self._to_send[0][2:4] == MON_VER:
            self._done()
        if not self._by_keys and self._version_asked and protocol_version(frame[6:-2]) >= FIRST_BY_KEYS:
            self._by_keys = True
            self._commands = configuration_by_keys(self._rate_Hz, self._baud)
            self._to_send, self._sent_ns = list(self._commands), None
            self.refused.clear()

    def _silence(self, now_ns: int) -> Gps:
        """Configure the receiver again. A second silence raises SensorFailure, to restart from the factory rate."""
        status = Status.CORRUPT if self._corrupt else Status.NO_DATA
        self._silences += 1
        if self._silences > 1 and self._reopen is not None:
            what = "sends nothing" if status is Status.NO_DATA else "sends only damaged data"
            raise SensorFailure(status, f"the receiver {self.complaint or what}")
        self._last_ns, self._corrupt = now_ns, False
        self._to_send, self._sent_ns, self._dynamic_model = list(self._commands), None, None
        return Gps(status=status)

    def _configure(self, now_ns: int) -> None:
        if not self._to_send and now_ns - self._audited_ns >= AUDIT_NS:
            self._audited_ns = now_ns
            self._to_send = [self._commands[-1]]
        due = self._sent_ns is None or now_ns - self._sent_ns >= ACK_TIMEOUT_NS
        if self._to_send and due:
            self._port.write(self._to_send[0])
            self._sent_ns = now_ns


def configuration(rate_Hz: float, baud: int | None) -> list[bytes]:
    """Commands to send only NAV-PVT, and to make the receiver's filter expect the accelerations of flight.

    The last command polls the dynamic model, which some receivers acknowledge but do not keep. baud: None on I2C.
    """
    port_id = 0 if baud is None else 1
    mode = 0x42 << 1 if baud is None else 0x08D0  # DDC address 0x42 (7 bits, shifted), or 8N1
    ubx = 0x0001  # protocols in and out
    on_ports = bytes(int(port == port_id) for port in range(6))  # DDC, UART 1, UART 2, USB, SPI, reserved
    return [
        frame_of(CFG_PRT, struct.pack("<B3xIIHH4x", port_id, mode, baud or 0, ubx, ubx)),
        frame_of(CFG_RATE, struct.pack("<HHH", round(1000 / rate_Hz), 1, 1)),  # each measurement; GPS time
        frame_of(CFG_MSG, NAV_PVT + on_ports),
        frame_of(CFG_NAV5, struct.pack("<HB33x", ONLY_DYNAMIC_MODEL, AIRBORNE_4G)),
        frame_of(CFG_NAV5, b""),
    ]


def configuration_by_keys(rate_Hz: float, baud: int | None) -> list[bytes]:
    """Configuration messages for receivers that take keys. baud: None on I2C."""
    serial = baud is not None
    port = {OUT_UBX[serial]: 1, OUT_NMEA[serial]: 0} | ({UART1_BAUD: baud} if baud is not None else {})
    return [
        frame_of_keys(port),
        frame_of_keys({RATE_MEAS: round(1000 / rate_Hz), RATE_NAV: 1, RATE_TIMEREF: 1}),  # GPS time
        frame_of_keys({OUT_NAV_PVT[serial]: 1}),
        frame_of_keys({MODEL_KEY: AIRBORNE_4G}),
        frame_of(CFG_VALGET, struct.pack("<BBHI", 0, 0, 0, MODEL_KEY)),
    ]


def frame_of_keys(values: Mapping[int, int]) -> bytes:
    """CFG-VALSET of values by key, in the memory that a loss of supply clears."""
    pairs = (struct.pack("<I", key) + value.to_bytes(VALUE_BYTES[key >> 28], "little") for key, value in values.items())
    return frame_of(CFG_VALSET, struct.pack("<BBH", 0, IN_RAM, 0) + b"".join(pairs))


def model_in(frame: bytes) -> int | None:
    """The dynamic model that this frame reports; None for any other frame."""
    if frame[2:4] == CFG_NAV5 and len(frame) == NAV5_PAYLOAD + OVERHEAD:
        return frame[8]
    if frame[2:4] == CFG_VALGET and frame[10:14] == MODEL_KEY.to_bytes(4, "little") and len(frame) == 15 + 2:
        return frame[14]
    return None


def protocol_version(payload: bytes) -> float:
    """The protocol version in MON-VER, such as 18.0 of an M8 or 34.1 of an M10; 0 if it has none."""
    for start in range(SOFTWARE_AND_HARDWARE, len(payload), EXTENSION):
        text = payload[start : start + EXTENSION].partition(b"\0")[0]
        if text.startswith(PROTOCOL):
            try:
                return float(text[len(PROTOCOL) + 1 :])
            except ValueError:
                return 0.0
    return 0.0


def frame_of(kind: bytes, payload: bytes) -> bytes:
    """A UBX frame around a payload."""
    body = kind + len(payload).to_bytes(2, "little") + payload
    return SYNC + body + checksum(body)


def checksum(body: bytes) -> bytes:
    """Fletcher-8 over class, id, length and payload (32.4)."""
    return bytes([sum(body) & 0xFF, sum(accumulate(body)) & 0xFF])


def take_frames(buffer: bytearray) -> tuple[list[bytes], int]:
    """Take complete, valid frames out of `buffer`; an incomplete one stays in it.

    Returns the frames, and the number of invalid frames.
    """
    frames: list[bytes] = []
    rejected = 0
    while True:
        start = buffer.find(SYNC)
        if start < 0:
            del buffer[: len(buffer) - buffer.endswith(SYNC[:1])]
            return frames, rejected
        del buffer[:start]
        if len(buffer) < 6:
            return frames, rejected
        length = buffer[4] | buffer[5] << 8
        if length > LONGEST_PAYLOAD:
            del buffer[:1]
            rejected += 1
            continue
        end = length + OVERHEAD
        if len(buffer) < end:
            return frames, rejected
        if checksum(bytes(buffer[2 : end - 2])) == buffer[end - 2 : end]:
            frames.append(bytes(buffer[:end]))
            del buffer[:end]
        else:
            rejected += 1
            del buffer[:1]


def solution(frame: bytes, dynamic_model: int | None = None) -> Gps:
    """The message of a NAV-PVT frame. Without a fix the message has only time, fix type and number of satellites.

    dynamic_model: model of the receiver's filter, as read back.
    """
    if len(frame) != PVT_PAYLOAD + OVERHEAD:
        return Gps(status=Status.CORRUPT)
    itow_ms, *date, valid, nano, fix_type, flags, satellites = PVT_TIME.unpack_from(frame)
    longitude, latitude, height, height_msl, horizontal, vertical, north, east, down, speed = PVT_PLACE.unpack_from(
        frame
    )
    try:
        utc_ns = utc_of(date, nano) if valid & VALID_DATE_AND_TIME == VALID_DATE_AND_TIME else None
    except ValueError:
        return Gps(status=Status.CORRUPT)
    if not flags & FIX_OK or fix_type not in WITH_POSITION:
        return Gps(status=Status.NO_DATA, itow_ms=itow_ms, fix_type=fix_type, satellites=satellites, utc_ns=utc_ns)
    return Gps(
        itow_ms=itow_ms,
        fix_type=fix_type,
        satellites=satellites,
        utc_ns=utc_ns,
        latitude_deg=round(latitude * DEGREE, DEGREE_DIGITS),
        longitude_deg=round(longitude * DEGREE, DEGREE_DIGITS),
        height_m=height / 1e3,
        height_msl_m=height_msl / 1e3,
        velocity_north_mps=north / 1e3,
        velocity_east_mps=east / 1e3,
        velocity_down_mps=down / 1e3,
        horizontal_accuracy_m=horizontal / 1e3,
        vertical_accuracy_m=vertical / 1e3,
        speed_accuracy_mps=speed / 1e3,
        dynamic_model=dynamic_model,
    )


def believed(message: Gps) -> Gps:
    """The solution, or status `corrupt` without values if no aircraft of this kind can be there or fly that fast."""
    if message.status is not OK:
        return message
    latitude, longitude, height = message.latitude_deg, message.longitude_deg, message.height_m
    north, east, down = message.velocity_north_mps, message.velocity_east_mps, message.velocity_down_mps
    assert latitude is not None and longitude is not None and height is not None
    assert north is not None and east is not None and down is not None
    on_earth = -90 <= latitude <= 90 and -180 <= longitude <= 180 and LOWEST_M <= height <= HIGHEST_M
    if on_earth and north * north + east * east + down * down <= FASTEST_MPS**2:
        return message
    return Gps(status=Status.CORRUPT, itow_ms=message.itow_ms, fix_type=message.fix_type, satellites=message.satellites)


def utc_of(date: list[int], nano: int) -> int:
    """Unix time [ns] of year, month, day, hour, minute and second. Raises ValueError for an invalid date."""
    return calendar.timegm(tuple(date)) * 1_000_000_000 + nano
