"""Reads the receiver inputs of a Navio2 without autopilot: pulse widths that its kernel driver provides in text files.

These are stick positions. They equal the servo positions only if the receiver drives the servos directly.
"""

from collections.abc import Iterator

from flightpower.daq.bus import BytePort
from flightpower.daq.sensors import Sample
from flightpower.daq.sensors.autopilot import controls
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.messages import Controls, Status

PLAUSIBLE_US = range(700, 2301)  # range of a receiver; 0 means no signal


class Navio2Driver:
    """The receiver on `port`, which returns a line of pulse widths [us] of channels 1, 2, … at each read."""

    def __init__(self, port: BytePort, *, aircraft: Aircraft | None):
        self._port = port
        self._aircraft = aircraft

    def start(self) -> Iterator[float]:
        """There is nothing to configure."""
        yield 0.0

    def read(self, now_ns: int) -> list[Sample]:
        """The latest pulse widths. The status is `no_data` without signal, `corrupt` if the line cannot be parsed."""
        lines = self._port.read_available().splitlines()
        return [Sample("/controls", now_ns, message(lines[-1] if lines else b"", self._aircraft))]


def message(line: bytes, aircraft: Aircraft | None) -> Controls:
    """The message for a line of pulse widths. A channel without signal is 0 and has no angle."""
    try:
        pulses = [int(word) for word in line.split()]
    except ValueError:
        return Controls(status=Status.CORRUPT)
    if not any(pulses):
        return Controls(status=Status.NO_DATA)
    if any(pulse and pulse not in PLAUSIBLE_US for pulse in pulses):
        return Controls(status=Status.CORRUPT)
    controlled = controls(pulses, aircraft)
    controlled.stick_pulse_us = pulses
    return controlled
