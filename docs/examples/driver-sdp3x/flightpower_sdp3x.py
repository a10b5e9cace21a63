"""Sensirion SDP31 and SDP33 differential pressure sensors (datasheet SDP3x-Digital), read over I2C.

    [[sensors]]
    driver = "sdp3x"
    bus = "/dev/i2c-1"
    measures = "airspeed"

A measurement is nine bytes: pressure, temperature and the scale of pressure [counts/Pa], each a 16-bit number with a
CRC-8 (polynomial 0x31, initial value 0xFF).
"""

from collections.abc import Iterator
from typing import Literal

from flightpower.daq.bus import Buses, I2CBus
from flightpower.daq.config import BusSensorTable
from flightpower.daq.sensors import Sample, SensorFailure
from flightpower.flight.messages import DifferentialPressure, Status

STOP = b"\x3f\xf9"  # of the continuous measurement: the part takes no other command before
MEASURE_AND_AVERAGE = b"\x36\x15"  # differential pressure, averaged since the last reading
STOPS_WITHIN_S, FIRST_READING_S = 0.001, 0.02
COUNTS_PER_K = 200
ENDS_OF_RANGE = (-32768, 32767)


class Sdp3xTable(BusSensorTable, frozen=True, tag="sdp3x"):
    """The keys of the sensor in the tray file. Its topics depend on where its tubes go."""

    address: Literal[0x21, 0x22, 0x23] = 0x21
    measures: Literal["alpha", "beta", "airspeed"] = "airspeed"

    @property
    def topics(self) -> tuple[str, ...]:
        return (f"/probe/{self.measures}",)

    def make_driver(self, buses: Buses, period_s: float) -> "Sdp3xDriver":
        return Sdp3xDriver(buses.i2c(self.bus), self.address, self.topics[0])

    def identify(self, buses: Buses) -> str:
        """What `daq check` shows: the scale of its pressure tells an SDP31 from an SDP33."""
        scale = numbers(buses.i2c(self.bus).read(self.address, 9))[2]
        return {60: "SDP31", 20: "SDP33"}.get(scale, f"SDP3x with {scale} counts/Pa")


class Sdp3xDriver:
    """The part at `address`, writing to `topic`."""

    def __init__(self, bus: I2CBus, address: int, topic: str):
        self._bus, self._address, self._topic = bus, address, topic

    def start(self) -> Iterator[float]:
        self._bus.write(self._address, STOP)
        yield STOPS_WITHIN_S
        self._bus.write(self._address, MEASURE_AND_AVERAGE)
        yield FIRST_READING_S

    def read(self, now_ns: int) -> list[Sample]:
        return [Sample(self._topic, now_ns, message(self._bus.read(self._address, 9)))]


def message(reply: bytes) -> DifferentialPressure:
    """The message for nine bytes. Raises SensorFailure for a wrong checksum."""
    counts, temperature, scale = numbers(reply)
    return DifferentialPressure(
        status=Status.SATURATED if counts in ENDS_OF_RANGE else Status.OK,
        pressure_counts=counts,
        temperature_counts=temperature,
        differential_pressure_Pa=counts / scale,
        temperature_K=temperature / COUNTS_PER_K + 273.15,
    )


def numbers(reply: bytes) -> tuple[int, int, int]:
    """The three numbers, pressure and temperature signed. Raises SensorFailure for a wrong checksum or a scale of 0."""
    words = [reply[i : i + 2] for i in (0, 3, 6)]
    pressure, temperature, scale = (int.from_bytes(word, "big", signed=True) for word in words)
    if scale <= 0 or any(crc8(word) != reply[3 * i + 2] for i, word in enumerate(words)):
        raise SensorFailure(Status.CORRUPT, "SDP3x: wrong checksum")
    return pressure, temperature, scale


def crc8(data: bytes) -> int:
    """Polynomial 0x31, initial value 0xFF, not reflected."""
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc << 1 & 0xFF ^ (0x31 if crc & 0x80 else 0)
    return crc
