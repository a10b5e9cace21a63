"""Speeds as a pilot reads them: in m/s and in the unit of the pilot's display."""

from enum import StrEnum

from flightpower.flight.units import to_si


class SpeedUnit(StrEnum):
    """The unit on the pilot's display."""

    MPS = "m/s"
    KNOT = "kt"
    MPH = "mph"
    KMH = "km/h"


def speed_text(speed_mps: float, unit: SpeedUnit) -> str:
    """Return a speed in m/s and in the pilot's unit."""
    text = f"{speed_mps:.1f} m/s"
    if unit is SpeedUnit.MPS:
        return text
    return f"{text} ({speed_mps / to_si(f'1 {unit}', 'm/s', 'speed'):.1f} {unit})"
