"""Settings of fleets (docs/fleet.md)."""

from dataclasses import dataclass

from flight.settings import Settings, setting


@dataclass(frozen=True)
class Fleet(Settings):
    """How changes of an airframe are told."""

    tests_a_flight: float = setting(
        7.0,
        "tests",
        "that a search for steps and drifts is worth: with 5, simulated sequences of 25 to 300 flights gave 0.7 to 1.5"
        " alarms where one is allowed (`benchmarks/fleet.py`)",
    )


FLEET = Fleet()
