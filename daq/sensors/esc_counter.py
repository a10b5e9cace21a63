"""Motor speed from the microcontroller that times the speed controller's commutation pulses, at 115200 baud.

A decade counter divides the pulses, so that a period sent is ten electrical periods.

Legacy frame, 4 bytes: 'x', period in microseconds (3 bytes, most significant first). The letter also occurs in the
data. A frame is sent in one go (0.35 ms), so what follows a pause of the line begins with one: that is how the frames
of a motor that spins up are found, whose periods differ by half. In a stream without pauses, frames are believed once
three in a row agree in place and in size.

Framed variant, 8 bytes, for those who can program the microcontroller:

    0    0xA5       start of frame
    1    sequence   counts frames modulo 256
    2    flags      bit 0: no pulse for 0.5 s, the motor stands; the period is then 0
    3-6  period     microseconds for ten electrical periods, most significant byte first
    7    CRC-8      of bytes 1 to 6: polynomial 0x07, initial value 0, not reflected, no final XOR

Send it with each new period, but not more often than every 10 ms, and every 0.5 s while the motor stands. Silence of
the legacy variant may be a standing motor or a broken wire, and is logged as `no_data`, not as zero.
"""

from collections.abc import Iterator
from itertools import pairwise

from daq.bus import BytePort
from daq.sensors import Sample
from flight.messages import Rpm, Status

LEGACY_SILENCE_NS = 500_000_000
PAUSE_NS = 25_000_000  # no frame is torn by as much: USB adapters hold bytes back for up to 16 ms
FRAMED_SILENCE_NS = 1_200_000_000  # two frames of a standing motor, and a little
PULSES = 10  # electrical periods to a period that is sent
# Ten electrical periods between 300 us and 1 s: a two-pole motor at 2 million rpm, a 14-pole one at 90 rpm.
SHORTEST_US, LONGEST_US = 300, 1_000_000
AGREEMENT = 1.25  # between neighbouring frames, while looking for where frames begin
LEGACY_BYTES, FRAMED_BYTES = 4, 8
LETTER, SYNC, STANDING = ord("x"), 0xA5, 0x01


class EscCounter:
    """The counter on `port`. framed: the variant with sequence and CRC."""

    def __init__(self, port: BytePort, *, pole_pairs: int, framed: bool = False):
        self._port = port
        self._pole_pairs = pole_pairs
        self._parser: LegacyParser | FramedParser = FramedParser() if framed else LegacyParser()
        self._silence_ns = FRAMED_SILENCE_NS if framed else LEGACY_SILENCE_NS
        self._last_ns: int | None = None
        self._quiet_since_ns: int | None = None  # when the line was last seen to carry something
        self._rejected = 0  # by the parser, when it last found something

    def start(self) -> Iterator[float]:
        """Nothing to set."""
        yield 0.0

    def read(self, now_ns: int) -> list[Sample]:
        """The latest period, when there is a new one; `no_data`, or `corrupt`, when there was none for too long."""
        if self._last_ns is None:
            self._last_ns = now_ns
        data = self._port.read_available()
        if data or self._quiet_since_ns is None:
            self._quiet_since_ns = now_ns
        elif now_ns - self._quiet_since_ns >= PAUSE_NS:
            self._parser.pause()
        periods_us = self._parser.feed(data)
        if periods_us:
            self._last_ns, self._rejected = now_ns, self._parser.rejected
            period_us = periods_us[-1]
            speed = motor_speed_revps(period_us, self._pole_pairs)
            return [Sample("/rpm", now_ns, Rpm(period_us=period_us, motor_speed_revps=speed))]
        if now_ns - self._last_ns < self._silence_ns:
            return []
        return [Sample("/rpm", now_ns, Rpm(status=self._silence()))]

    def _silence(self) -> Status:
        return Status.CORRUPT if self._parser.rejected > self._rejected else Status.NO_DATA


