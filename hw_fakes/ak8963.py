"""A fake Asahi Kasei AK8963, the magnetometer in the MPU-9250, with its own small register map.

Sections are those of the AK8963 datasheet (MS1356-E-02). Its axes differ from those of the accelerometer and
gyroscope: x and y are exchanged and z is reversed (PS-MPU-9250A-01 sec. 9.1).
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.arrays import Array
from flightpower.hw_fakes.sample_blocks import SampleBlocks
from flightpower.sim.sensor_truth import SensorTruth

# Registers (sec. 8.1).
WIA, INFO, ST1, HXL, HZH, ST2, CNTL1, CNTL2, ASTC, ASAX, ASAZ = (
    0x00,
    0x01,
    0x02,
    0x03,
    0x08,
    0x09,
    0x0A,
    0x0B,
    0x0C,
    0x10,
    0x12,
)
RESET_VALUES = {WIA: 0x48, INFO: 0x9A}
WRITABLE = frozenset([CNTL1, CNTL2, ASTC])

DRDY, DOR = 0x01, 0x02  # ST1
HOFL, BITM = 0x08, 0x10  # ST2
OUTPUT_16_BIT, SOFT_RESET = 0x10, 0x01  # CNTL1, CNTL2
POWER_DOWN, SINGLE, CONTINUOUS_8_HZ, CONTINUOUS_100_HZ, FUSE_ROM = 0x0, 0x1, 0x2, 0x6, 0xF
PERIOD_NS = {CONTINUOUS_8_HZ: 125_000_000, CONTINUOUS_100_HZ: 10_000_000}
MEASUREMENT_NS = 7_200_000  # typical time for one measurement (sec. 5.3.2)
MODE_WAIT_NS = 100_000  # time in power-down before the next mode (sec. 6.3)

FULL_SCALE_T, FULL_SCALE_COUNTS = 4912e-6, 32760  # at 16 bits (sec. 8.3.4)
COUNTS_14_BIT = 8190
BODY_TO_CHIP = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])


def sensitivity(adjustment: NDArray[np.integer]) -> Array:
    """Factors of the counts from the adjustment in the fuse ROM (sec. 8.3.11), (3,)."""
    return np.asarray((adjustment - 128) * 0.5 / 128 + 1)


def counts(field_T: Array, adjustment: NDArray[np.integer], full_scale: int = FULL_SCALE_COUNTS) -> NDArray[np.int64]:
    """Counts (n, 3) in the chip's axes for the flux density in body axes (n, 3)."""
    counts: Array = np.rint(field_T @ BODY_TO_CHIP.T / (FULL_SCALE_T / full_scale) / sensitivity(adjustment))
    return np.clip(counts, -full_scale, full_scale).astype(int)


