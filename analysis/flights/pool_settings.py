"""Settings for pools and comparisons of flights (docs/understand/pooling.md)."""

from dataclasses import dataclass

from flightpower.flight.settings import Settings, setting


@dataclass(frozen=True)
class Pooling(Settings):
    """How flights are pooled, tested for agreement, and compared."""

    remounted: float = setting(
        0.3,
        "1",
        "share of the prior's standard deviation that moves when the probe is taken off and put on again:"
        " 0.3 deg of angle of attack, 0.4 % of airspeed",
    )
    detection: float = setting(0.9, "1", "probability with which a planned difference is to be seen: 9 of 10 campaigns")
    differences_to_see: tuple[float, ...] = setting(
        (0.01, 0.02, 0.05), "1", "fractions of drag for which the number of flights is given"
    )
    fewest_for_trend: int = setting(4, "flights", "a line through fewer leaves less than two degrees of freedom")
    compared_speeds: int = setting(7, "speeds", "the curves have three parameters; more speeds show no more of them")


POOLING = Pooling()
