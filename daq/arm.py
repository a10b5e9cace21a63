"""A switch on the transmitter that marks the log, or starts and ends it."""

from daq.config import Arm
from daq.sensors import Sample
from flight.messages import Controls, Event

HYSTERESIS_US = 50.0  # a pulse width wanders by a few microseconds


class ArmSwitch:
    """The switch as it stands in /controls. Without signal it stays where it was seen last; at first it is off."""

    def __init__(self, arm: Arm | None):
        self._arm = arm
        self.armed = False

    @property
    def recording(self) -> bool:
        """Whether the switch, if there is one, wants a recording."""
        return self._arm is None or self._arm.action == "mark" or self.armed

    def look(self, samples: list[Sample]) -> list[Event]:
        """See where it stands in a tick's messages; an event when it was moved."""
        if self._arm is None:
            return []
        before = self.armed
        for sample in samples:
            if isinstance(sample.message, Controls):
                self._see(self._arm, sample.message)
        if self.armed is before:
            return []
        return [Event(sensor="arm", text="armed" if self.armed else "disarmed")]

    def _see(self, arm: Arm, controls: Controls) -> None:
        pulses_us = (controls.stick_pulse_us if arm.seen_at == "receiver" else controls.pulse_us) or []
        pulse_us = pulses_us[arm.channel - 1] if arm.channel <= len(pulses_us) else 0
        if pulse_us:  # 0: no signal
            threshold_us = arm.above_us - (HYSTERESIS_US if self.armed else 0.0)
            self.armed = pulse_us > threshold_us
