"""u-blox M8 receiver: UBX NAV-PVT over a byte stream (protocol: u-blox 8 / M8 Receiver Description, UBX-13003221).

The receiver is configured while the sampling loop runs: one command at a time, the next after an acknowledge. When
solutions stop, the configuration is sent again, because the receiver loses it when its supply is interrupted. Numbers
in brackets are sections of the description. The tests compare with pyubx2, which takes ten times as long.
"""

import calendar
import struct
from collections.abc import Callable, Iterator
from itertools import accumulate

from daq.bus import BytePort
from daq.sensors import Sample, SensorFailure
from flight.messages import OK, Gps, Status

SYNC = b"\xb5\x62"
OVERHEAD = 8  # sync, class, id, length, checksum
PVT_PAYLOAD = 92
# NAV-PVT (32.17.17) after class, id and length: iTOW; year, month, day, hour, minute, second, validity; nano; fixType,
# flags, numSV. Longitude, latitude, two heights, two accuracies, three velocities, accuracy of the speed.
PVT_TIME, PVT_PLACE = struct.Struct("<6x I H6B 4xi 2BxB"), struct.Struct("<30x 2i 2i 2I 3i 8xI")
VALID_DATE_AND_TIME, FIX_OK = 0x07, 0x01  # and fullyResolved: not those of the clock that ran on its battery
DEGREE, DEGREE_DIGITS = 1e-7, 7
LONGEST_PAYLOAD = 1024  # longer than any requested message: not a frame
NAV_PVT, ACK_ACK, ACK_NAK = b"\x01\x07", b"\x05\x01", b"\x05\x00"
CFG_PRT, CFG_MSG, CFG_RATE = b"\x06\x00", b"\x06\x01", b"\x06\x08"  # 32.10.25, 32.10.18, 32.10.27
CFG_NAV5, NAV5_PAYLOAD, ONLY_DYNAMIC_MODEL = b"\x06\x24", 36, 0x0001  # 32.10.19; its mask of what is to be changed
AIRBORNE_4G = 8  # dynModel (8.1): set at the factory is 0, portable, which smooths velocity
FACTORY_BAUD = 9600
SWITCH_S = 0.1  # CFG-PRT lasts 29 ms at 9600 baud, and the receiver takes a moment to change
MAX_FRAME_NS = 300_000_000  # a frame incomplete for this long is discarded; 100 bytes take 0.1 s at 9600 baud
ACK_TIMEOUT_NS = 1_000_000_000
SILENCE_NS = 1_500_000_000  # no solution for this long is `no_data`; a receiver without fix still sends solutions
LOWEST_M, HIGHEST_M = -600.0, 15_000.0  # above the ellipsoid: the shore of the Dead Sea is at -420
FASTEST_MPS = 200.0  # in a dive, with the wind
WITH_POSITION = (2, 3, 4)  # fixType: 2D, 3D, GNSS with dead reckoning


