"""A fake of the microcontroller that counts a speed controller's commutation pulses, behind a decade counter.

It measures the time from one tenth pulse of a motor phase to the next, which is ten electrical periods, in
microseconds, and sends the newest time at most every 10 ms, at 115200 baud 8N1.

Legacy frame, 4 bytes: 'x' (0x78), then the period, 24 bits, big-endian. Nothing is sent without pulses, so
silence means a stopped motor or a broken wire.

Frame with CRC, 11 bytes, for new counters (described in `daq.sensors.esc_counter`):

    0    0xA6        start of frame
    1    sequence    counts frames modulo 256
    2    flags       bit 0: no pulse for 0.5 s, the motor is stopped; the period is then 0
    3-6  period      32 bits, big-endian, microseconds for ten electrical periods
    7-9  pulses      captured, rejected and inserted since the last frame; none is ever wrong here
    10   CRC-8       of bytes 1 to 9: polynomial 0x07, initial value 0, not reflected, no final XOR
                     (CRC-8/SMBUS; of "123456789" it is 0xF4)

It is sent with every new period, at most every 10 ms, and every 0.5 s while the motor is stopped: silence is a fault.
"""

from collections.abc import Iterable

import numpy as np

from flightpower.sim.sensor_truth import SensorTruth

BAUD = 115200
DECADE = 10
INTERVAL_NS = 10_000_000
STANDING_NS = 500_000_000
LEGACY_LONGEST_US = 2**24 - 1
START, FLAG_STANDING = 0xA6, 0x01
STEP_S = 2e-3  # step of the integration of speed
BLOCK_STEPS = 500


def legacy_frame(period_us: int) -> bytes:
    """Encode 'x' and the period [us] in 24 bits."""
    return b"x" + period_us.to_bytes(3, "big")


def framed(sequence: int, period_us: int) -> bytes:
    """Encode the frame with CRC; a period of 0 means that the motor is stopped."""
    body = bytes([sequence % 256, 0 if period_us else FLAG_STANDING]) + period_us.to_bytes(4, "big")
    body += bytes([DECADE if period_us else 0, 0, 0])
    return bytes([START]) + body + bytes([crc8(body)])


def crc8(data: bytes) -> int:
    """CRC-8/SMBUS."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x07 if crc & 0x80 else crc << 1) & 0xFF
    return crc


class FakeEscCounter:
    """The counter on its serial line. pole_pairs: of the motor. with_crc: whether it sends the frames with CRC."""

    baud = BAUD

    def __init__(self, sensor_truth: SensorTruth, pole_pairs: int, with_crc: bool = False):
        self._sensor_truth = sensor_truth
        self._pulses_per_rev = pole_pairs / DECADE
        self._with_crc = with_crc
        self._ready: list[tuple[int, bytes]] = []
        self._block = 0
        self._phase = 0.0  # tenth pulses since power-on
        self._last_pulse_s: float | None = None
        self._last_sent_ns = -INTERVAL_NS
        self._sequence = 0

    def output(self, until_ns: int) -> Iterable[tuple[int, bytes]]:
        while self._block * BLOCK_STEPS * STEP_S * 1e9 <= until_ns:
            self._count_block()
        due = next((i for i, (at_ns, _) in enumerate(self._ready) if at_ns > until_ns), len(self._ready))
        sent, self._ready = self._ready[:due], self._ready[due:]
        return sent

    def receive(self, data: bytes, at_ns: int) -> None:
        """Ignore the data, because the counter has no commands."""

    def _count_block(self) -> None:
        """Count the pulses of the next second, in which the motor's angle passes multiples of ten electrical turns."""
        t_s = (self._block * BLOCK_STEPS + np.arange(BLOCK_STEPS + 1)).astype(np.float64) * STEP_S
        self._block += 1
        rate_Hz = np.maximum(self._sensor_truth.motor_speed_revps(t_s), 0.0) * self._pulses_per_rev
        phase = self._phase + np.concatenate([[0.0], np.cumsum((rate_Hz[:-1] + rate_Hz[1:]) * STEP_S / 2)])
        revolutions = np.arange(np.floor(self._phase) + 1, np.floor(phase[-1]) + 1)
        self._phase = float(phase[-1])
        for pulse_s in np.interp(revolutions, phase, t_s).tolist():
            self._stand_until(pulse_s)
            if self._last_pulse_s is not None:
                self._report(pulse_s, round((pulse_s - self._last_pulse_s) * 1e6))
            self._last_pulse_s = pulse_s
        self._stand_until(float(t_s[-1]))

    def _report(self, at_s: float, period_us: int) -> None:
        at_ns = round(at_s * 1e9)
        if at_ns - self._last_sent_ns >= INTERVAL_NS and (self._with_crc or period_us <= LEGACY_LONGEST_US):
            self._send(at_ns, period_us)

    def _stand_until(self, at_s: float) -> None:
        """Send the frames of a stopped motor that are due before `at_s`; only in the variant with CRC."""
        if self._with_crc:
            while (due_ns := self._last_sent_ns + STANDING_NS) < at_s * 1e9:
                self._last_pulse_s = None
                self._send(due_ns, 0)

    def _send(self, at_ns: int, period_us: int) -> None:
        self._last_sent_ns = at_ns
        self._ready.append((at_ns, framed(self._sequence, period_us) if self._with_crc else legacy_frame(period_us)))
        self._sequence += 1
