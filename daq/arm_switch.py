"""A switch on the transmitter that marks the log, or starts and stops the recording."""

from daq.config import ArmSwitchConfig
from daq.sensors import Sample
from flight.messages import Controls, Event

HYSTERESIS_US = 50.0  # pulse widths vary by a few microseconds


class ArmSwitch:
    """The position of the switch according to /controls. Off at first; keeps its position while there is no signal."""

    def __init__(self, arm: ArmSwitchConfig | None):
        self._arm = arm
        self.armed = False

    @property
    def recording(self) -> bool:
        """Whether to record. True unless the switch controls the recording and is off."""
        return self._arm is None or self._arm.action == "mark" or self.armed

    def update(self, samples: list[Sample]) -> list[Event]:
        """Update the position from a tick's messages. Returns an event when the switch was moved."""
        if self._arm is None:
            return []
        before = self.armed
        for sample in samples:
            if isinstance(sample.message, Controls):
                self._take(self._arm, sample.message)
        if self.armed is before:
            return []
        return [Event(sensor="arm", text="armed" if self.armed else "disarmed")]

    def _take(self, arm: ArmSwitchConfig, controls: Controls) -> None:
        pulses_us = (controls.stick_pulse_us if arm.seen_at == "receiver" else controls.pulse_us) or []
        pulse_us = pulses_us[arm.channel - 1] if arm.channel <= len(pulses_us) else 0
        if pulse_us:  # 0: no signal
            threshold_us = arm.above_us - (HYSTERESIS_US if self.armed else 0.0)
            self.armed = pulse_us > threshold_us
