"""Thresholds for reading autopilots' logs."""

from collections.abc import Mapping
from dataclasses import dataclass

from flightpower.flight.settings import Settings, setting

Limits = tuple[float, float, float]


@dataclass(frozen=True)
class Readable(Settings):
    """Requirements that a channel must meet to be used."""

    fewest_samples: int = setting(20, "1", "a channel with fewer was switched off")
    hover_s: float = setting(1.0, "s", "from the last lift by motors until the wing carries alone: they spool down")
    clock_jump_s: float = setting(60.0, "s", "a longer step of the clock within one channel is no dropout")
    possible: Mapping[str, Limits] = setting(
        {
            "pitot_Pa": (-2000.0, 20_000.0, 600.0),
            "static_Pa": (20_000.0, 120_000.0, 300.0),
            "force_mps2": (-300.0, 300.0, 100.0),
            "voltage_V": (0.0, 1000.0, 50.0),
            "current_A": (-1000.0, 2000.0, 300.0),
            "motor_revps": (0.0, 2000.0, 100.0),
            "ground_mps": (-300.0, 300.0, 30.0),
            "temperature_K": (150.0, 450.0, 50.0),
            "throttle": (-1.5, 1.5, 3.0),
            "height_m": (-1000.0, 100_000.0, 1000.0),
            "place_m": (-500_000.0, 500_000.0, 1000.0),
        },
        "by name",
        "least, greatest, and greatest difference from a median of five samples, beyond which a byte is damaged: air"
        " data to 180 m/s and 12 km, steps of 25 m; 30 g, beyond the range of common accelerometers; above any battery"
        " of a UAV; 120 000 rpm; velocities of GPS; temperatures at which a sensor is broken; throttle with reverse;"
        " the height of a simulation; the distance of a receiver from the first position",
    )


READABLE = Readable()


@dataclass(frozen=True)
class Instances(Settings):
    """Thresholds for choosing among several sensors of one kind."""

    turning_revps: float = setting(5.0, "rev/s", "a motor that stands shows less, by noise")
    second_pack: float = setting(0.5, "1", "of its power; one with more feeds the motor, too, or measures the same")
    second_battery: float = setting(0.1, "1", "of the used battery's power; a second one with more is mentioned")


INSTANCES = Instances()
