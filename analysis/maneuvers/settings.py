"""Criteria of the maneuvers that the pilot's monitor does not know; those of level runs are in `flight.runs`."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight.settings import Settings, setting


@dataclass(frozen=True)
class SteadyPointSettings(Settings):
    """What counts as steady level flight."""

    smoothing_s: float = setting(5.0, "s", "the slope of speed with 0.3 m/s noise is then good to 0.02 m/s²")
    largest_mps2: float = setting(0.12, "m/s²", "1 % of the weight; the energy balance corrects for what remains")
    largest_climb_mps: float = setting(0.5, "m/s", "momentary; the energy balance corrects for what remains")
    largest_bank_rad: float = setting(np.radians(12), "rad", "2 % more lift than weight")
    shortest_s: float = setting(8.0, "s", "longer than the smoothing")
    largest_speed_change: float = setting(0.06, "1", "of the mean speed: one point of the curve")

    @property
    def mentioned_s(self) -> float:
        """A stretch this long is listed as rejected; a shorter one is ignored."""
        return self.shortest_s / 2


@dataclass(frozen=True)
class LoadSettings(Settings):
    """Roller coasters, porpoising, wind-up turns: the load factor varies at nearly constant speed."""

    smoothing_s: float = setting(1.0, "s", "of speed and bank, and longest pause in a maneuver; short against a turn")
    load_smoothing_s: float = setting(
        0.4, "s", "of the load factor, and of the height at either end of a maneuver; short against a swing"
    )
    loaded: float = setting(0.15, "1", "a maneuver lasts while the load factor differs from 1 by more than this")
    pulled: float = setting(1.25, "1", "load factor that a roller coaster exceeds; it goes as far below 1")
    shortest_s: float = setting(2.5, "s", "a few swings")
    porpoising_swings: int = setting(8, "1", "this many swings in one stretch are porpoising, not a roller coaster")
    gentle: float = setting(0.05, "1", "a gentle porpoise swings beyond this load factor to either side of 1")
    regular_swings: int = setting(12, "1", "in a row: a gentle porpoise is told from gusts by its regular swings")
    irregular: float = setting(0.35, "1", "largest departure of swings, or steps flown by hand, from their usual time")
    swing_s: tuple[float, float] = setting((0.4, 1.6), "s", "between two swings of a gentle porpoise")
    banked_rad: float = setting(np.radians(15), "rad", "least bank of a wind-up turn")
    wound_up: float = setting(1.4, "1", "load factor that a wind-up turn reaches")
    loading_per_s: float = setting(0.03, "1/s", "least slope of the load factor in a wind-up turn")
    linear: float = setting(0.8, "1", "share of the load factor's variance that a straight line explains")

    @property
    def pushed(self) -> float:
        """Load factor below which a roller coaster goes."""
        return 2 - self.pulled


@dataclass(frozen=True)
class Steps3211Settings(Settings):
    """3-2-1-1 elevator inputs."""

    step_rad: float = setting(np.radians(1.5), "rad", "a step moves the elevator by more")
    step_s: float = setting(0.12, "s", "within this time")
    longest_hold_s: float = setting(3.0, "s", "between two steps of one input")
    response_s: float = setting(
        2.0, "s", "of the aircraft's response after the last step, which belongs to the maneuver"
    )

    @property
    def units(self) -> NDArray[np.float64]:
        """What the maneuver is named for: the durations of its four steps, (4,)."""
        return np.array([3.0, 2.0, 1.0, 1.0])


@dataclass(frozen=True)
class FlightSettings(Settings):
    """The flight as a whole, and maneuvers that overlap."""

    shortest_s: float = setting(10.0, "s", "a shorter time aloft is a hop; overlapping a 3-2-1-1 input, part of it")
    bridged_s: float = setting(5.0, "s", "half of it outside the probe's calibrated range does not end a flight")
    settling_s: float = setting(3.0, "s", "in which the stick comes to rest after porpoising")
    fewest_samples: int = setting(
        60, "1", "of a run by hand: twelve of the estimators' five-sample blocks; estimators ignore shorter maneuvers"
    )


@dataclass(frozen=True)
class NoteSettings(Settings):
    """Beyond these a note is written on a maneuver that is used."""

    height_m: float = setting(5.0, "m", "range of height")
    bank_rad: float = setting(np.radians(10), "rad", "1.5 % more lift than weight")
    throttle_step: float = setting(0.3, "1", "of full throttle: a step pitches the aircraft (Fig. 7.13-7.15)")
    throttle_step_s: float = setting(0.25, "s", "within this time: the motor reaches its speed within 0.2 s")
    turbulence: tuple[float, float] = setting(
        (0.025, 0.12),
        "1",
        "light and rough, by the rms of the load factor: accelerometer noise (Table 4.1) alone gives 0.006, gusts of"
        " W20 = 3 kt about 0.04 and of 15 kt 0.2",
    )
    turbulence_window_s: float = setting(2.0, "s", "of the mean from which the load factor's departure counts")


STEADY_POINT, LOADS, STEPS, FLIGHT, NOTED = (
    SteadyPointSettings(),
    LoadSettings(),
    Steps3211Settings(),
    FlightSettings(),
    NoteSettings(),
)
