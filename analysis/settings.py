"""Settings that several folders share: limits of significance, points of curves, and speeds that count as flown."""

import math
from dataclasses import dataclass

from flightpower.analysis.estimation.settings import TESTS
from flightpower.flight.settings import Settings, setting


@dataclass(frozen=True)
class EvidenceLimits(Settings):
    """Limits beyond which data contradict an assumption, and below which an effect is too small to matter."""

    contradiction: float = setting(
        2.5,
        "1",
        "prior standard deviations beyond which a value contradicts its prior: 1 % of the draws of a parameter",
    )
    negligible: float = setting(0.005, "1", "relative change of drag, thrust, weight or density that matters to nobody")
    most_repetitions: int = setting(200, "1", "more additional runs or flights than this are no advice")

    @property
    def false_alarms(self) -> float:
        """Level of a test whose result is shown with its probability."""
        return TESTS.false_alarms

    @property
    def rare_false_alarms(self) -> float:
        """Level of a test that is made in every analysis and leads to a warning."""
        return TESTS.rare_false_alarms


@dataclass(frozen=True)
class Curves(Settings):
    """How finely a curve over speed is computed, stored and drawn."""

    points: int = setting(61, "1", "smooth when drawn, and linear between two points to 0.1 %")

    @property
    def fine_points(self) -> int:
        """Points of a curve on which a parabola through three points locates the best speed to 1e-5 of that speed."""
        return 2 * self.points - 1


@dataclass(frozen=True)
class Flown(Settings):
    """Limits for speeds, lift coefficients and bank to count as flown, and for what a propeller's table must cover."""

    robust_percentiles: tuple[float, float] = setting(
        (1.0, 99.0), "%", "of the lift coefficients flown, between which a curve holds: without take-off and outliers"
    )
    possible_CL: tuple[float, float] = setting(
        (0.05, 5.0), "1", "of the slowest speed flown; no wing reaches the latter: a wrong weight, area or unit"
    )
    level_rad: float = setting(
        math.radians(12.0),
        "rad",
        "largest bank of level flight, 2 % more lift than weight, also of a steady point; beyond it an error of"
        " sideslip acts like one of angle of attack, and a note is written on a maneuver",
    )
    nearby: float = setting(0.04, "1", "relative difference of speeds that count as the same speed flown")
    least_covered: float = setting(0.5, "1", "of the samples near a speed, at which thrust counts as known there")
    largest_share_outside: float = setting(
        0.7, "1", "of the runs, outside the propeller's table: beyond it the table is that of another propeller"
    )

    @property
    def doubtful_CL(self) -> float:
        """Half of the lift coefficient that no wing reaches: slotted flaps reach about this value, clean wings 1.6."""
        return self.possible_CL[1] / 2


EVIDENCE, CURVES, FLOWN = EvidenceLimits(), Curves(), Flown()
