"""When the daemon reads each part of the default tray, for `hw_fakes.direct_log`."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flight.messages import Message

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

TICK_NS = 40_000_000
FIRST_TICK = 50
I2C_BYTE_NS = 22_500  # nine bits at 400 kHz
SECOND_NS = 1_000_000_000
# The MPU-9250 samples at 200 Hz from when its settings are written, in the fourth tick.
IMU_SINCE_NS, IMU_RATE_HZ = 120_225_000, 200.0


class Compensation(NamedTuple):
    """What the driver makes of a barometer's counts."""

    decoded: Callable[[int, float], tuple[float, float]]  # temperature [0.01 degC] and pressure [Pa] from (D1, D2)
    trend: Callable[[], Any]  # its extrapolation of D2: add(time_ns, D2), at(time_ns)


def seconds(ns: Any) -> Array:
    return np.asarray(ns, dtype=np.float64) * 1e-9


class TimedMessage(NamedTuple):
    tick: int
    time_ns: int  # since the start
    topic: str
    message: Message


class ReadTimes:
    """The time at which each part is read in each tick [ns since the start], (n,): one after the other on the bus."""

    def __init__(self, duration_s: float, imu_clock_error: float):
        self.tick_ns: Ints = np.arange(int(np.ceil(duration_s * 1e9 / TICK_NS)), dtype=np.int64) * TICK_NS
        self.imu_period_ns = 1e9 / IMU_RATE_HZ / (1 + imu_clock_error)
        done = np.maximum(self.tick_ns - IMU_SINCE_NS, 0) / self.imu_period_ns
        self.imu_done: Ints = done.astype(np.int64)  # samples so far
        taken = np.diff(self.imu_done, prepend=0)
        # Status, count and identity registers; the samples; the count again; each with addresses and register.
        self.mag = self.tick_ns + (13 + 3 + 14 * taken + 5) * I2C_BYTE_NS
        self.baro = self.mag + 12 * I2C_BYTE_NS
        self.static = self.baro + 8 * I2C_BYTE_NS
        self.alpha = self.static + 8 * I2C_BYTE_NS
        self.beta = self.alpha + 5 * I2C_BYTE_NS
        self.airspeed = self.beta + 5 * I2C_BYTE_NS
        self.serial = self.airspeed + 5 * I2C_BYTE_NS

    def ticks(self) -> range:
        return range(FIRST_TICK, len(self.tick_ns))
