"""Driver of the InvenSense MPU-9250: reads accelerometer and gyroscope through its FIFO, or sample by sample.

Numbers in brackets are sections of the register map, RM-MPU-9250A-00 rev. 1.4; PS is the product specification
PS-MPU-9250A-01.

By default the part samples at 200 Hz into its FIFO, and the samples are averaged over a tick, so that motor vibration
does not alias into 25 Hz samples. The magnetometer inside (AK8963) has its own driver; this one opens the bypass to it.

Each tick, the registers of ranges, filters and rate are read after the samples, and sometimes those of FIFO and bypass:
samples with other settings are not recorded, and the settings are restored. A reply with a wrong bit must not look like
lost settings, so registers that differ are read once more. A damaged reply is recognized by its temperature, or by a
sample far from all others.
"""

import math
import struct
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from flightpower.daq.bus import I2CBus
from flightpower.daq.sensors import Sample, SensorFailure, brown_out, wrong_device
from flightpower.daq.sensors.axes import BODY_AXES, Axes, to_body_axes
from flightpower.daq.sensors.slow_value import SlowValue
from flightpower.flight.messages import OK, Imu, Status
from flightpower.flight.units import GRAVITY_MPS2

SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG, ACCEL_CONFIG_2 = 0x19, 0x1A, 0x1B, 0x1C, 0x1D  # [4.4 to 4.8]
FIFO_EN, INT_PIN_CFG, ACCEL_XOUT_H = 0x23, 0x37, 0x3B  # [4.13, 4.20, 4.23]
USER_CTRL, PWR_MGMT_1, FIFO_COUNTH, FIFO_R_W, WHO_AM_I = 0x6A, 0x6B, 0x72, 0x74, 0x75  # [4.33 to 4.38]

IDENTITIES = (0x71, 0x73)  # MPU-9250 [4.38] and MPU-9255, which have the same registers
H_RESET, CLOCK_AUTO = 0x80, 0x01
FIFO_ON, FIFO_RESET = 0x40, 0x04
FIFO_ALL = 0x80 | 0x70 | 0x08  # temperature, gyroscope x y z, accelerometer
STOP_WHEN_FULL = 0x40  # CONFIG: new samples do not overwrite old ones
BYPASS = 0x02

RESET_S = 0.1  # after H_RESET; not in the datasheet, 100 ms is usual in drivers
GYRO_START_S = 0.05  # 35 ms typical from sleep (PS 3.1)
FIFO_BYTES = 512
SAMPLE = struct.Struct(">7h")  # accelerometer x y z, temperature, gyroscope x y z, in the registers' order
CHANNELS = range(7)
SAMPLE_RATE_HZ = 200.0
SAMPLE_RATE_DIVIDER = 4  # 1 kHz / (1 + 4) [4.4]

# DLPF_CFG, A_DLPF_CFG and their delays [4.5, 4.8]. The pairs are chosen so that both delays agree within about 2 ms.
FIFO_FILTERS = (4, 3)  # gyroscope 20 Hz, accelerometer 41 Hz
FIFO_FILTER_DELAYS_S = (9.90e-3, 11.80e-3)
SINGLE_FILTERS = (6, 5)  # gyroscope 5 Hz, accelerometer 10 Hz: single samples need narrow filters
SINGLE_FILTER_DELAYS_S = (33.48e-3, 35.70e-3)

RANGES_G = {2: 0, 4: 1, 8: 2, 16: 3}
RANGES_DPS = {250: 0, 500: 1, 1000: 2, 2000: 3}
COUNTS_PER_DPS = {250: 131.0, 500: 65.5, 1000: 32.8, 2000: 16.4}  # PS 3.1
TEMPERATURE_COUNTS_PER_K, TEMPERATURE_ZERO_K = 333.87, 294.15  # PS 3.4.2: 21 degC
FULL_COUNT = 32767

FROM_RATE, SETTINGS = bytes([SMPLRT_DIV]), 5  # first register of rate, filters and ranges, and their number
AUDIT_TICKS = 50  # in one of these ticks FIFO_EN is read as well, in another the bypass instead
MOST_RESTORED = 3  # successive restorations after which the part is taken not to keep its settings
COMPLAINT_NS = 6_000_000_000  # a lost setting is reported for this long: longer than the spacing of a sensor's events
COUNT_TOLERANCE = 2  # number of samples: the thread may wait between the start of the tick and the transfer
TEMPERATURE_STEP, TEMPERATURE_PER_S = 2 * TEMPERATURE_COUNTS_PER_K, 0.02 * TEMPERATURE_COUNTS_PER_K  # warming up
BELIEVED_AFTER = 25  # number of readings of another temperature; damage to a burst never repeats exactly
# A sample is damaged if it lies this many counts, and this many times their spread, beyond the tick's other samples: a
# real change that passes the low-pass filters lasts for several samples.
OUTLIER_COUNTS, OUTLIER_SPREADS, FEWEST_JUDGED = 128, 4, 4


