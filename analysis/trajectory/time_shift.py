"""Residual time shifts between channels, after all known delays were taken out.

The reconstruction estimates them with everything else: the probe's channels, whose tubes have much the same length,
against the inertial sensors; and GPS against them. It always corrects for them, significant or not; this module only
reports them.

Why not alpha by itself, against pitch rate and lift (3.22): the aircraft responds to a gust by turning away from it,
which looks like a late probe. On simulated flights with lags of 15 to 20 ms such a fit gave 53 to 75 ms in a turbulence
of W20 = 3 kt and 120 to 134 ms at 15 kt, with errors of 3 to 8 ms and residuals that look like white noise.
"""

from typing import NamedTuple

from analysis.trajectory.reconstruction import Trajectory

SIGNIFICANT = 3.0  # standard errors
LEAST_S = 0.004  # a tenth of a sample interval has no effect on the results
DETERMINED_SHARE = 0.8  # a standard error below this share of the prior: the flight determined the sensor error
SHIFTED_CHANNELS = {"air_data_lag": "the probe", "gps_latency": "GPS"}


class TimeShift(NamedTuple):
    """Delay of channels against the inertial sensors, and its standard error [s]."""

    name: str
    delay_s: float
    standard_error_s: float
    determined: bool  # by this flight, not only by the prior

    @property
    def significant(self) -> bool:
        return abs(self.delay_s) > max(SIGNIFICANT * self.standard_error_s, LEAST_S)

    def in_words(self) -> str:
        """ "GPS is 212 ± 3 ms late against the IMU.", or that the flight does not show it."""
        if not self.determined:
            return f"This flight does not show how late {self.name} is against the IMU."
        shift = f"{1e3 * abs(self.delay_s):.0f} ± {1e3 * self.standard_error_s:.0f} ms"
        side = "late" if self.delay_s >= 0 else "early"
        return f"{self.name[0].upper()}{self.name[1:]} is {shift} {side} against the IMU."


def time_shifts(trajectory: Trajectory) -> list[TimeShift]:
    """The time shifts of a reconstructed flight."""
    return [
        TimeShift(
            words, trajectory.value(name), error, error < DETERMINED_SHARE * trajectory.prior_standard_error(name)
        )
        for name, words in SHIFTED_CHANNELS.items()
        for error in [trajectory.standard_error(name)]
    ]


def time_shift_notes(trajectory: Trajectory) -> list[str]:
    """A significant shift of the probe; a latency of GPS is normal."""
    return [
        f"{shift.in_words()} The analysis corrects for it. Check the tube lengths in the aircraft file, or the log"
        " times; `calibrate tubing` measures the lag."
        for shift in time_shifts(trajectory)
        if shift.name == SHIFTED_CHANNELS["air_data_lag"] and shift.determined and shift.significant
    ]