class FakeAK8963:
    """The part at 0x0C, behind `hw_fakes.mpu9250.FakeMPU9250`. seed: draws the sensitivities in the fuse ROM.

    A change of mode that does not pass through 100 us of power-down is ignored; the datasheet forbids it and does not
    state the effect.
    """

    def __init__(self, sensor_truth: SensorTruth, now_ns: Callable[[], int], seed: int, powered_ns: int = 0):
        self._sensor_truth = sensor_truth
        self._now_ns = now_ns
        self.adjustment = np.random.default_rng(seed).integers(160, 192, 3)  # typical of real parts
        self.power_cycle(powered_ns)

    def power_cycle(self, at_ns: int) -> None:
        """Switch the supply off and on: registers return to their defaults, in power-down mode."""
        self._registers = bytearray(0x13)
        for address, value in RESET_VALUES.items():
            self._registers[address] = value
        self._pointer = 0
        self._mode_since_ns = at_ns - MODE_WAIT_NS
        self._done = 0
        self._locked = False

    def write(self, data: bytes) -> None:
        if not data:
            return
        self._catch_up(self._now_ns())
        self._pointer = data[0]
        for value in data[1:]:
            self._write_register(self._pointer, value)
            self._advance_pointer()

    def read(self, count: int) -> bytes:
        self._catch_up(self._now_ns())
        reply = bytearray()
        for _ in range(count):
            reply.append(self._read_register(self._pointer))
            self._advance_pointer()
        return bytes(reply)

    def write_read(self, data: bytes, count: int) -> bytes:
        self.write(data)
        return self.read(count)

    def _advance_pointer(self) -> None:
        """Advance the register pointer within one of two rings, 00h to 0Ch and 10h to 12h (sec. 7.2.2)."""
        if self._pointer == ASTC:
            self._pointer = WIA
        elif self._pointer == ASAZ:
            self._pointer = ASAX
        else:
            self._pointer += 1

    @property
    def _mode(self) -> int:
        return self._registers[CNTL1] & 0x0F

    def _write_register(self, address: int, value: int) -> None:
        if address not in WRITABLE:
            return
        now_ns = self._now_ns()
        if address == CNTL2 and value & SOFT_RESET:
            self.power_cycle(now_ns)
        elif address == CNTL1:
            mode = value & 0x0F
            waited = self._mode == POWER_DOWN and now_ns - self._mode_since_ns >= MODE_WAIT_NS
            if mode == POWER_DOWN or mode == self._mode or waited:
                self._enter(value, now_ns)
        else:
            self._registers[address] = value

    def _enter(self, control: int, now_ns: int) -> None:
        self._registers[CNTL1] = control & 0x1F
        self._mode_since_ns = now_ns
        self._done = 0
        self._locked = False
        if self._mode in PERIOD_NS or self._mode == SINGLE:
            period_s = PERIOD_NS.get(self._mode, MEASUREMENT_NS) * 1e-9
            self._blocks = SampleBlocks(self._measure, period_s, now_ns * 1e-9 + MEASUREMENT_NS * 0.5e-9, length=64)

    def _read_register(self, address: int) -> int:
        if ASAX <= address <= ASAZ:
            return int(self.adjustment[address - ASAX]) if self._mode == FUSE_ROM else 0
        if address >= len(self._registers):
            return 0
        value = self._registers[address]
        if HXL <= address <= ST2:  # reading clears both; data stay protected until ST2 is read (sec. 6.4.3)
            self._registers[ST1] &= ~(DRDY | DOR)
            self._locked = address != ST2
        return value

    def _catch_up(self, now_ns: int) -> None:
        """Finish the measurements that ended since the last access."""
        since_ns = now_ns - self._mode_since_ns - MEASUREMENT_NS
        if since_ns < 0:
            return
        if self._mode == SINGLE:
            self._store(0)
            self._registers[CNTL1] &= ~0x0F
            self._mode_since_ns = now_ns
        elif self._mode in PERIOD_NS:
            done = since_ns // PERIOD_NS[self._mode] + 1
            if done > self._done:
                skipped = done > self._done + 1 or bool(self._registers[ST1] & DRDY)
                self._done = done
                if self._locked:
                    return
                self._registers[ST1] |= DOR if skipped else 0
                self._store(done - 1)

    def _store(self, index: int) -> None:
        counts, overflow = np.split(self._blocks.row(index), [3])
        self._registers[HXL : HZH + 1] = counts.astype("<i2").tobytes()
        self._registers[ST2] = (HOFL if overflow[0] else 0) | (BITM if self._registers[CNTL1] & OUTPUT_16_BIT else 0)
        self._registers[ST1] |= DRDY

    def _measure(self, t_s: Array) -> np.ndarray:
        """Counts x y z and the overflow flag (n, 4); sec. 8.3.4, 8.3.5 and the adjustment of sec. 8.3.11."""
        limit = FULL_SCALE_COUNTS if self._registers[CNTL1] & OUTPUT_16_BIT else COUNTS_14_BIT
        field_T = self._sensor_truth.magnetic_field_T(t_s)
        overflow = np.abs(field_T).sum(axis=1) >= FULL_SCALE_T
        return np.column_stack([counts(field_T, self.adjustment, limit), overflow])
