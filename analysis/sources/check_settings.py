"""Settings of `analysis.sources`: limits, priors and windows, with units and reasons."""

from dataclasses import dataclass
from typing import NamedTuple

from flightpower.flight.settings import Settings, setting


class WrongSigns(NamedTuple):
    """Limits for each law: correlation below which a sign is wrong, and spread up to which the law is not judged."""

    pitch: tuple[float, float]
    angle_of_attack: tuple[float, float]
    forward_force: tuple[float, float]
    sideslip: tuple[float, float]
    climb: tuple[float, float]
    course: tuple[float, float]
    roll: tuple[float, float]


class PlausibleLimits(NamedTuple):
    """Least and largest value of each quantity."""

    load_g: tuple[float, float]
    temperature_K: tuple[float, float]
    other_degrees: tuple[float, float]
    tip_mps: tuple[float, float]


@dataclass(frozen=True)
class AxesSettings(Settings):
    """Limits for axes and signs from motion; the figures are from the worst of simulated flights of all plans."""

    wrong_sign: WrongSigns = setting(
        WrongSigns(
            pitch=(-0.35, 0.0),
            angle_of_attack=(-0.5, 0.05),
            forward_force=(-0.5, 0.3),
            sideslip=(-0.4, 0.0),
            climb=(-0.5, 0.5),
            course=(-0.5, 0.1),
            roll=(-0.5, 0.0),
        ),
        "1, the quantity's",
        "least correlation and least spread of a law's two quantities: correct logs have 0.46 to 0.98, 0.76 to 0.99,"
        " 0.68 to 1, -0.05 to 0.94 (calm flights hardly sideslip), unknown for climb, 0.97 to 1 for course, 0.21 to"
        " 0.91 for roll (short flights in 15 kt); of 42 simulated flights, for roll of 64 of three aircraft",
    )
    slowest_share: float = setting(
        0.15, "1", "leaves out take-off and landing, where the wheels carry some of the weight"
    )
    rate_unit: tuple[float, float] = setting(
        (5.0, 0.05),
        "m/s², 1",
        "angular rate needs a centripetal force; none of 42 flights exceeded the first in any second, and in deg/s 15 %"
        " to 78 % do",
    )
    side_ports: tuple[float, float, float] = setting(
        (0.6, 0.2, 0.03),
        "1",
        "correlation of lift and beta's pressure over q_c, which is -0.11 to 0.52; how much more than alpha's, which is"
        " 0.74 to 1.00; and least slope of alpha's on the relative lift coefficient: 0.22 to 0.58, in hPa 0.01 at most",
    )
    ground_speed: tuple[float, float] = setting(
        (0.05, 2.5), "1", "median ground speed over median airspeed; the wind is slower than 1.5 times the airspeed"
    )


@dataclass(frozen=True)
class StructureSettings(Settings):
    """Limits for the topics, fields and times of a log."""

    interval_s: tuple[float, float] = setting(
        (1 / 210, 1.1),
        "s",
        "of /imu, from the daemon's 200 Hz to its 1 Hz; faster ones are averaged before they are written",
    )
    largest_jump_s: float = setting(
        3600.0, "s", "longer than any of these aircraft flies: the clock was set, or is another"
    )


@dataclass(frozen=True)
class UnitSettings(Settings):
    """Physical limits that reveal a wrong unit, in addition to the table LIMITS."""

    plausible: PlausibleLimits = setting(
        PlausibleLimits(
            load_g=(0.3, 3.0), temperature_K=(200.0, 400.0), other_degrees=(-60.0, 150.0), tip_mps=(20.0, 340.0)
        ),
        "g, K, degrees, m/s",
        "load on the median of a flight, at rest 1; temperature of a transducer, and the same in degrees"
        " Celsius or Fahrenheit; speed of the tips of a propeller that drives an aircraft, faster"
        " than it flies and slower than sound",
    )
    gravity: tuple[float, float] = setting(
        (-0.5, 0.8),
        "1",
        "z over magnitude, median: level flight, turns and rest are all near -1; and share of the magnitude of one axis"
        " in any unit, unless gravity was taken out",
    )
    swapped: float = setting(
        1.3, "1", "times q_c; q_c is largest below some 20 deg of angle of attack, beyond every wing's stall"
    )
    least_current_A: float = setting(0.5, "A", "more than the zero of a current sensor")


AXES = AxesSettings()
STRUCTURE = StructureSettings()
UNITS = UnitSettings()