class UBloxDriver:
    """The receiver on `port`. rate_Hz: of the solutions, 1 to 10. baud: of the port, None on I2C.

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
        self._commands = configuration(rate_Hz, baud)
        self._buffer = bytearray()
        self._begun_ns = 0  # latest time at which the first frame in the buffer can have begun
        self._to_send: list[bytes] = []
        self._sent_ns: int | None = None
        self._last_ns: int | None = None
        self._itow_ms: int | None = None  # of the latest solution
        self._corrupt = False
        self.refused: list[str] = []  # commands that the receiver rejected
        self._dynamic_model: int | None = None  # as the receiver says, after it was set

    def start(self) -> Iterator[float]:
        """Set the receiver's baud rate. The rest of the configuration is sent in `read`."""
        self._to_send = list(self._commands)
        if self._reopen is not None and self._baud not in (None, FACTORY_BAUD):
            self._reopen(FACTORY_BAUD).write(self._commands[0])  # ignored by a receiver at another rate
            yield SWITCH_S
            self._port = self._reopen(self._baud)
        yield 0.0

    def read(self, now_ns: int) -> list[Sample]:
        """Every solution that has arrived since the last tick, `stale` where it is the last one again.

        `no_data` after each 1.5 s without a new solution.
        """
        if self._last_ns is None:
            self._last_ns = self._begun_ns = now_ns
        frames, rejected = self._take(now_ns)
        self._corrupt |= rejected > 0
        samples = []
        solved = False
        for frame in frames:
            kind = frame[2:4]
            if kind == NAV_PVT:
                message = self._solution(frame)
                solved |= message.status is not Status.STALE
                samples.append(Sample(self._topic, now_ns, message))
            elif kind == CFG_NAV5 and len(frame) == NAV5_PAYLOAD + OVERHEAD:
                self._dynamic_model = frame[8]
            elif kind in (ACK_ACK, ACK_NAK) and self._to_send and frame[6:8] == self._to_send[0][2:4]:
                if kind == ACK_NAK:
                    self.refused.append(self._to_send[0][2:4].hex())
                self._to_send.pop(0)
                self._sent_ns = None
        if solved:
            self._last_ns, self._corrupt, self._silences = now_ns, False, 0
        elif samples:  # it answers, and a restart would forget which solution it repeats
            self._silences = 0
        if not solved and now_ns - self._last_ns >= SILENCE_NS:
            silence = self._silence(now_ns)
            if not samples:
                samples.append(Sample(self._topic, now_ns, silence))
        self._configure(now_ns)
        return samples

    def _take(self, now_ns: int) -> tuple[list[bytes], int]:
        """Read the port and take frames out of the buffer. A frame incomplete for too long is discarded."""
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

    def _solution(self, frame: bytes) -> Gps:
        """The message of a NAV-PVT frame: `stale` and empty if its time of week is that of the solution before it."""
        message = believed(solution(frame, self._dynamic_model))
        if message.status is OK and message.itow_ms == self._itow_ms:
            return Gps(status=Status.STALE)
        self._itow_ms = message.itow_ms
        return message

    def _silence(self, now_ns: int) -> Gps:
        """Configure the receiver again. The second time in a row, fail: it is restarted from its factory rate."""
        status = Status.CORRUPT if self._corrupt else Status.NO_DATA
        self._silences += 1
        if self._silences > 1 and self._reopen is not None:
            raise SensorFailure(
                status,
                "the receiver sends nothing" if status is Status.NO_DATA else "the receiver sends only damaged data",
            )
        self._last_ns, self._corrupt = now_ns, False
        self._to_send, self._sent_ns, self._dynamic_model = list(self._commands), None, None
        return Gps(status=status)

    def _configure(self, now_ns: int) -> None:
        due = self._sent_ns is None or now_ns - self._sent_ns >= ACK_TIMEOUT_NS
        if self._to_send and due:
            self._port.write(self._to_send[0])
            self._sent_ns = now_ns


def configuration(rate_Hz: float, baud: int | None) -> list[bytes]:
    """Commands that make the receiver send NAV-PVT and nothing else, and its filter expect the accelerations of flight.

    The last one asks for the dynamic model, which some receivers acknowledge and do not keep. baud: None on I2C.
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


def frame_of(kind: bytes, payload: bytes) -> bytes:
    """A UBX frame around a payload."""
    body = kind + len(payload).to_bytes(2, "little") + payload
    return SYNC + body + checksum(body)


def checksum(body: bytes) -> bytes:
    """Fletcher-8 over class, id, length and payload (32.4)."""
    return bytes([sum(body) & 0xFF, sum(accumulate(body)) & 0xFF])


def take_frames(buffer: bytearray) -> tuple[list[bytes], int]:
    """Take complete, valid frames out of `buffer`; an incomplete one stays in it.

    Returns the frames, and the number of invalid ones.
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
    """The message of a NAV-PVT frame. Without a fix it has only time, fix type and number of satellites.

    dynamic_model: of the receiver's filter, as read back from it.
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
    """The solution, or `corrupt` without values where no such aircraft can be there, or be so fast."""
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