class Ranges(NamedTuple):
    """Measuring ranges: of specific force [g] and of angular rate [deg/s], to each side of 0."""

    g: int = 8
    dps: int = 500


class Counts(NamedTuple):
    """One sample, or the mean of several, in chip axes."""

    samples: int
    values: tuple[float, ...]  # (7,) as in SAMPLE
    saturated: bool
    damaged: bool = False  # whether one sample does not fit the others


SPARE_SAMPLES = 1  # extra samples read a tick until the FIFO is empty


class MPU9250Driver:
    """The part on `bus` at `address`. axes: mounting of the chip, see `daq.sensors.axes`. topic: the topic that it
    writes. Only the first IMU's magnetometer can be reached, because all of them answer at the same address.

    period_s: tick period. If it is given, a FIFO that has grown while the bus was held up is read in parts, one per
    tick: a complete read would take so long that the next tick would also be missed, and the FIFO would grow again.
    """

    def __init__(
        self,
        bus: I2CBus,
        address: int = 0x68,
        *,
        ranges: Ranges = Ranges(),
        fifo: bool = True,
        axes: Axes = BODY_AXES,
        period_s: float | None = None,
        topic: str = "/imu",
    ):
        self._bus, self._address = bus, address
        self._ranges = ranges
        self._fifo = fifo
        self._mps2_per_count, self._radps_per_count = accel_scale_mps2(ranges.g), gyro_scale_radps(ranges.dps)
        self._axes = axes
        self._topic = topic
        self._most_bytes = FIFO_BYTES
        if period_s is not None:
            self._most_bytes = SAMPLE.size * (math.ceil(SAMPLE_RATE_HZ * period_s) + SPARE_SAMPLES)
        self._partial_sample = False  # whether a failed burst may have left part of a sample at the FIFO's head
        gyro_filter, accel_filter = FIFO_FILTERS if fifo else SINGLE_FILTERS
        self._settings = bytes(  # values of the registers from SMPLRT_DIV on
            [
                SAMPLE_RATE_DIVIDER if fifo else 0,
                STOP_WHEN_FULL | gyro_filter,
                RANGES_DPS[ranges.dps] << 3,
                RANGES_G[ranges.g] << 3,
                accel_filter,
            ]
        )
        self._bypass = BYPASS if topic == Imu.topics[0] else 0
        self._reads = 0
        self._restored = 0  # number of successive restorations
        self._read_ns: int | None = None  # time of the FIFO's last good read, and the size left in it [bytes]
        self._left = 0
        self._temperature = SlowValue(TEMPERATURE_STEP, TEMPERATURE_PER_S, BELIEVED_AFTER)
        self._complaint_ns = -COMPLAINT_NS
        self.complaint = ""

    def start(self) -> Iterator[float]:
        """Reset, identify and configure. Raises SensorFailure for another part or a refused setting."""
        identity = self._bus.write_read(self._address, bytes([WHO_AM_I]), 1)[0]
        if identity not in IDENTITIES:
            raise wrong_device("MPU-9250", f"WHO_AM_I is 0x{identity:02x}")
        self._write(PWR_MGMT_1, H_RESET)
        yield RESET_S
        self._write(PWR_MGMT_1, CLOCK_AUTO)
        self._write(SMPLRT_DIV, *self._settings)
        self._write(INT_PIN_CFG, self._bypass)
        yield GYRO_START_S
        if self._lost_settings(SMPLRT_DIV, self._settings):
            raise SensorFailure(Status.FAULT, "MPU-9250 does not keep its settings")
        if self._fifo:
            self._write(FIFO_EN, FIFO_ALL)
            self._restart_fifo()

    def read(self, now_ns: int) -> list[Sample]:
        """Mean of the FIFO's samples since the last tick, or one sample. The message has the number of samples and the
        delay.

        The status is `fault` if the part had lost its settings; they are restored for the next tick.
        """
        message = self._read_fifo(now_ns) if self._fifo else self._read_once(now_ns)
        if self.complaint and now_ns - self._complaint_ns >= COMPLAINT_NS:
            self.complaint = ""
        if not self._audited(now_ns):
            message = Imu(status=Status.FAULT)
        return [Sample(self._topic, now_ns, message)]

    def _audited(self, now_ns: int) -> bool:
        """Whether this tick's samples have the right settings. Lost settings are restored."""
        self._reads += 1
        in_turn = self._reads % AUDIT_TICKS
        turn_of_fifo = self._fifo and in_turn == AUDIT_TICKS // 2
        if in_turn and not turn_of_fifo and self._bus.write_read(self._address, FROM_RATE, SETTINGS) == self._settings:
            self._restored = 0
            return True  # nearly always
        if in_turn == 0:
            if self._lost_settings(INT_PIN_CFG, bytes([self._bypass])):
                self._write(INT_PIN_CFG, self._bypass)
                self._complain("bypass to the magnetometer", now_ns)
            return True
        expected = self._settings + bytes(FIFO_EN - SMPLRT_DIV - len(self._settings)) + bytes([FIFO_ALL])
        if not self._lost_settings(SMPLRT_DIV, expected if turn_of_fifo else self._settings):
            self._restored = 0
            return True
        if not self._fifo:
            raise brown_out("MPU-9250")
        self._restored += 1
        if self._restored > MOST_RESTORED:
            raise SensorFailure(Status.FAULT, "MPU-9250 does not keep its settings")
        self._write(SMPLRT_DIV, *self._settings)
        self._write(FIFO_EN, FIFO_ALL)
        self._restart_fifo()
        self._complain("ranges, filters or rate", now_ns)
        return False

    def _lost_settings(self, register: int, expected: bytes) -> bool:
        """Whether the registers from `register` on differ from `expected`; if they do, they are read a second time."""
        length = len(self._settings)
        for _ in range(2):
            registers = self._bus.write_read(self._address, bytes([register]), len(expected))
            if registers == expected or (registers[:length] == expected[:length] and registers[-1] == expected[-1]):
                return False  # reserved registers in between may hold any value
        return True

    def _complain(self, what: str, now_ns: int) -> None:
        self._complaint_ns = now_ns
        self.complaint = f"lost its settings ({what}), which were restored: check its supply for interruptions"

    def _read_once(self, now_ns: int) -> Imu:
        counts = mean(self._bus.write_read(self._address, bytes([ACCEL_XOUT_H]), SAMPLE.size))
        return self._message(counts, *SINGLE_FILTER_DELAYS_S, now_ns)

    def _read_fifo(self, now_ns: int) -> Imu:
        # Read USER_CTRL to FIFO_COUNTL in one transfer: the settings read with the count reveal a loss of supply, or a
        # different part.
        block = self._bus.write_read(self._address, bytes([USER_CTRL]), FIFO_COUNTH + 2 - USER_CTRL)
        if (block[0], block[1]) != (FIFO_ON, CLOCK_AUTO):  # USER_CTRL, PWR_MGMT_1 lost, or a wrong bit in the reply
            block = self._bus.write_read(self._address, bytes([USER_CTRL]), FIFO_COUNTH + 2 - USER_CTRL)
            if (block[0], block[1]) != (FIFO_ON, CLOCK_AUTO):
                raise brown_out("MPU-9250")
        if self._partial_sample:
            self._restart_fifo()
            return Imu(status=Status.STALE)
        waiting = int.from_bytes(block[-2:], "big") & 0x1FFF
        if self._read_ns is not None:
            filled = (now_ns - self._read_ns) * 1e-9 * SAMPLE_RATE_HZ + self._left // SAMPLE.size
            if abs(waiting // SAMPLE.size - filled) > COUNT_TOLERANCE:  # a wrong bit in the count, or a late thread
                waiting = int.from_bytes(self._bus.write_read(self._address, bytes([FIFO_COUNTH]), 2), "big") & 0x1FFF
        if waiting > FIFO_BYTES - SAMPLE.size:  # full: samples were lost, and the time of the others is unknown
            self._restart_fifo()
            return Imu(status=Status.CORRUPT)
        if waiting < SAMPLE.size:
            return Imu(status=Status.STALE)
        size = min(waiting - waiting % SAMPLE.size, self._most_bytes)
        newer = waiting // SAMPLE.size - size // SAMPLE.size  # samples that wait for the next tick
        self._partial_sample = True
        data = self._bus.write_read(self._address, bytes([FIFO_R_W]), size)
        left = int.from_bytes(self._bus.write_read(self._address, bytes([FIFO_COUNTH]), 2), "big") & 0x1FFF
        if left >= FIFO_BYTES - size:  # it may have been full before; the burst then began inside a sample
            self._restart_fifo()
            return Imu(status=Status.CORRUPT)
        self._partial_sample = False
        self._read_ns, self._left = now_ns, waiting - size
        counts = mean(data)
        mean_s = (counts.samples / 2 + newer) / SAMPLE_RATE_HZ
        gyroscope_s, accelerometer_s = FIFO_FILTER_DELAYS_S
        return self._message(counts, gyroscope_s + mean_s, accelerometer_s + mean_s, now_ns)

    def _message(self, counts: Counts, gyroscope_s: float, accelerometer_s: float, now_ns: int) -> Imu:
        """The message of these counts, with the delays of both sensors; `corrupt` if they were damaged in transfer."""
        ax, ay, az, temperature, gx, gy, gz = counts.values
        if not self._temperature.fits(temperature, now_ns) or (counts.damaged and not counts.saturated):
            return Imu(status=Status.CORRUPT)
        per_mps2, per_radps = self._mps2_per_count, self._radps_per_count
        fx, fy, fz = to_body_axes((ax * per_mps2, ay * per_mps2, az * per_mps2), self._axes)
        p, q, r = to_body_axes((gx * per_radps, gy * per_radps, gz * per_radps), self._axes)
        return Imu(
            status=Status.SATURATED if counts.saturated else OK,
            samples=counts.samples,
            group_delay_s=gyroscope_s,
            specific_force_group_delay_s=accelerometer_s,
            accel_x_counts=ax,
            accel_y_counts=ay,
            accel_z_counts=az,
            gyro_x_counts=gx,
            gyro_y_counts=gy,
            gyro_z_counts=gz,
            temperature_counts=temperature,
            specific_force_x_mps2=fx,
            specific_force_y_mps2=fy,
            specific_force_z_mps2=fz,
            angular_rate_x_radps=p,
            angular_rate_y_radps=q,
            angular_rate_z_radps=r,
            temperature_K=temperature / TEMPERATURE_COUNTS_PER_K + TEMPERATURE_ZERO_K,
        )

    def _restart_fifo(self) -> None:
        self._write(USER_CTRL, FIFO_RESET)
        self._write(USER_CTRL, FIFO_ON)
        self._partial_sample = False
        self._read_ns = None

    def _write(self, register: int, *values: int) -> None:
        self._bus.write(self._address, bytes([register, *values]))


def mean(data: bytes) -> Counts:
    """Mean of whole samples (14 bytes each), and whether any of them reached the end of the range."""
    count = len(data) // SAMPLE.size
    values = struct.unpack(f">{count * len(CHANNELS)}h", data)
    columns = [values[channel :: len(CHANNELS)] for channel in CHANNELS]
    # A tuple from a generator is avoided: Python over-allocates and shrinks it, and keeps up to 2,000 freed tuples.
    means = [sum(column) / count for column in columns]
    saturated = max(values) >= FULL_COUNT or min(values) <= -FULL_COUNT  # temperature is included
    if saturated:
        saturated = any(max(map(abs, column)) >= FULL_COUNT for column in columns[:3] + columns[4:])
    damaged = False
    if count >= FEWEST_JUDGED:
        for column in columns:
            if max(column) - min(column) > OUTLIER_COUNTS and has_outlier(column):
                damaged = True
    return Counts(count, tuple(means), saturated, damaged)


def has_outlier(column: Sequence[int]) -> bool:
    """Whether one sample is far from all others, as after a flipped bit."""
    lowest, low, *_, high, highest = sorted(column)
    return any(
        step > OUTLIER_COUNTS and step > OUTLIER_SPREADS * spread
        for step, spread in ((low - lowest, highest - low), (highest - high, high - lowest))
    )


def accel_scale_mps2(range_g: int) -> float:
    """Specific force of one count [m/s^2] in the +-`range_g` range (PS 3.2)."""
    return range_g / 2 / 16384 * GRAVITY_MPS2


def gyro_scale_radps(range_dps: int) -> float:
    """Angular rate of one count [rad/s] in the +-`range_dps` range (PS 3.1)."""
    return math.radians(1 / COUNTS_PER_DPS[range_dps])
