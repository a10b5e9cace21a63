"""Fake piezo bridges with a signal conditioner: TE MS4515DO / MS4525DO and Honeywell SSC, which send the same four
bytes.

The bytes hold two bits of status, 14 bits of pressure and 11 bits of temperature (TE "Interfacing to MEAS digital
pressure modules" sec. 2; Honeywell 008201-3-EN). The value is updated every half millisecond; a value that is read
again is marked stale.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.arrays import Array
from flightpower.hw_fakes.i2c import no_acknowledge
from flightpower.hw_fakes.sample_blocks import SampleBlocks
from flightpower.sim.sensor_truth import SensorTruth

Counts = NDArray[np.int64]

FULL_COUNT = 2**14 - 1
UPDATE_NS = 500_000
TEMPERATURE_COUNTS = 2047  # over 200 K from -50 degC
TEMPERATURE_SPAN_K, TEMPERATURE_LOW_K = 200.0, 273.15 - 50.0
NORMAL, STALE, FAULT = 0, 2, 3  # status bits
INCH_OF_WATER_4C_PA = 249.08891  # the datasheets' inH2O refers to 4 degC
BLOCK_LENGTH = 2000  # rows in one second


@dataclass(frozen=True)
class BridgeType:
    """One type of transducer: pressure range and output counts.

    low_counts, high_counts: counts at the ends of the range. first_data_ns: time from power-on to the first data.
    repeated_start_hurts: after a repeated start the part does not acknowledge the next transfer (MS4515DO).
    """

    range_Pa: float
    low_counts: float
    high_counts: float
    first_data_ns: int
    repeated_start_hurts: bool


# TE's type A is 10 to 90 % of 2^14 - 1; Honeywell states transfer function A in counts.
MS4515DO_DS5A002DP = BridgeType(2 * INCH_OF_WATER_4C_PA, 0.1 * FULL_COUNT, 0.9 * FULL_COUNT, 8_400_000, True)
SSCDRRN005ND2A5 = BridgeType(5 * INCH_OF_WATER_4C_PA, 1638, 14746, 5_000_000, False)


def counts(part: BridgeType, pressure_Pa: Array, temperature_K: Array) -> tuple[Counts, Counts]:
    """Counts (n,) of the pressure at port 1 minus port 2, and of the bridge's temperature.

    Pressure beyond the counts is pinned at 0 or 16383.
    """
    fraction = (pressure_Pa + part.range_Pa) / (2 * part.range_Pa)
    pressure = np.rint(part.low_counts + (part.high_counts - part.low_counts) * fraction)
    temperature = np.rint((temperature_K - TEMPERATURE_LOW_K) * TEMPERATURE_COUNTS / TEMPERATURE_SPAN_K)
    return np.clip(pressure, 0, FULL_COUNT).astype(int), np.clip(temperature, 0, TEMPERATURE_COUNTS).astype(int)


def frames(part: BridgeType, pressure_Pa: Array, temperature_K: Array) -> Counts:
    """Frames (n,) as 32-bit words with status 0."""
    pressure, temperature = counts(part, pressure_Pa, temperature_K)
    return pressure << 16 | temperature << 5


class FakeBridge:
    """A transducer at its address.

    which: its name in `sim.sensor_truth.SensorTruth` ("alpha", "beta", "airspeed"). now_ns: gives the time since the
    start of `sensor_truth` [ns]. powered_ns: when its supply came on, on that clock. `fault`, once set, stays until
    `power_cycle`, as in the part. `frozen_ns`, while set, is the time after which there are no updates.
    """

    def __init__(
        self, part: BridgeType, which: str, sensor_truth: SensorTruth, now_ns: Callable[[], int], powered_ns: int = 0
    ):
        def fetch(t_s: Array) -> np.ndarray:
            temperature_K = np.interp(t_s, t_s[[0, -1]], sensor_truth.transducer_temperature_K(which, t_s[[0, -1]]))
            return frames(part, sensor_truth.differential_pressure_Pa(which, t_s), temperature_K)

        self._part = part
        self._now_ns = now_ns
        self._blocks = SampleBlocks(fetch, UPDATE_NS * 1e-9, length=BLOCK_LENGTH)
        self.power_cycle(powered_ns)

    def power_cycle(self, at_ns: int) -> None:
        """Switch the supply off and on, which clears a latched fault."""
        self._first_data_ns = at_ns + self._part.first_data_ns
        self._last_read = -1
        self._deaf = False
        self.fault = False
        self.frozen_ns: int | None = None

    def write(self, data: bytes) -> None:
        """Do nothing: the part measures continuously. After an empty write an MS4515DO misses the next transfer."""
        self._listen()
        self._deaf = self._part.repeated_start_hurts and not data

    def read(self, count: int) -> bytes:
        self._listen()
        now_ns = self._now_ns()
        if now_ns < self._first_data_ns:
            word, status = 0, STALE
        else:
            index = (now_ns if self.frozen_ns is None else self.frozen_ns) // UPDATE_NS
            word = int(self._blocks.row(index))
            status = STALE if index == self._last_read else NORMAL
            self._last_read = index
        frame = (word | (FAULT if self.fault else status) << 30).to_bytes(4, "big")
        return (frame + b"\xff" * count)[:count]  # beyond the frame the line stays high

    def write_read(self, data: bytes, count: int) -> bytes:
        self.write(data)
        reply = self.read(count)
        self._deaf = self._part.repeated_start_hurts
        return reply

    def _listen(self) -> None:
        if self._deaf:
            self._deaf = False
            raise no_acknowledge()
