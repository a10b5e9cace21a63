"""Motor speed from a microcontroller that times the commutation pulses of the speed controller, at 115200 baud.

A decade counter divides the pulses, so that each transmitted period is ten electrical periods.

Legacy frame, 4 bytes: 'x', period in microseconds (3 bytes, most significant first). The letter also occurs in the
data. A frame is sent without interruption (0.35 ms), so the first byte after a pause of the line starts a frame. This
locates frames while the motor accelerates and successive periods differ by half. In a stream without pauses, frames
are accepted once three in a row agree in position and period.

Framed variant, 8 bytes, for a microcontroller that can be programmed:

    0    0xA5       start of frame
    1    sequence   counts frames modulo 256
    2    flags      bit 0: no pulse for 0.5 s, the motor is stopped; the period is then 0
    3-6  period     microseconds for ten electrical periods, most significant byte first
    7    CRC-8      of bytes 1 to 6: polynomial 0x07, initial value 0, not reflected, no final XOR

It is sent with each new period, at most every 10 ms, and every 0.5 s while the motor is stopped. Silence of the legacy
variant can be a stopped motor or a broken wire, and is logged as `no_data`, not as zero speed.
"""

from collections.abc import Iterator
from itertools import pairwise

from daq.bus import BytePort
from daq.sensors import Sample
from flight.messages import Rpm, Status

LEGACY_SILENCE_NS = 500_000_000
PAUSE_NS = 25_000_000  # longer than any gap within a frame: USB adapters delay bytes by up to 16 ms
FRAMED_SILENCE_NS = 1_200_000_000  # a little more than two frames of a stopped motor
PULSES = 10  # electrical periods in a transmitted period
# Ten electrical periods between 300 us and 1 s: a two-pole motor at 2 million rpm, a 14-pole one at 90 rpm.
SHORTEST_US, LONGEST_US = 300, 1_000_000
MAX_PERIOD_RATIO = 1.25  # of neighboring frames, while searching for the start of frames
LEGACY_BYTES, FRAMED_BYTES = 4, 8
LETTER, SYNC, MOTOR_STOPPED = ord("x"), 0xA5, 0x01


class EscCounterDriver:
    """The counter on `port`. framed: the variant with sequence and CRC."""

    def __init__(self, port: BytePort, *, pole_pairs: int, framed: bool = False):
        self._port = port
        self._pole_pairs = pole_pairs
        self._parser: LegacyParser | FramedParser = FramedParser() if framed else LegacyParser()
        self._silence_ns = FRAMED_SILENCE_NS if framed else LEGACY_SILENCE_NS
        self._last_ns: int | None = None
        self._quiet_since_ns: int | None = None  # when bytes were last received
        self._rejected = 0  # bytes rejected by the parser up to the last valid frame

    def start(self) -> Iterator[float]:
        """Nothing to configure."""
        yield 0.0

    def read(self, now_ns: int) -> list[Sample]:
        """The latest period, if new. After a long silence `no_data`, or `corrupt` if bytes were rejected."""
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
    """Shaft speed [rev/s] from the duration of ten electrical periods. A period of 0 means no pulses."""
    return 0.0 if period_us == 0 else PULSES * 1e6 / (period_us * pole_pairs)


class LegacyParser:
    """Finds the frames of the legacy stream.

    The start of frames is found after a pause, or from three successive frames that agree, if only one start is
    possible (a period that contains an 'x' can look like a frame). It is discarded when a frame is implausible.
    `rejected` counts bytes outside frames.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._locked = False
        self._after_pause = False
        self.rejected = 0

    def pause(self) -> None:
        """The line was silent: the next byte starts a frame, and an incomplete frame is discarded."""
        self._buffer.clear()
        self._locked = self._after_pause = True

    def feed(self, data: bytes) -> list[int]:
        """Periods [us] of the frames that `data` completes."""
        self._buffer += data
        periods: list[int] = []
        while True:
            if not self._locked and not self._find_start():
                return periods
            if len(self._buffer) < LEGACY_BYTES:
                return periods
            period = self._period_at(0)
            # The first period after a stop includes the time of the stop: a valid frame, but not a speed.
            if period is None and not (self._after_pause and self._buffer[0] == LETTER):
                self._locked = False
                self._reject(1)
                continue
            self._after_pause = False
            if period is not None:
                periods.append(period)
            del self._buffer[:LEGACY_BYTES]

    def _find_start(self) -> bool:
        """Move to the start of frames. Returns whether it was found."""
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
        return len(known) == 3 and all(max(a, b) <= MAX_PERIOD_RATIO * min(a, b) for a, b in pairwise(known))

    def _period_at(self, start: int) -> int | None:
        frame = self._buffer[start : start + LEGACY_BYTES]
        period = int.from_bytes(frame[1:], "big")
        return period if frame[0] == LETTER and SHORTEST_US <= period <= LONGEST_US else None


class FramedParser:
    """Finds the frames of the variant with CRC.

    `lost` counts frames missing in the sequence, `rejected` bytes outside frames.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._sequence: int | None = None
        self.lost = self.rejected = 0

    def pause(self) -> None:
        """Not needed: each frame has its own start byte and CRC."""

    def feed(self, data: bytes) -> list[int]:
        """Periods [us] of the frames that `data` completes; 0 for a stopped motor."""
        self._buffer += data
        periods: list[int] = []
        while len(self._buffer) >= FRAMED_BYTES:
            frame = self._buffer[:FRAMED_BYTES]
            period = int.from_bytes(frame[3:7], "big")
            plausible = period == 0 if frame[2] & MOTOR_STOPPED else period >= SHORTEST_US
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
