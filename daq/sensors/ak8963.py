"""Driver of the Asahi Kasei AK8963, the magnetometer in the MPU-9250. Numbers in brackets: datasheet MS1356-E-02.

It has an I2C address of its own, accessible after the MPU-9250 has opened its bypass.
"""

import struct
from collections.abc import Iterator

from flightpower.daq.bus import I2CBus
from flightpower.daq.sensors import Sample, SensorFailure, brown_out, wrong_device
from flightpower.daq.sensors.axes import BODY_AXES, Axes, to_body_axes
from flightpower.flight.messages import OK, Magnetometer, Status

WIA, ST1, CNTL1, CNTL2, ASAX = 0x00, 0x02, 0x0A, 0x0B, 0x10  # [8.2]
IDENTITY = 0x48
POWER_DOWN, CONTINUOUS_100_HZ_16_BIT, FUSE_ROM = 0x00, 0x16, 0x0F  # [8.3.7]
SOFT_RESET = 0x01
DATA_READY, OVERFLOW = 0x01, 0x08  # [8.3.2, 8.3.6]
TESLA_PER_COUNT = 4912e-6 / 32760  # at 16 bits [8.3.5]

MODE_CHANGE_S = 0.1  # the datasheet requires 100 us [6.3]; with less than 100 ms, some parts are reported not to start
BYPASS_OPENS_S = 0.25  # time for the MPU-9250 to be reset and configured
BLOCK = struct.Struct("<B3hBB")  # ST1, x y z, ST2, CNTL1: ST2 must be read, or the part stops updating [6.4.3]
JUMP_COUNTS = 100  # 15 uT per tick: a turn per second in the earth's field. A larger jump must be read twice.
STALE_LIMIT = 12  # more stale reads in a row than this mean that the 100 Hz conversion has stopped


class AK8963Driver:
    """The part on `bus`. axes: mounting of the MPU-9250 that contains it, see `daq.sensors.axes`."""

    def __init__(self, bus: I2CBus, address: int = 0x0C, *, axes: Axes = BODY_AXES):
        self._bus, self._address = bus, address
        self._axes = axes
        self._sensitivity = (1.0, 1.0, 1.0)
        self._stale = 0
        self._counts: tuple[int, int, int] | None = None  # the latest believed counts, and counts that jumped since
        self._odd: tuple[int, int, int] | None = None

    def start(self) -> Iterator[float]:
        yield BYPASS_OPENS_S
        identity = self._bus.write_read(self._address, bytes([WIA]), 1)[0]
        if identity != IDENTITY:
            raise wrong_device("AK8963", f"WIA is 0x{identity:02x}")
        self._bus.write(self._address, bytes([CNTL2, SOFT_RESET]))
        yield MODE_CHANGE_S
        self._bus.write(self._address, bytes([CNTL1, FUSE_ROM]))
        yield MODE_CHANGE_S
        fuse = self._bus.write_read(self._address, bytes([ASAX]), 3)
        if fuse in (b"\x00\x00\x00", b"\xff\xff\xff"):
            raise SensorFailure(Status.CORRUPT, "AK8963: the sensitivity memory cannot be read")
        x, y, z = fuse
        self._sensitivity = (sensitivity(x), sensitivity(y), sensitivity(z))
        self._bus.write(self._address, bytes([CNTL1, POWER_DOWN]))
        yield MODE_CHANGE_S
        self._bus.write(self._address, bytes([CNTL1, CONTINUOUS_100_HZ_16_BIT]))
        yield MODE_CHANGE_S

    def read(self, now_ns: int) -> list[Sample]:
        status, x, y, z, status2, control = self._block()
        if control != CONTINUOUS_100_HZ_16_BIT:  # lost settings, or a wrong bit in the reply
            status, x, y, z, status2, control = self._block()
            if control != CONTINUOUS_100_HZ_16_BIT:
                raise brown_out("AK8963")
        if not status & DATA_READY:
            self._stale += 1
            if self._stale > STALE_LIMIT:
                raise SensorFailure(Status.STALE, "AK8963 has stopped measuring")
            return [Sample("/mag", now_ns, Magnetometer(status=Status.STALE))]
        self._stale = 0
        counts, before = (x, y, z), self._counts
        jumps = before is not None and not is_near(counts, before)
        if jumps and (self._odd is None or not is_near(counts, self._odd)):
            self._odd = counts
            return [Sample("/mag", now_ns, Magnetometer(status=Status.CORRUPT))]
        self._counts, self._odd = counts, None
        field_x, field_y, field_z = to_body_axes(field_T(counts, self._sensitivity), self._axes)
        message = Magnetometer(
            status=Status.SATURATED if status2 & OVERFLOW else OK,
            x_counts=x,
            y_counts=y,
            z_counts=z,
            field_x_T=field_x,
            field_y_T=field_y,
            field_z_T=field_z,
        )
        return [Sample("/mag", now_ns, message)]

    def _block(self) -> tuple[int, ...]:
        return BLOCK.unpack(self._bus.write_read(self._address, bytes([ST1]), BLOCK.size))


def is_near(counts: tuple[int, int, int], others: tuple[int, int, int]) -> bool:
    """Whether one reading can follow the other within a tick."""
    (x, y, z), (other_x, other_y, other_z) = counts, others
    return abs(x - other_x) <= JUMP_COUNTS and abs(y - other_y) <= JUMP_COUNTS and abs(z - other_z) <= JUMP_COUNTS


def sensitivity(fuse: int) -> float:
    """Return the scale factor of an axis, from its fuse byte [8.3.11]."""
    return (fuse - 128) / 256 + 1


def field_T(counts: tuple[int, int, int], sensitivities: tuple[float, float, float]) -> tuple[float, float, float]:
    """Flux density [T] along the accelerometer's axes: x and y are exchanged, z is reversed (PS-MPU-9250A-01, 9.1)."""
    x, y, z = (n * s * TESLA_PER_COUNT for n, s in zip(counts, sensitivities, strict=True))
    return y, x, -z
