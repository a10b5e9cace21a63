"""Thresholds and priors of the drag methods, with units and reasons."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from flightpower.analysis.maneuvers.settings import FLIGHT
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.trajectory.block_means import BLOCK
from flightpower.flight.settings import Settings, setting


@dataclass(frozen=True)
class Regression(Settings):
    """Limits and priors for a regression of drag on lift."""

    level_margin_rad: float = setting(
        np.radians(1.0), "rad", "above the largest angle of attack of level flight, for turns and heave"
    )
    CL_minD_sigma: float = setting(0.2, "1", "prior of the lift coefficient of least drag, where a method has none")

    @property
    def fewest_blocks(self) -> int:
        """The number of blocks that a run, or a steady point, must have at least."""
        return FLIGHT.fewest_samples // BLOCK

    @property
    def fewest_blocks_of_flight(self) -> int:
        """The number of blocks that a whole flight must have to fit a line: those of two shortest runs."""
        return 2 * self.fewest_blocks


@dataclass(frozen=True)
class SteadyPoints(Settings):
    """Settings for steady level points, which the classic methods use."""

    correlation_s: float = setting(2.0, "s", "readings closer than this are correlated")


@dataclass(frozen=True)
class Covariance(Settings):
    """Parts of the covariance of the polar."""

    floor_rad: float = setting(
        np.radians(0.02), "rad", "no direction of lift is known better; in still air intervals cover without any floor"
    )
    imu_position_m: float = setting(0.1, "m", "1 sigma of the IMU's distance from the center of gravity, if missing")
    zero_share_in_flight: float = setting(
        0.5, "1", "of the variance of a zero's change: as much comes about in flight as in the airstream at take-off"
    )


@dataclass(frozen=True)
class MotorSpeed:
    """Limits for errors of the motor's pulse counter, which follow from other settings."""

    @property
    def least_errors(self) -> float:
        """The number of standard errors that an error must exceed to be accepted as real. It is twice the usual limit,
        because many motor speeds are tested and the residuals are correlated. Sound flights reach 2; flights with 2 %
        of the pulses lost reach 7 or more.
        """
        return 2 * STATISTICS.sigmas

    @property
    def least_pole_share(self) -> float:
        """The smallest error of motor speed from a wrong number of poles: two of 24, because poles come in pairs. It is
        also the prior standard deviation of an error of motor speed."""
        return 2 / 24

    @property
    def tested(self) -> NDArray[np.float64]:
        """The motor speeds to test, each given by the share of the runs' samples that are below it."""
        return np.linspace(0.02, 0.98, 49)


@dataclass(frozen=True)
class ComparisonLimits(Settings):
    """Limits for the comparison of methods with each other and of single runs."""

    installation_sigma: Mapping[str, float] = setting(
        {
            "alpha_bias": float(np.radians(0.15)),
            "alpha_scale": 0.01,
            "pitch": float(np.radians(0.15)),
            "airspeed_scale": 0.004,
            "lag": 0.008,
            "thrust_scale": 0.01,
            "thrust_slope": 0.03,
        },
        "rad, s or 1",
        "by sensor error, after a careful installation: differences of the methods that it explains are no fault",
    )
    least_speed_ratio: float = setting(1.15, "1", "highest over lowest of the speeds common to both methods")
    lag_sigma_s: float = setting(0.3, "s", "prior of the air-data lag here: wide enough for a faulty installation")
    correlated_blocks: int = setting(4, "blocks", "over which residuals are correlated")
    run_slope_rad: float = setting(
        0.001, "rad", "of the path of one run, 1 sigma that its residuals do not show: a tenth of a meter in 100 m"
    )

    @property
    def different(self) -> float:
        """Standard errors by which two parabolas differ significantly, in one test over all speeds (Scheffe 1953)."""
        return float(np.sqrt(special.chdtri(3, STATISTICS.false_alarm_rate)))


@dataclass(frozen=True)
class CrossCheckSettings(Settings):
    """Settings for the output-error fit on the runs alone."""

    priors: Mapping[str, tuple[float, float]] = setting(
        {
            "CLde": (0.4, 0.2),
            "CLq": (5.0, 3.0),
            "air_data_lag": (0.01, 0.01),
            "q_bias": (0.0, 0.001),
            "V_bias": (0.0, 0.15),
        },
        "1, s, rad/s, m/s",
        "mean and 1 sigma of what no aircraft file states: a tail with 15 to 20 % of the wing's area, lift slope 4 and"
        " tail volume 0.6; the lag that remains after the correction of the known one; the gyro about its zero at rest;"
        " a constant error of airspeed",
    )
    unzeroed_gyro_radps: float = setting(
        0.02, "rad/s", "an MPU9250's zero-rate output at room temperature, uncalibrated"
    )
    block: int = setting(2, "samples", "12.5 blocks per second are ten per cycle of the short period")
    still_air_mps: float = setting(
        0.07, "m/s", "vertical gusts, 1 sigma, up to which output error's intervals hold: W20 = 1 kt has 0.05, 2 kt 0.1"
    )
    most_runs: int = setting(40, "runs", "each has initial states of its own: time grows with the cube of their number")
    excess: float = setting(
        1.2,
        "1",
        "errors of output error over its standard errors: 1.1 rms in 8 flights in calm air"
        " (docs/understand/estimators.md)",
    )


@dataclass(frozen=True)
class LikelihoodSettings(Settings):
    """Settings for the two maximum-likelihood methods of the source."""

    smoothing_s: float = setting(1.24, "s", "window of the Savitzky-Golay filter of the pitch rate, of degree 3")


REGRESSION = Regression()
STEADY_POINTS = SteadyPoints()
COVARIANCE = Covariance()
MOTOR_SPEED = MotorSpeed()
COMPARISON = ComparisonLimits()
CROSS_CHECK = CrossCheckSettings()
LIKELIHOOD = LikelihoodSettings()
