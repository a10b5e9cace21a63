"""What the energy of a route is computed with beside the curve, the wind and the battery."""

from dataclasses import dataclass

from flight.settings import Settings, setting


@dataclass(frozen=True)
class RouteEnergy(Settings):
    """How far flight along a route differs from steady flight in smooth air."""

    power_sigma: float = setting(
        0.03, "1", "of the mean power over a route: gusts, control deflections, speed and height held by an autopilot"
    )


ROUTE = RouteEnergy()
