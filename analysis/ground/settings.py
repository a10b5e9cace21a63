"""Limits of measurements on the ground, with units and reasons."""

import math
from dataclasses import dataclass

from analysis.signals.settings import STATISTICS
from flight.aircraft import Uncertainty
from flight.settings import Settings, setting


@dataclass(frozen=True)
class ThrustStandSettings(Settings):
    """Thrust at rest, on a stand, against the propeller's table."""

    fewest_speeds: int = setting(3, "speeds", "for the change of the ratio with motor speed")
    same_speed: float = setting(0.02, "1", "readings at speeds nearer than this are repetitions")
    largest_difference: float = setting(
        0.4, "1", "of the ratio from one: beyond it a unit, the diameter or the number of pole pairs is wrong"
    )

    @property
    def largest_error(self) -> float:
        """1 sigma of the ratio: a worse stand tells no more than the table, whose error at rest is scale - slope/2."""
        stated = Uncertainty()
        return STATISTICS.determined_share * math.hypot(stated.thrust_scale_fraction, stated.thrust_slope / 2)


@dataclass(frozen=True)
class RunUpSettings(Settings):
    """Run-up of the motor on the strapped aircraft."""

    transfer: float = setting(
        0.2,
        "1",
        "of an offset by vibration, 1 sigma, that differs in flight, where no strap holds the aircraft; assumed",
    )


RUN_UP = RunUpSettings()
STAND_LIMITS = ThrustStandSettings()