def motor_speed_revps(period_us: int, pole_pairs: int) -> float:
    """Speed of the shaft [rev/s] from the time of ten electrical periods; 0 stands for no pulses."""
    return 0.0 if period_us == 0 else PULSES * 1e6 / (period_us * pole_pairs)


class LegacyParser:
    """Finds the frames of the legacy stream.

    Where frames begin is learnt from a pause, or from three neighbours that agree, if no other place would do as well
    (a period with an 'x' inside can imitate one for a while); it is forgotten when a frame does not fit. `rejected`
    counts bytes that were no part of a frame.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._locked = False
        self._after_pause = False
        self.rejected = 0

    def pause(self) -> None:
        """Nothing has come for a while: what comes next begins with a frame, and what was begun is not finished."""
        self._buffer.clear()
        self._locked = self._after_pause = True

    def feed(self, data: bytes) -> list[int]:
        """Periods [us] of the frames that `data` completes."""
        self._buffer += data
        periods: list[int] = []
        while True:
            if not self._locked and not self._find():
                return periods
            if len(self._buffer) < LEGACY_BYTES:
                return periods
            period = self._period_at(0)
            # The first period after a stand lasts as long as the motor stood: in its place, but not a speed.
            if period is None and not (self._after_pause and self._buffer[0] == LETTER):
                self._locked = False
                self._reject(1)
                continue
            self._after_pause = False
            if period is not None:
                periods.append(period)
            del self._buffer[:LEGACY_BYTES]

    def _find(self) -> bool:
        """Move to where frames begin, if that can be told."""
        while len(self._buffer) >= 4 * LEGACY_BYTES - 1:
            starts = [start for start in range(LEGACY_BYTES) if self._agrees(start)]
            if len(starts) == 1:
                self._reject(starts[0])
                self._locked = True
                return True
            self._reject(LEGACY_BYTES if starts else 1)
        return False

    def _reject(self, count: int) -> None:
        del self._buffer[:count]
        self.rejected += count

    def _agrees(self, start: int) -> bool:
        periods = [self._period_at(start + i * LEGACY_BYTES) for i in range(3)]
        known = [period for period in periods if period is not None]
        return len(known) == 3 and all(max(a, b) <= AGREEMENT * min(a, b) for a, b in pairwise(known))

    def _period_at(self, start: int) -> int | None:
        frame = self._buffer[start : start + LEGACY_BYTES]
        period = int.from_bytes(frame[1:], "big")
        return period if frame[0] == LETTER and SHORTEST_US <= period <= LONGEST_US else None


class FramedParser:
    """Finds the frames of the variant with CRC.

    `lost` counts gaps in the sequence, `rejected` bytes that were no part of a frame.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._sequence: int | None = None
        self.lost = self.rejected = 0

    def pause(self) -> None:
        """Nothing to learn from it: each frame is checked by itself."""

    def feed(self, data: bytes) -> list[int]:
        """Periods [us] of the frames that `data` completes; 0 for a standing motor."""
        self._buffer += data
        periods: list[int] = []
        while len(self._buffer) >= FRAMED_BYTES:
            frame = self._buffer[:FRAMED_BYTES]
            period = int.from_bytes(frame[3:7], "big")
            plausible = period == 0 if frame[2] & STANDING else period >= SHORTEST_US
            if frame[0] != SYNC or crc8(bytes(frame[1:7])) != frame[7] or not plausible:
                del self._buffer[:1]
                self.rejected += 1
                continue
            if self._sequence is not None:
                self.lost += (frame[1] - self._sequence - 1) % 256
            self._sequence = frame[1]
            periods.append(period)
            del self._buffer[:FRAMED_BYTES]
        return periods


def crc8(data: bytes) -> int:
    """CRC-8 with polynomial 0x07, initial value 0 (its check value, of "123456789", is 0xF4)."""
    remainder = 0
    for byte in data:
        remainder ^= byte
        for _ in range(8):
            remainder = (remainder << 1 ^ 0x07 if remainder & 0x80 else remainder << 1) & 0xFF
    return remainder
