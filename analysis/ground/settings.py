"""Limits of measurements on the ground, with units and reasons."""

from dataclasses import dataclass

from flight.settings import Settings, setting


@dataclass(frozen=True)
class ThrustStandSettings(Settings):
    """Thrust at rest, on a stand, against the propeller's table."""

    fewest_readings: int = setting(5, "readings", "fewer say nothing of their scatter")
    fewest_speeds: int = setting(3, "speeds", "for the change of the ratio with motor speed")
    same_speed: float = setting(0.02, "1", "readings at speeds nearer than this are repetitions")
    largest_difference: float = setting(
        0.4, "1", "of the ratio from one: beyond it a unit, the diameter or the number of pole pairs is wrong"
    )
    largest_error: float = setting(0.06, "1", "1 sigma of the ratio: a worse stand tells no more than the table")
    same_table: float = setting(0.001, "1", "relative difference of thrust coefficients of one table")


STAND_LIMITS = ThrustStandSettings()
