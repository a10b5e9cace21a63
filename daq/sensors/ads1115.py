"""Driver of the TI ADS1115, an analog converter with four inputs and 16 bits (SBAS444D, sections in brackets).

Each tick reads the input whose conversion the preceding tick started, and starts the next input: each of n inputs is
read every n-th tick.
"""

from collections.abc import Iterator, Sequence

from flightpower.daq.bus import I2CBus
from flightpower.daq.sensors import Sample, SensorFailure, brown_out
from flightpower.flight.messages import Analog, Status

CONVERSION, CONFIG = 0x00, 0x01  # [8.1]
START, SINGLE_SHOT, COMPARATOR_OFF = 0x8000, 0x0100, 0x0003  # [8.1.3]
NOT_CONVERTING = 0x8000  # the same bit when read
FIRST_INPUT = 0b100  # multiplexer code of AIN0 against ground
FULL_SCALE_V = (6.144, 4.096, 2.048, 1.024, 0.512, 0.256)  # range by code of the amplifier
RATES_HZ = (8, 16, 32, 64, 128, 250, 475, 860)  # by code
SLOWEST = 0.9  # the internal oscillator is within 10 % [7.5]
WAKE_UP_S = 25e-6  # [9.4.2.1]
FREE_SHARE = 0.9  # fraction of a tick that a conversion may take
FULL_COUNT = 2**15


class ADS1115Driver:
    """The part at `address`, writing to /analog. inputs: 0 to 3. full_scale_V: range. period_s: tick period.

    An input must not exceed the supply, whatever the range [7.3].
    """

    def __init__(self, bus: I2CBus, address: int, *, inputs: Sequence[int], full_scale_V: float, period_s: float):
        self._bus, self._address = bus, address
        self._inputs = tuple(inputs)
        self._full_scale_V = full_scale_V
        code, conversion_s = rate_code(period_s)
        self._conversion_ns = round(conversion_s * 1e9)
        self._base = FULL_SCALE_V.index(full_scale_V) << 9 | SINGLE_SHOT | code << 5 | COMPARATOR_OFF
        self._next = 0
        self._running: int | None = None  # input being converted
        self._started_ns = 0

    def start(self) -> Iterator[float]:
        """Check that the part keeps what is written, since it has no identity register."""
        self._set(self._base)
        yield 0.0
        if self._config() & ~NOT_CONVERTING != self._base:
            raise SensorFailure(Status.WRONG_DEVICE, "ADS1115: another part answers, or it does not keep its settings")
        self._running = None

    def read(self, now_ns: int) -> list[Sample]:
        samples = []
        if self._running is not None:
            samples = [self._finish(now_ns, self._running)]
            if samples[0].message.status is Status.BUSY:
                return samples
        self._running = self._inputs[self._next]
        self._next = (self._next + 1) % len(self._inputs)
        self._started_ns = now_ns
        self._set(START | self._word(self._running))
        return samples

    def _finish(self, now_ns: int, channel: int) -> Sample:
        config = self._config()
        if not config & NOT_CONVERTING:
            return Sample("/analog", now_ns, Analog(status=Status.BUSY, channel=channel))
        if config & ~NOT_CONVERTING != self._word(channel):
            raise brown_out("ADS1115")
        counts = int.from_bytes(self._bus.write_read(self._address, bytes([CONVERSION]), 2), "big", signed=True)
        at_limit = counts in (FULL_COUNT - 1, -FULL_COUNT)
        message = Analog(
            status=Status.SATURATED if at_limit else Status.OK,
            channel=channel,
            counts=counts,
            voltage_V=counts * self._full_scale_V / FULL_COUNT,
        )
        return Sample("/analog", self._started_ns + self._conversion_ns // 2, message)

    def _word(self, channel: int) -> int:
        return self._base | (FIRST_INPUT + channel) << 12

    def _config(self) -> int:
        return int.from_bytes(self._bus.write_read(self._address, bytes([CONFIG]), 2), "big")

    def _set(self, word: int) -> None:
        self._bus.write(self._address, bytes([CONFIG]) + word.to_bytes(2, "big"))


def rate_code(period_s: float) -> tuple[int, float]:
    """Code of the slowest rate whose conversion ends within a tick, and the nominal time of a conversion [s]."""
    for code, rate_Hz in enumerate(RATES_HZ):
        if WAKE_UP_S + 1 / (SLOWEST * rate_Hz) <= FREE_SHARE * period_s:
            return code, 1 / rate_Hz
    return len(RATES_HZ) - 1, 1 / RATES_HZ[-1]
