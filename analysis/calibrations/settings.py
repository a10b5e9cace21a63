"""Limits of measurements on the ground, with units and reasons."""

from dataclasses import dataclass

from flightpower.flight.settings import Settings, setting


@dataclass(frozen=True)
class RunUpSettings(Settings):
    """Run-up of the motor on the strapped aircraft."""

    transfer: float = setting(
        0.2,
        "1",
        "of an offset by vibration, 1 sigma, that differs in flight, where no strap holds the aircraft; assumed",
    )


RUN_UP = RunUpSettings()
