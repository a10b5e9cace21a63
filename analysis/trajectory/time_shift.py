"""What is left of time shifts between channels after all known delays were taken out, from how the aircraft moved.

The reconstruction of the path estimates them along with everything else: the probe's channels, which all come through
lines of much the same length, against the inertial sensors; and GPS against them. It carries them on, significant or
not, so that nothing has to be applied here: this says in words what the flight showed.

Why not alpha by itself, against pitch rate and lift (3.22): the aircraft answers to a gust by turning away from it, and
that looks like a probe that is late. On simulated flights with lags of 15 to 20 ms such a fit said 53 to 75 ms in a
turbulence of W20 = 3 kt and 120 to 134 ms at 15 kt, with errors of 3 to 8 ms and residuals that look like noise.
"""

from typing import NamedTuple

from analysis.trajectory.reconstruction import Trajectory

SIGNIFICANT = 3.0  # standard errors
LEAST_S = 0.004  # a tenth of a tick changes nothing
LEARNT = 0.8  # an error that shrank to no less of what was assumed beforehand was not learnt from the flight
SENSOR_ERRORS = {"air_data_lag": "the probe", "gps_latency": "GPS"}


class Skew(NamedTuple):
    """By how much channels are late against the inertial sensors, and its standard error [s]."""

    name: str
    late_s: float
    standard_error_s: float
    learnt: bool  # from this flight, and not only assumed before it

    @property
    def significant(self) -> bool:
        return abs(self.late_s) > max(SIGNIFICANT * self.standard_error_s, LEAST_S)

    def in_words(self) -> str:
        """ "GPS is 212 ± 3 ms late against the IMU", or that the flight does not say."""
        if not self.learnt:
            return f"How late {self.name} is against the IMU, this flight does not show."
        shift = f"{1e3 * abs(self.late_s):.0f} ± {1e3 * self.standard_error_s:.0f} ms"
        side = "late" if self.late_s >= 0 else "early"
        return f"{self.name[0].upper()}{self.name[1:]} is {shift} {side} against the IMU."


def skews(trajectory: Trajectory) -> list[Skew]:
    """The shifts of a reconstructed flight."""
    return [
        Skew(words, trajectory.value(name), error, error < LEARNT * trajectory.assumed(name))
        for name, words in SENSOR_ERRORS.items()
        for error in [trajectory.standard_error(name)]
    ]


def notes(trajectory: Trajectory) -> list[str]:
    """A shift of the probe that is more than chance; that GPS is late is in its nature."""
    return [
        f"{skew.in_words()} It is allowed for. A longer line than in the aircraft file? `calibrate tubing` measures it."
        for skew in skews(trajectory)
        if skew.name == SENSOR_ERRORS["air_data_lag"] and skew.learnt and skew.significant
    ]
