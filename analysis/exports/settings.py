"""What exported tables leave out."""

from dataclasses import dataclass

from flight.settings import Settings, setting


@dataclass(frozen=True)
class Exports(Settings):
    """Limits of derived quantities."""

    slowest_mps: float = setting(3.0, "m/s", "below, an airspeed is noise")


EXPORTS = Exports()
