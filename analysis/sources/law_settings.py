"""Settings of `analysis.sources`: how well quantities of a table have to agree."""

from dataclasses import dataclass
from typing import NamedTuple

from flight.settings import Settings, setting


class Agreement(NamedTuple):
    """Least correlations of the two sides of a law: to follow each other, to tell a delay, to tell a unit."""

    related: float
    delayed: float
    scaled: float


@dataclass(frozen=True)
class LawSettings(Settings):
    """Laws of motion between columns, smoothed over a second."""

    correlation: Agreement = setting(
        Agreement(0.4, 0.6, 0.8),
        "1",
        "laws that are exact have 0.75 to 1.00 in simulated and in real flights (10 Hz of a Citation, 500 Hz of a"
        " tailsitter); columns of different flights have 0.3 at most",
    )
    delay: tuple[float, float] = setting(
        (0.8, 0.6),
        "s, 1",
        "shorter delays are those of filters and receivers; share of what is left unexplained at once",
    )
    least_bank_rad: float = setting(
        0.05, "rad", "bank by the turn, 1 sigma: in a straight flight sideslip and gusts are as large"
    )
    heave_s_per_mps: float = setting(
        0.02,
        "s²/m",
        "times the airspeed: lift follows the pitch rate within V/g times lift coefficient over its slope, 1 over 5",
    )


LAWS = LawSettings()
