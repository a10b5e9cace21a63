"""Limits for measurements on the ground, with units and reasons."""

from dataclasses import dataclass

from flightpower.flight.settings import Settings, setting


@dataclass(frozen=True)
class RunUpSettings(Settings):
    """Limits for the run-up of the motor on the strapped aircraft."""

    transfer: float = setting(
        0.2,
        "1",
        "of an offset by vibration, 1 sigma, that differs in flight, where no strap holds the aircraft; assumed",
    )


@dataclass(frozen=True)
class ImuSettings(Settings):
    """Limits for calibrating accelerometers with the tray on its six sides."""

    drift: float = setting(
        0.0015, "1", "of the scale between bench and flight, 1 sigma: 0.026 % a kelvin (MPU-9250), 10 K at most, evenly"
    )


RUN_UP = RunUpSettings()
IMU = ImuSettings()
