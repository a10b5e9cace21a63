"""Reads motor speed from a microcontroller that times the commutation pulses of the speed controller, at 115200 baud.

A decade counter divides the pulses, so that each transmitted period is ten electrical periods.

Legacy frame, 4 bytes: 'x', period in microseconds (3 bytes, most significant first). The letter also occurs in the
data. A frame is sent without interruption (0.35 ms), so the first byte after a pause of the line starts a frame. This
locates frames while the motor accelerates and successive periods differ by half. In a stream without pauses, frames
are accepted once three in a row agree in position and period. This frame has no checksum: a period that jumps by more
than 5 % is withheld until the next period is near it.

Framed variant, 11 bytes, for a microcontroller that can be programmed (firmware/esc_counter):

    0    0xA6       start of frame
    1    sequence   counts frames modulo 256
    2    flags      bit 0: no pulse for 0.5 s, the motor is stopped; bit 1: the pulses do not come evenly, so that
                    the period may be wrong by more than 2 %; bit 2: no new period. With bit 0 or 2 the period is 0
    3-6  period     microseconds for ten electrical periods, most significant byte first
    7    captured   pulses since the last frame; this count and the next two end at 255
    8    rejected   of these, pulses that came too early
    9    inserted   pulses that were missing, and were counted all the same
    10   CRC-8      of bytes 1 to 9: polynomial 0x07, initial value 0, not reflected, no final XOR

It is sent with each new period, at most every 10 ms, and otherwise every 50 ms, or every 0.5 s while the motor is
stopped. Earlier firmware sends 8 bytes, with 0xA5 and without the three counts; those are read as well.

A period is believed if the pulses came evenly and at most a quarter of them was rejected or inserted. Otherwise the
message is `corrupt`, without a speed. No counter can distinguish an echo in the middle of each period from twice the
speed. Silence of the legacy variant can be a stopped motor or a broken wire, and is logged as `no_data`, not as zero
speed.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from flightpower.daq.bus import BytePort
from flightpower.daq.sensors import Sample
from flightpower.flight.messages import Rpm, Status

LEGACY_SILENCE_NS = 500_000_000
PAUSE_NS = 25_000_000  # longer than any gap within a frame: USB adapters delay bytes by up to 16 ms
FRAMED_SILENCE_NS = 1_200_000_000  # a little more than two frames of a stopped motor
PULSES = 10  # electrical periods in a transmitted period
# Ten electrical periods between 300 us and 1 s: a two-pole motor at 2 million rpm, a 14-pole one at 90 rpm.
SHORTEST_US, LONGEST_US = 300, 1_000_000
FASTEST_REVPS = 2500.0  # no motor that turns a propeller or a fan is faster: 150,000 rpm
MAX_PERIOD_RATIO = 1.25  # largest ratio of neighboring periods while searching for the start of frames
LARGEST_STEP = 0.05  # relative change of a legacy period between frames; larger changes must be confirmed
FORGOTTEN_NS = 300_000_000  # time after which a period says nothing about the next period
LEGACY_BYTES = 4
LETTER = ord("x")
FRAMED_BYTES = {0xA5: 8, 0xA6: 11}  # length by start byte: earlier firmware, and firmware that counts pulses
MOTOR_STOPPED, UNEVEN, NO_PERIOD = 0x01, 0x02, 0x04
LARGEST_CORRECTED_SHARE = 0.25  # share of pulses that may be rejected or inserted; noise on one in twenty is harmless


class CounterFrame(NamedTuple):
    """A period [us] (0 if the motor is stopped, None if none was measured), and data about its pulses."""

    period_us: int | None
    uneven: bool = False
    captured: int | None = None
    rejected: int | None = None
    inserted: int | None = None

    @property
    def believed(self) -> bool:
        """Whether the period can be trusted within 2 %."""
        corrected = (self.rejected or 0) + (self.inserted or 0)
        return not self.uneven and corrected <= LARGEST_CORRECTED_SHARE * (self.captured or corrected)


class EscCounterDriver:
    """The counter on `port`. framed: the variant with sequence and CRC."""

    def __init__(self, port: BytePort, *, pole_pairs: int, framed: bool = False):
        self._port = port
        self._pole_pairs = pole_pairs
        self._parser: LegacyParser | FramedParser = FramedParser() if framed else LegacyParser()
        self._silence_ns = FRAMED_SILENCE_NS if framed else LEGACY_SILENCE_NS
        self._last_ns: int | None = None
        self._quiet_since_ns: int | None = None  # when the line fell silent
        self._framed_ns = 0  # time of the latest legacy frame, its period, and the latest period withheld
        self._period_us: int | None = None
        self._odd_us: int | None = None
        self._rejected = 0  # bytes rejected by the parser up to the last valid frame

    def start(self) -> Iterator[float]:
        """There is nothing to configure."""
        yield 0.0

    def read(self, now_ns: int) -> list[Sample]:
        """The latest period, if new. A long silence gives `no_data`, or `corrupt` if bytes were rejected."""
        if self._last_ns is None:
            self._last_ns = now_ns
        data = self._port.read_available()
        if data or self._quiet_since_ns is None:
            self._quiet_since_ns = now_ns
        elif now_ns - self._quiet_since_ns >= PAUSE_NS:
            self._parser.pause()
        frames = self._parser.feed(data)
        if isinstance(self._parser, LegacyParser):
            frames = self._confirmed(frames, now_ns)
        measured = [frame for frame in frames if frame.period_us is not None or not frame.believed]
        if measured:
            self._last_ns, self._rejected = now_ns, self._parser.rejected
            return [Sample("/rpm", now_ns, self._message(measured[-1]))]
        if now_ns - self._last_ns < self._silence_ns:
            return []
        return [Sample("/rpm", now_ns, Rpm(status=self._silence()))]

    def _confirmed(self, frames: list[CounterFrame], now_ns: int) -> list[CounterFrame]:
        """The frames whose period is near the period before, or near a withheld period."""
        if now_ns - self._framed_ns > FORGOTTEN_NS:
            self._period_us = self._odd_us = None
        confirmed = []
        for frame in frames:
            period_us = frame.period_us or 0
            self._framed_ns = now_ns
            follows = self._period_us is None or abs(period_us / self._period_us - 1) <= LARGEST_STEP
            odd_us = self._odd_us
            if follows or (odd_us is not None and max(period_us, odd_us) <= MAX_PERIOD_RATIO * min(period_us, odd_us)):
                self._period_us, self._odd_us = period_us, None
                confirmed.append(frame)
            else:
                self._odd_us = period_us
        return confirmed

    def _message(self, frame: CounterFrame) -> Rpm:
        period_us = frame.period_us
        speed = motor_speed_revps(period_us, self._pole_pairs) if period_us is not None and frame.believed else None
        if speed is not None and speed > FASTEST_REVPS:
            speed = None
        return Rpm(
            status=Status.CORRUPT if speed is None else Status.OK,
            period_us=period_us,
            motor_speed_revps=speed,
            pulses_captured=frame.captured,
            pulses_rejected=frame.rejected,
            pulses_inserted=frame.inserted,
        )

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
        """Note that the line was silent: the next byte starts a frame, and an incomplete frame is discarded."""
        self._buffer.clear()
        self._locked = self._after_pause = True

    def feed(self, data: bytes) -> list[CounterFrame]:
        """The frames that `data` completes."""
        self._buffer += data
        periods: list[CounterFrame] = []
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
                periods.append(CounterFrame(period))
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
        measured = [period for period in periods if period is not None]
        return len(measured) == 3 and all(max(a, b) <= MAX_PERIOD_RATIO * min(a, b) for a, b in pairwise(measured))

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
        """Do nothing: each frame has its own start byte and CRC."""

    def feed(self, data: bytes) -> list[CounterFrame]:
        """The frames that `data` completes."""
        self._buffer += data
        frames: list[CounterFrame] = []
        while self._buffer:
            length = FRAMED_BYTES.get(self._buffer[0])
            if length is not None and len(self._buffer) < length:
                return frames
            body = bytes(self._buffer[1 : (length or 1) - 1])
            if length is None or crc8(body) != self._buffer[length - 1] or (frame := decoded(body)) is None:
                del self._buffer[:1]
                self.rejected += 1
                continue
            if self._sequence is not None:
                self.lost += (body[0] - self._sequence - 1) % 256
            self._sequence = body[0]
            frames.append(frame)
            del self._buffer[:length]
        return frames


def decoded(body: bytes) -> CounterFrame | None:
    """The content of a frame, without its first byte and its CRC; None if its period is implausible.

    Earlier firmware sends no counts.
    """
    flags, period_us = body[1], int.from_bytes(body[2:6], "big")
    measured = not flags & (MOTOR_STOPPED | NO_PERIOD)
    if (period_us < SHORTEST_US) if measured else period_us:
        return None
    return CounterFrame(None if flags & NO_PERIOD else period_us, bool(flags & UNEVEN), *body[6:9])


def crc8(data: bytes) -> int:
    """CRC-8 with polynomial 0x07, initial value 0 (its check value, of "123456789", is 0xF4)."""
    remainder = 0
    for byte in data:
        remainder ^= byte
        for _ in range(8):
            remainder = (remainder << 1 ^ 0x07 if remainder & 0x80 else remainder << 1) & 0xFF
    return remainder
