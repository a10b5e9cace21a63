"""What the energy of a route is computed with beside the curve, the wind and the battery."""

from dataclasses import dataclass

from flight.settings import Settings, setting


@dataclass(frozen=True)
class RouteEnergy(Settings):
    """How far flight along a route differs from steady flight in smooth air."""

    power_sigma: float = setting(
        0.03, "1", "of the mean power over a route: gusts, control deflections, speed and height held by an autopilot"
    )
    slowest_over_ground_mps: float = setting(0.5, "m/s", "slower is no progress: the wind does not let it be flown")
    climb_share: float = setting(0.9, "1", "climb that an autopilot holds, of the fastest possible")
    at_home_m: float = setting(100.0, "m", "from home: a mission ends there; circles of a landing are wider")
    farthest_m: float = setting(500e3, "m", "beyond it the earth is not flat; no small electric aircraft gets there")
    strongest_mps: float = setting(40.0, "m/s", "wind: a stronger one is a mistake of units")
    draws: int = setting(1000, "1", "of wind, battery and drag: shares are known to 1.5 %")
    directions: int = setting(36, "1", "in which the reach out and back is computed")
    points_per_leg: int = setting(8, "1", "from which the way home is computed")


ROUTE = RouteEnergy()
