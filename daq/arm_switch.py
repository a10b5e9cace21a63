"""A switch on the transmitter that marks the log, or starts and stops the recording."""

from flightpower.daq.config import ArmSwitchConfig
from flightpower.daq.sensors import Sample
from flightpower.flight.messages import Controls, Event

HYSTERESIS_US = 50.0  # pulse widths vary by a few microseconds
ABSENT_NS = 2_000_000_000  # a channel that has no pulse for this long, while others have pulses, is not connected


class ArmSwitch:
    """The position of the switch according to /controls. Off at first; without a signal it keeps its position."""

    def __init__(self, arm: ArmSwitchConfig | None):
        self._arm = arm
        self.armed = False
        self.trouble: list[str] = []  # why the position cannot be read
        self._absent_since_ns: int | None = None

    @property
    def recording(self) -> bool:
        """Whether to record: True unless the switch controls the recording and is off."""
        return self._arm is None or self._arm.action == "mark" or self.armed

    def update(self, samples: list[Sample]) -> list[Event]:
        """Update the position from a tick's messages. Returns an event when the switch was moved."""
        if self._arm is None:
            return []
        before, trouble_before = self.armed, self.trouble
        for sample in samples:
            if isinstance(sample.message, Controls):
                self._take(self._arm, sample.message, sample.time_ns)
        events = [Event(severity="warning", sensor="arm", text=each) for each in self.trouble if not trouble_before]
        if self.armed is before:
            return events
        return [*events, Event(sensor="arm", text="armed" if self.armed else "disarmed")]

    def _take(self, arm: ArmSwitchConfig, controls: Controls, time_ns: int) -> None:
        pulses_us = (controls.stick_pulse_us if arm.seen_at == "receiver" else controls.pulse_us) or []
        pulse_us = pulses_us[arm.channel - 1] if arm.channel <= len(pulses_us) else 0
        if pulse_us or not any(pulses_us):
            self._absent_since_ns = None
            self.trouble = [] if pulse_us else self.trouble
        else:
            self._absent_since_ns = time_ns if self._absent_since_ns is None else self._absent_since_ns
            if time_ns - self._absent_since_ns >= ABSENT_NS:
                self.trouble = [f"arm switch: no pulse on channel {arm.channel}: correct [arm]"]
        if pulse_us:  # 0: no signal
            threshold_us = arm.above_us - (HYSTERESIS_US if self.armed else 0.0)
            self.armed = pulse_us > threshold_us
