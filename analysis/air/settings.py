"""Settings of `analysis.air`: limits, priors and windows, with units and reasons."""

import math
from dataclasses import dataclass

import numpy as np

from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.settings import Settings, setting


@dataclass(frozen=True)
class AirSettings(Settings):
    """Air data from the probe's pressures, and the channels of a flight."""

    derivative_s: float = setting(0.5, "s", "of the mean that is differentiated")
    stuck_Pa: float = setting(0.02, "Pa", "a tenth of a count of the finest transducer")
    cold_s: float = setting(2.0, "s", "after power-on, in which electronics have the temperature of the air")


@dataclass(frozen=True)
class LineLagSettings(Settings):
    """Lags of pneumatic lines, measured with steps of pressure, and their correction in flight."""

    step_s: float = setting(
        0.5, "s", "a longer change is not a burst; as long before and after it is quiet, which shows levels and noise"
    )
    smallest_step: float = setting(12.0, "1", "times the noise")
    half_width: tuple[float, float, float] = setting(
        (0.02, 0.05, 0.4),
        "1",
        "of the interval, relative to the lag: the least, by errors of the tube's length, its cavity and the air in it;"
        " a sufficient one; the largest that is accepted",
    )
    resolved: float = setting(0.3, "1", "of a tick; a shorter lag is not resolved")
    largest_gain: float = setting(1.5, "1", "the noise of any frequency grows by this at most")
    highest_Hz: float = setting(3.0, "Hz", "of the aircraft's motion: three times its short period")
    smallest_remainder: float = setting(
        0.25,
        "1",
        "a line is corrected if its remainder changes a wave of highest_Hz by more than this; a lag of about 40 ms"
        " does. For 25 ms, on simulated flights, the remainder is 0.01 Pa in calm air and 0.5 Pa of 6 Pa of noise"
        " in gusts, and its correction would increase noise by a fifth",
    )

    @property
    def tried_s(self) -> tuple[float, float]:
        """Shortest and longest lag that is tried: from far below a tick to half of the longest step."""
        return self.step_s / 2500, self.step_s / 2


@dataclass(frozen=True)
class MagnetometerSettings(Settings):
    """Calibration of the magnetometer, and the compass in flight."""

    hard_iron_T: float = setting(
        30e-6,
        "T",
        "standard deviation of the prior: a turn in flight covers a circle of the sphere only, which many"
        " ellipsoids share",
    )
    soft_iron: float = setting(0.05, "1", "standard deviation of the prior")
    field_T: tuple[float, float] = setting(
        (48e-6, 10e-6),
        "T",
        "mean and standard deviation of the prior; anywhere on earth it is 22 to 67 uT (World Magnetic Model)",
    )
    iron_change_T: float = setting(
        1e-6, "T", "in flight: field of the motor current, and of iron that was moved since the calibration"
    )
    tilt_rad: float = setting(
        np.radians(0.5), "rad", "of the tray on the aircraft, and of the attitude by which the field is leveled"
    )
    off: float = setting(
        0.1,
        "1",
        "a sample whose strength differs from the median by this share is left out; the compass is not used if this"
        " share of the samples is, or if the median strength differs from the calibration's by this share …",
    )
    worst_rad: float = setting(np.radians(10.0), "rad", "… or if its heading has a larger error")
    flattest: float = setting(
        0.25, "1", "spread of directions across their flattest plane, below which a note is given; 0.58 is uniform"
    )
    correlated: int = setting(5, "1", "neighboring samples that share errors of the model and count as one")

    @property
    def earth_T(self) -> tuple[float, float]:
        """Limits of a plausible strength: three standard deviations of the prior to either side."""
        mean_T, sigma_T = self.field_T
        return mean_T - STATISTICS.sigmas * sigma_T, mean_T + STATISTICS.sigmas * sigma_T

    @property
    def fewest_samples(self) -> int:
        """How many samples a calibration, and a flight, must have."""
        return STATISTICS.fewest_values * self.correlated


@dataclass(frozen=True)
class MapSettings(Settings):
    """Polynomial maps of a probe."""

    least_improvement: float = setting(0.01, "1", "a higher order must reduce the cross-validated error by this share")
    angle_margin_rad: float = setting(np.radians(0.5), "rad", "accepted beyond the last angle of the tunnel, for noise")


@dataclass(frozen=True)
class TunnelSettings(Settings):
    """Calibration of the probe by a wind tunnel."""

    slope_range_rad: float = setting(
        np.radians(10.0), "rad", "the angles of normal flight, over which the slope of alpha is fitted"
    )
    least_predicted: float = setting(0.9, "1", "of the angles' variance, at points left out (predictive R^2)")
    largest_slope_sigma: float = setting(
        0.1, "1", "relative standard error of the slope of alpha, beyond which it is not determined"
    )


@dataclass(frozen=True)
class GroundCalibrationSettings(Settings):
    """Calibrations on the ground: held pressures of the transducers, held positions of the surfaces."""

    held_s: tuple[float, float] = setting((5.0, 2.0), "s", "least time for which a pressure, or a position, is held")
    fewest: tuple[int, int] = setting(
        (4, 3),
        "1",
        "pressures besides zero, and positions: a straight line through fewer hides a wrong reading",
    )
    steady_noises: float = setting(
        5.0, "1", "times the noise: departure of smoothed readings within a plateau, if more than a zero may drift"
    )
    fewest_good: float = setting(
        0.8, "1", "share of good readings of each transducer in a plateau; others were beyond its range"
    )
    jitter_us: float = setting(4.0, "us", "of the pulse while the stick is not moved")
    largest_gain_error: float = setting(
        0.2, "1", "a slope further from one is a wrong unit or a wrong order of the pressures"
    )

    @property
    def settling_s(self) -> float:
        """Settling time of the tubes at both ends of a plateau; a step may take at most as long."""
        return LAG.step_s

    @property
    def reference_s(self) -> float:
        """Time at the start of a held stretch whose median is the stretch's reference: twice the settling time."""
        return 2 * self.settling_s

    @property
    def same_us(self) -> float:
        """Two held pulses as near as this are one position, read twice: three times the jitter."""
        return 3 * self.jitter_us


AIR = AirSettings()
LAG = LineLagSettings()
MAGNETOMETER = MagnetometerSettings()
MAP = MapSettings()
TUNNEL = TunnelSettings()
GROUND = GroundCalibrationSettings()


@dataclass(frozen=True)
class ThrustStandSettings(Settings):
    """Thrust at rest, on a stand, compared with the propeller's table."""

    fewest_speeds: int = setting(3, "speeds", "for the change of the ratio with motor speed")
    same_speed: float = setting(0.02, "1", "readings at speeds nearer than this are repetitions")
    largest_difference: float = setting(
        0.4, "1", "of the ratio from one: beyond it a unit, the diameter or the number of pole pairs is wrong"
    )

    @property
    def largest_error(self) -> float:
        """Largest 1 sigma of the ratio. A worse stand adds nothing to the table, whose own error is scale - slope/2."""
        default = Uncertainty()
        return STATISTICS.determined_share * math.hypot(default.thrust_scale_fraction, default.thrust_slope / 2)


STAND_LIMITS = ThrustStandSettings()
