"""Speeds as a pilot reads them: in m/s, and in the unit of the display."""

from enum import StrEnum

from flightpower.flight.units import FOOT_M, KNOT_MPS


class SpeedUnit(StrEnum):
    """The unit that the pilot's display has."""

    MPS = "m/s"
    KNOT = "kt"
    MPH = "mph"
    KMH = "km/h"


MPS_OF = {SpeedUnit.KNOT: KNOT_MPS, SpeedUnit.MPH: 5280 * FOOT_M / 3600, SpeedUnit.KMH: 1 / 3.6}


def speed_text(speed_mps: float, unit: SpeedUnit) -> str:
    """A speed in m/s, and in the pilot's unit."""
    text = f"{speed_mps:.1f} m/s"
    return text if unit is SpeedUnit.MPS else f"{text} ({speed_mps / MPS_OF[unit]:.1f} {unit})"
