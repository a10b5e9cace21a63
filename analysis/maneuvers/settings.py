"""Criteria for maneuvers that the pilot's monitor does not recognize; `flight.runs` has the criteria for level runs."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.settings import Settings, setting


class LoadLevels(NamedTuple):
    """Departures of the load factor from 1."""

    gentle: float
    lasting: float
    roller_coaster: float
    wind_up_turn: float


@dataclass(frozen=True)
class SteadyPointSettings(Settings):
    """What counts as steady level flight."""

    smoothing_s: float = setting(5.0, "s", "the slope of speed with 0.3 m/s noise is then good to 0.02 m/s²")
    largest_mps2: float = setting(0.12, "m/s²", "1 % of the weight; the energy balance corrects for what remains")
    largest_climb_mps: float = setting(0.5, "m/s", "momentary; the energy balance corrects for what remains")
    shortest_s: float = setting(8.0, "s", "longer than the smoothing")
    largest_speed_change: float = setting(0.06, "1", "of the mean speed: one point of the curve")

    @property
    def mentioned_s(self) -> float:
        """A stretch this long is listed as rejected; a shorter one is ignored."""
        return self.shortest_s / 2


@dataclass(frozen=True)
class LoadSettings(Settings):
    """Roller coasters, porpoising, wind-up turns: the load factor varies at nearly constant speed."""

    smoothing_s: float = setting(
        1.0, "s", "of speed, bank and motor speed, and longest pause in a maneuver; short against a turn"
    )
    load_smoothing_s: float = setting(
        0.4, "s", "of the load factor, and of the height at either end of a maneuver; short against a swing"
    )
    deviation: LoadLevels = setting(
        LoadLevels(gentle=0.05, lasting=0.15, roller_coaster=0.25, wind_up_turn=0.4),
        "1",
        "of the load factor from 1: a gentle porpoise exceeds the first to either side; a maneuver lasts while the"
        " second is exceeded; a roller coaster exceeds the third to either side, a wind-up turn the fourth",
    )
    swings: tuple[int, int] = setting(
        (8, 12),
        "1",
        "in one stretch: so many of any kind are porpoising, not a roller coaster; so many regular ones in a row are a"
        " gentle porpoise, not gusts",
    )
    shortest_s: float = setting(2.5, "s", "a few swings")
    irregular: float = setting(0.35, "1", "largest departure of swings, or steps flown by hand, from their usual time")
    swing_s: tuple[float, float] = setting((0.4, 1.6), "s", "between two swings of a gentle porpoise")
    banked_rad: float = setting(np.radians(15), "rad", "least bank of a wind-up turn")
    loading_per_s: float = setting(0.03, "1/s", "least slope of the load factor in a wind-up turn")
    linear: float = setting(0.8, "1", "share of the load factor's variance that a straight line explains")

    @property
    def pulled(self) -> float:
        """Load factor that a roller coaster exceeds."""
        return 1 + self.deviation.roller_coaster

    @property
    def pushed(self) -> float:
        """A roller coaster goes below this load factor."""
        return 1 - self.deviation.roller_coaster


@dataclass(frozen=True)
class Steps3211Settings(Settings):
    """3-2-1-1 elevator inputs."""

    step: tuple[float, float] = setting(
        (np.radians(1.5), 0.12), "rad, s", "a step moves the elevator by more than this angle within this time"
    )
    longest_hold_s: float = setting(
        3.0, "s", "between two steps of one input, and until the stick is at rest after porpoising"
    )
    response_s: float = setting(
        2.0,
        "s",
        "of the aircraft to the last step, which belongs to the maneuver; turbulence differs from means over it",
    )

    @property
    def units(self) -> NDArray[np.float64]:
        """The durations of the four steps that give the maneuver its name, (4,)."""
        return np.array([3.0, 2.0, 1.0, 1.0])


@dataclass(frozen=True)
class FlightSettings(Settings):
    """The flight as a whole, and maneuvers that overlap."""

    shortest_s: float = setting(10.0, "s", "a shorter time aloft is a hop; overlapping a 3-2-1-1 input, part of it")
    bridged_s: float = setting(
        5.0,
        "s",
        "a gap in flight this long, or half as long outside the probe's calibrated range, does not end the flight",
    )
    fewest_samples: int = setting(
        50, "1", "of a run or a steady point: ten of the estimators' blocks, two seconds; shorter ones show nothing"
    )


@dataclass(frozen=True)
class NoteSettings(Settings):
    """Limits beyond which a maneuver that is used gets a note."""

    height_m: float = setting(5.0, "m", "range of height")
    throttle_step: tuple[float, float] = setting(
        (0.3, 0.25),
        "1, s",
        "of full throttle within this time: a step pitches the aircraft (Fig. 7.13-7.15), and the motor reaches its"
        " speed within 0.2 s",
    )
    turbulence: tuple[float, float] = setting(
        (0.025, 0.12),
        "1",
        "light and rough, by the rms of the load factor: accelerometer noise (Table 4.1) alone gives 0.006, gusts of"
        " W20 = 3 kt about 0.04 and of 15 kt 0.2",
    )


STEADY_POINT, LOADS, STEPS, FLIGHT, NOTED = (
    SteadyPointSettings(),
    LoadSettings(),
    Steps3211Settings(),
    FlightSettings(),
    NoteSettings(),
)
