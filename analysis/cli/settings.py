"""Settings of the commands: limits of what calibrations are noted for, and defaults of plans."""

from dataclasses import dataclass

from flight.settings import Settings, setting


@dataclass(frozen=True)
class Calibrations(Settings):
    """When a calibration on the ground gets a note."""

    flattest_directions: float = setting(
        0.25, "1", "spread of the magnetometer's directions across their flattest plane; 0.58 is uniform"
    )
    largest_misfit: float = setting(
        2.0, "1", "rms of the residuals over the noise, beyond which the model of the line is doubted"
    )


@dataclass(frozen=True)
class Plans(Settings):
    """Lengths of a leg where none is given."""

    leg_in_sight_m: float = setting(500.0, "m", "what a pilot on the ground has in line of sight")
    leg_of_autopilot_m: float = setting(1300.0, "m", "legs of the plans that docs/flying.md compares")


CALIBRATIONS = Calibrations()
PLANS = Plans()
