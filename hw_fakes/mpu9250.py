"""A fake InvenSense MPU-9250: accelerometer, gyroscope, thermometer and FIFO behind a register map.

Sections are those of the register map RM-MPU-9250A-00 (rev. 1.4) and of the product specification PS-MPU-9250A-01.
Bias, noise and misalignment are in the simulator's sensor inputs; range, quantization, saturation and the digital
low-pass filter are modeled here. The filter works on inputs every millisecond, before the divider selects some of its
outputs: vibration above half the divided rate is aliased into the samples, attenuated by the filter.

The chip's axes are the body's (x forward, y right, z down: mounted with its top to the ground).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import GRAVITY_MPS2
from flightpower.hw_fakes.i2c import no_acknowledge
from flightpower.hw_fakes.sample_blocks import SampleBlocks
from flightpower.sim.sensor_truth import SensorTruth

# Register addresses (RM sec. 3).
SELF_TEST_X_GYRO, SELF_TEST_X_ACCEL = 0x00, 0x0D
SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG, ACCEL_CONFIG_2 = 0x19, 0x1A, 0x1B, 0x1C, 0x1D
FIFO_EN, INT_PIN_CFG, INT_STATUS = 0x23, 0x37, 0x3A
ACCEL_XOUT_H, GYRO_ZOUT_L, EXT_SENS_DATA_23 = 0x3B, 0x48, 0x60
USER_CTRL, PWR_MGMT_1, PWR_MGMT_2 = 0x6A, 0x6B, 0x6C
FIFO_COUNTH, FIFO_COUNTL, FIFO_R_W, WHO_AM_I = 0x72, 0x73, 0x74, 0x75
REGISTER_COUNT = 128

# "The reset value is 0x00 for all registers other than: register 107 (0x01), register 117 (0x71)" (RM sec. 3).
RESET_VALUES = {PWR_MGMT_1: 0x01, WHO_AM_I: 0x71}

READ_ONLY = frozenset([INT_STATUS, *range(ACCEL_XOUT_H, EXT_SENS_DATA_23 + 1), FIFO_COUNTH, FIFO_COUNTL, WHO_AM_I])

# Bits.
FIFO_MODE_STOP = 0x40  # CONFIG: when the FIFO is full, new samples are dropped rather than the oldest
BYPASS_EN = 0x02  # INT_PIN_CFG
INT_FIFO_OVERFLOW, INT_RAW_DATA_READY = 0x10, 0x01  # INT_STATUS
USER_FIFO_EN, USER_I2C_MST_EN, USER_FIFO_RST, USER_SELF_CLEARING = 0x40, 0x20, 0x04, 0x07
H_RESET, SLEEP = 0x80, 0x40  # PWR_MGMT_1

FIFO_SIZE = 512  # bytes
# Columns of a sample [ax ay az, temperature, gx gy gz] by FIFO_EN bit (RM sec. 4.13), in the order of storage.
FIFO_COLUMNS = ((0x08, (0, 1, 2)), (0x80, (3,)), (0x40, (4,)), (0x20, (5,)), (0x10, (6,)))

ACCEL_COUNTS_PER_G = (16384, 8192, 4096, 2048)  # PS sec. 3.2, by ACCEL_FS_SEL
GYRO_COUNTS_PER_DPS = (131, 65.5, 32.8, 16.4)  # PS sec. 3.1, by GYRO_FS_SEL
TEMPERATURE_COUNTS_PER_K, TEMPERATURE_ZERO_K = 333.87, 273.15 + 21  # PS sec. 3.4.2
# Corner frequency [Hz] (None: above the sampling rate) and delay [s] of filters, by DLPF_CFG and A_DLPF_CFG.
# The gyroscope's delays equal the delay of a first-order low-pass at the corner plus 2 ms, within 0.4 ms; this is the
# model here. The accelerometer's delays exceed it by more; the datasheet does not explain why.
GYRO_FILTERS = (
    (None, 0.97e-3),
    (184.0, 2.9e-3),
    (92.0, 3.9e-3),
    (41.0, 5.9e-3),
    (20.0, 9.9e-3),
    (10.0, 17.85e-3),
    (5.0, 33.48e-3),
    (None, 0.17e-3),
)  # RM sec. 4.5
GYRO_WITHOUT_FILTER = (None, 0.064e-3)
ACCEL_FILTERS = (
    (460.0, 1.94e-3),
    (184.0, 5.80e-3),
    (92.0, 7.80e-3),
    (41.0, 11.80e-3),
    (20.0, 19.80e-3),
    (10.0, 35.70e-3),
    (5.0, 66.96e-3),
    (460.0, 1.88e-3),
)  # RM sec. 4.7
ACCEL_WITHOUT_FILTER = (None, 0.75e-3)
INTERNAL_RATE_HZ = 1e3  # rate of the filters
WARM_UP = 10  # number of time constants after which the filter's initial value still has a weight of 5e-5

START_UP_NS = 11_000_000  # time until registers can be read and written (PS sec. 3.3.2, typical)
GYRO_START_UP_S = 35e-3  # time from sleep (PS sec. 3.1), during which the outputs read zero
CLOCK_TOLERANCE = 0.01  # of the sample rate with the gyroscope's oscillator (PS sec. 3.4.2)


class Sampling(NamedTuple):
    """How samples are made: corner and delay of each filter, size of each count, filter outputs per sample."""

    gyro: tuple[float | None, float]
    accel: tuple[float | None, float]
    gyro_count_radps: float
    accel_count_mps2: float
    stride: int


def gyro_count_radps(full_scale: int) -> float:
    """Size of a count [rad/s] at a value of GYRO_FS_SEL."""
    return float(np.deg2rad(1 / GYRO_COUNTS_PER_DPS[full_scale]))


def accel_count_mps2(full_scale: int) -> float:
    """Size of a count [m/s^2] at a value of ACCEL_FS_SEL."""
    return GRAVITY_MPS2 / ACCEL_COUNTS_PER_G[full_scale]


def counts(sensor_truth: SensorTruth, t_s: Array, period_s: float, sampling: Sampling) -> NDArray[np.int64]:
    """Counts (n, 7) of samples at t (n,), `period_s` apart: specific force x y z, temperature, angular rate x y z."""
    n, stride = len(t_s), sampling.stride
    step_s = period_s / stride
    inside_s = t_s[0] + np.arange(1 - stride, (n - 1) * stride + 1) * step_s
    accel, gyro = LowPass(*sampling.accel, step_s, stride), LowPass(*sampling.gyro, step_s, stride)
    accel_s, gyro_s = accel.input_times(inside_s), gyro.input_times(inside_s)
    force, rate = sensor_truth.imu(np.concatenate([accel_s, gyro_s]))
    values = np.empty((n, 7))
    values[:, 0:3] = accel.filtered(force[: len(accel_s)])[stride - 1 :: stride] / sampling.accel_count_mps2
    values[:, 3] = (sensor_truth.imu_temperature_K(t_s) - TEMPERATURE_ZERO_K) * TEMPERATURE_COUNTS_PER_K
    values[:, 4:7] = gyro.filtered(rate[len(accel_s) :])[stride - 1 :: stride] / sampling.gyro_count_radps
    return np.clip(np.rint(values), -32768, 32767).astype(int)


class FakeMPU9250:
    """The part at its address; `bypass` says whether the magnetometer inside is on the outer bus.

    now_ns: gives the time since the start of `sensor_truth` [ns]. seed: draws factory trim and clock error.
    powered_ns: when its supply came on, on that clock.
    """

    def __init__(self, sensor_truth: SensorTruth, now_ns: Callable[[], int], seed: int, powered_ns: int = 0):
        self._sensor_truth = sensor_truth
        self._now_ns = now_ns
        draw = np.random.default_rng(seed)
        self._factory_trim = draw.integers(0x40, 0xC0, 6, dtype=np.uint8)
        self.clock_error = draw.uniform(-CLOCK_TOLERANCE, CLOCK_TOLERANCE)
        self.power_cycle(powered_ns)

    def power_cycle(self, at_ns: int) -> None:
        """Switch the supply off and on: registers return to their defaults; nothing acknowledges during start-up."""
        self._registers = bytearray(REGISTER_COUNT)
        self._ready_ns = at_ns + START_UP_NS
        self._reset(self._ready_ns)

    @property
    def bypass(self) -> bool:
        """Whether the auxiliary bus is joined to the main one (RM sec. 4.20, 4.33)."""
        return bool(self._registers[INT_PIN_CFG] & BYPASS_EN) and not self._registers[USER_CTRL] & USER_I2C_MST_EN

    def write(self, data: bytes) -> None:
        now_ns = self._awake_ns()
        if not data:
            return
        self._pointer = data[0] % REGISTER_COUNT
        for value in data[1:]:
            self._write_register(self._pointer, value, now_ns)
            self._advance_pointer()

    def read(self, count: int) -> bytes:
        self._catch_up(self._awake_ns())
        reply = bytearray()
        while len(reply) < count:
            if self._pointer == FIFO_R_W:  # the pointer stays, so a burst empties the FIFO (RM sec. 4.35)
                reply += self._read_fifo(count - len(reply))
            else:
                reply.append(self._read_register(self._pointer))
                self._advance_pointer()
        return bytes(reply)

    def write_read(self, data: bytes, count: int) -> bytes:
        self.write(data)
        return self.read(count)

    # --- registers ---

    def _awake_ns(self) -> int:
        now_ns = self._now_ns()
        if now_ns < self._ready_ns:
            raise no_acknowledge()
        return now_ns

    def _advance_pointer(self) -> None:
        if self._pointer != FIFO_R_W:
            self._pointer = (self._pointer + 1) % REGISTER_COUNT

    def _reset(self, now_ns: int) -> None:
        self._registers[:] = bytes(REGISTER_COUNT)
        for address, value in RESET_VALUES.items():
            self._registers[address] = value
        self._registers[SELF_TEST_X_GYRO : SELF_TEST_X_GYRO + 3] = self._factory_trim[:3].tobytes()
        self._registers[SELF_TEST_X_ACCEL : SELF_TEST_X_ACCEL + 3] = self._factory_trim[3:].tobytes()
        self._pointer = 0
        self._fifo = bytearray()
        self._last_fifo_byte = 0
        self._gyro_ready_s = now_ns * 1e-9 + GYRO_START_UP_S
        self._restart_sampling(now_ns)

    def _write_register(self, address: int, value: int, now_ns: int) -> None:
        self._catch_up(now_ns)  # first compute the samples up to now, with the old settings
        if address in READ_ONLY:
            return
        before = self._registers[address]
        if address == PWR_MGMT_1 and value & H_RESET:
            self._reset(now_ns)
            self._ready_ns = now_ns + START_UP_NS
            return
        if address == USER_CTRL:
            if value & USER_FIFO_RST:
                self._fifo.clear()
            value &= ~USER_SELF_CLEARING
        if address == FIFO_R_W:
            self._fifo.append(value)
            return
        self._registers[address] = value
        if address == PWR_MGMT_1 and before & SLEEP and not value & SLEEP:
            self._gyro_ready_s = now_ns * 1e-9 + GYRO_START_UP_S
        if address in (SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG, ACCEL_CONFIG_2, PWR_MGMT_1, PWR_MGMT_2):
            self._restart_sampling(now_ns)

    def _read_register(self, address: int) -> int:
        if address == FIFO_COUNTH:  # reading the high byte latches both (RM sec. 4.34)
            self._latched_count = len(self._fifo)
            return self._latched_count >> 8
        if address == FIFO_COUNTL:
            return self._latched_count & 0xFF
        value = self._registers[address]
        if address == INT_STATUS:  # cleared by reading (RM sec. 4.23)
            self._registers[INT_STATUS] = 0
        return value

    def _read_fifo(self, count: int) -> bytes:
        taken = bytes(self._fifo[:count])
        del self._fifo[:count]
        if taken:
            self._last_fifo_byte = taken[-1]
        return taken + bytes([self._last_fifo_byte]) * (count - len(taken))  # an empty FIFO repeats the last byte

    # --- sampling ---

    def _restart_sampling(self, now_ns: int) -> None:
        self._origin_ns = now_ns
        self._period_ns = 1e9 / self._sample_rate_Hz() / (1 + self.clock_error)
        self._done = 0  # number of samples since the origin
        self._latched_count = len(self._fifo)
        period_s = self._period_ns * 1e-9
        self._blocks = SampleBlocks(self._sample, period_s, now_ns * 1e-9 + period_s)

    def _sample_rate_Hz(self) -> float:
        """Sample rate (RM sec. 4.4 and 4.5): the divider works only on the 1 kHz output of the filters 1 to 6."""
        filter_off = self._registers[GYRO_CONFIG] & 0x03
        dlpf = self._registers[CONFIG] & 0x07
        if filter_off:
            return 32e3
        if dlpf in (0, 7):
            return 8e3
        return 1e3 / (1 + self._registers[SMPLRT_DIV])

    def _catch_up(self, now_ns: int) -> None:
        """Compute the samples since the last access."""
        done = int((now_ns - self._origin_ns) / self._period_ns)
        if done <= self._done or self._registers[PWR_MGMT_1] & SLEEP:
            return
        first, self._done = self._done, done
        self._registers[INT_STATUS] |= INT_RAW_DATA_READY
        columns = [c for bit, cs in FIFO_COLUMNS if self._registers[FIFO_EN] & bit for c in cs]
        if columns and self._registers[USER_CTRL] & USER_FIFO_EN:
            self._fill_fifo(first, done, columns)
        row = self._blocks.row(done - 1)
        self._registers[ACCEL_XOUT_H : GYRO_ZOUT_L + 1] = row.tobytes()

    def _fill_fifo(self, first: int, stop: int, columns: list[int]) -> None:
        sample_bytes = 2 * len(columns)
        at_most = FIFO_SIZE // sample_bytes + 1
        if (stop - first) * sample_bytes + len(self._fifo) > FIFO_SIZE:
            self._registers[INT_STATUS] |= INT_FIFO_OVERFLOW
        if self._registers[CONFIG] & FIFO_MODE_STOP:
            stop = min(stop, first + at_most)
            self._fifo += self._blocks.rows(first, stop)[:, columns].tobytes()
            del self._fifo[FIFO_SIZE:]
        else:
            first = max(first, stop - at_most)
            self._fifo += self._blocks.rows(first, stop)[:, columns].tobytes()
            del self._fifo[:-FIFO_SIZE]  # cut by bytes: the rest need not begin with a whole sample

    def _sample(self, t_s: Array) -> np.ndarray:
        """Counts (n, 7), big-endian: specific force x y z, temperature, angular rate x y z."""
        settings = self._registers_say()
        values = counts(self._sensor_truth, t_s, self._period_ns * 1e-9, settings)
        values[t_s < self._gyro_ready_s, 4:7] = 0
        off = self._registers[PWR_MGMT_2]
        for column, bit in zip((0, 1, 2, 4, 5, 6), (0x20, 0x10, 0x08, 0x04, 0x02, 0x01), strict=True):
            if off & bit:
                values[:, column] = 0
        return values.astype(">i2")

    def _registers_say(self) -> Sampling:
        gyro_config, accel_config, accel_config_2 = (
            self._registers[register] for register in (GYRO_CONFIG, ACCEL_CONFIG, ACCEL_CONFIG_2)
        )
        return Sampling(
            gyro=GYRO_WITHOUT_FILTER if gyro_config & 3 else GYRO_FILTERS[self._registers[CONFIG] & 7],
            accel=ACCEL_WITHOUT_FILTER if accel_config_2 & 0x08 else ACCEL_FILTERS[accel_config_2 & 7],
            gyro_count_radps=gyro_count_radps(gyro_config >> 3 & 3),
            accel_count_mps2=accel_count_mps2(accel_config >> 3 & 3),
            # Filter outputs per sample; 1 at sample rates above 1 kHz.
            stride=max(1, round(INTERNAL_RATE_HZ / self._sample_rate_Hz())),
        )


class LowPass:
    """A first-order low-pass followed by a pure delay; together they have the given delay at low frequency.

    corner_Hz: frequency of -3 dB; None for a pure delay. step_s: time between two of its outputs, of which every
    `stride`-th is a sample.
    """

    def __init__(self, corner_Hz: float | None, delay_s: float, step_s: float, stride: int):
        self._pole = 0.0 if corner_Hz is None else float(np.exp(-2 * np.pi * corner_Hz * step_s))
        self._warm_up = 0 if corner_Hz is None else int(np.ceil(WARM_UP / (2 * np.pi * corner_Hz * step_s))) + stride
        self._step_s = step_s
        # y[k] = p y[k-1] + (1 - p) x[k] follows a ramp p/(1 - p) steps late.
        self._pure_s = delay_s - self._pole / (1 - self._pole) * step_s

    def input_times(self, t_s: Array) -> Array:
        """Times [s] of the inputs needed for outputs at `t_s` (n,), evenly spaced; the warm-up needs more than n."""
        before = t_s[0] + np.arange(-self._warm_up, 0) * self._step_s
        return np.concatenate([before, t_s]) - self._pure_s

    def filtered(self, values: Array) -> Array:
        """Outputs (n, m) for the inputs (k, m) at `input_times`."""
        if not self._warm_up:
            return values
        rest = values[:1] * self._pole
        return np.asarray(lfilter([1 - self._pole], [1.0, -self._pole], values, axis=0, zi=rest)[0])[self._warm_up :]
