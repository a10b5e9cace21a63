"""Settings of pools and comparisons of flights (docs/pooling.md)."""

from dataclasses import dataclass

from flight.settings import Settings, setting


@dataclass(frozen=True)
class Pooling(Settings):
    """How flights are put together, tested for agreement, and compared."""

    remounted: float = setting(
        0.3,
        "1",
        "share of the prior's standard deviation that moves when the probe is taken off and put on again:"
        " 0.3 deg of angle of attack, 0.4 % of airspeed",
    )
    false_alarms: float = setting(
        0.05, "1", "level of each test: outliers, homogeneity, trends and differences of two configurations"
    )
    detection: float = setting(0.9, "1", "probability with which a planned difference is to be seen: 9 of 10 campaigns")
    largest_plan: int = setting(200, "flights", "more flights of each configuration are not a plan")
    differences_to_see: tuple[float, ...] = setting(
        (0.01, 0.02, 0.05), "1", "fractions of drag for which the number of flights is given"
    )
    conspicuous: float = setting(
        2.5, "standard deviations", "a difference this large is named as likely cause: 1 % of the draws of a parameter"
    )
    fewest_for_trend: int = setting(4, "flights", "a line through fewer leaves less than two degrees of freedom")
    compared_speeds: int = setting(7, "speeds", "the curves have three parameters; more speeds show no more of them")


POOLING = Pooling()
