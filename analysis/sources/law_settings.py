"""Settings of `analysis.sources`: how well the quantities of a table must agree."""

from dataclasses import dataclass
from typing import NamedTuple

from flightpower.flight.settings import Settings, setting


class Agreement(NamedTuple):
    """Least correlations between the two sides of a law for them to be related, to show a delay, and to show a unit."""

    related: float
    delayed: float
    scaled: float


class Delay(NamedTuple):
    """Shortest delay that is reported, the share of variance left with it, and the delay of lift behind pitch."""

    shortest_s: float
    explained: float
    heave_s_per_mps: float


@dataclass(frozen=True)
class LawSettings(Settings):
    """Limits for laws of motion between columns that are smoothed over a second."""

    correlation: Agreement = setting(
        Agreement(0.4, 0.6, 0.8),
        "1",
        "laws that are exact have 0.75 to 1.00 in simulated and in real flights (10 Hz of a Citation, 500 Hz of a"
        " tailsitter); columns of different flights have 0.3 at most",
    )
    delay: Delay = setting(
        Delay(0.8, 0.6, 0.02),
        "s, 1, s²/m",
        "shorter delays are those of filters and receivers; share of what is left unexplained at once; times the"
        " airspeed, how long lift follows pitch: V/g times the lift coefficient over its slope, here 1 over 5",
    )
    energy: tuple[float, float] = setting(
        (3.0, 60.0),
        "s",
        "means of height and speed, above the lag of both; least flight, in which some exchange of the two is usual",
    )


LAWS = LawSettings()
