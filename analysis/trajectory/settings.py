"""Settings of `analysis.trajectory`: limits, priors and windows, with units and reasons."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.settings import Settings, setting


@dataclass(frozen=True)
class ConsistencySettings(Settings):
    """Kinematic consistency, time shifts and airspeed scale of a reconstructed flight."""

    batch_s: float = setting(20.0, "s", "longer than the correlation time of gusts: means over batches are independent")
    least_shift_s: float = setting(0.004, "s", "a tenth of a sample interval has no effect on the results")


@dataclass(frozen=True)
class GustSettings(Settings):
    """Spectra of gusts: their scale length, and their power at low frequency."""

    slow: tuple[float, float] = setting((0.0, 2.0), "1", "band of slow gusts, in radians over a gust's time L/V")
    around_corner: tuple[float, float] = setting(
        (1.0, 10.0),
        "1",
        "band about the corner of the spectrum, where gusts of another length differ most; above, noise is larger",
    )
    tapers: int = setting(
        3, "1", "of the multitaper periodogram, sines (Riedel & Sidorenko 1995, IEEE Trans. Signal Process. 43, 188)"
    )
    fewest_frequencies: int = setting(
        12, "1", "two minutes of vertical gusts at 40 m: fewer show less than the user knows"
    )
    length_factor: float = setting(2.0, "1", "the user's scale length is right within this factor, 1 sigma")
    dominate_mps: float = setting(
        0.1,
        "m/s",
        "vertical gusts, 1 sigma (W20 = 2 kt), that contribute as much as noise to the errors of flow angles",
    )

    @property
    def lengths(self) -> NDArray[np.float64]:
        """Scale lengths over the standard's, (80,), over which the posterior is summed."""
        return np.geomspace(0.1, 20.0, 80)


@dataclass(frozen=True)
class SensorSettings(Settings):
    """Noise of the measurements and of the inertial sensors, beyond the noise at rest."""

    scale: tuple[float, float] = setting(
        (0.005, 0.002), "1", "scale errors of the gyros and of the accelerometers, as noise in proportion to the mean"
    )
    missing: tuple[float, float] = setting(
        (0.5, 5.0), "rad/s, m/s²", "process noise where samples are missing: rates and accelerations of a usual flight"
    )
    rest_mps: float = setting(0.1, "m/s", "velocity of the aircraft at rest")
    independent_headings: int = setting(
        4,
        "1",
        "all blocks of the compass count as so many independent ones: residual iron depends on heading, and motor"
        " current on speed, so that these errors repeat with every leg",
    )
    bench_sigma: Mapping[str, float] = setting(
        {
            "p_radps": 0.005, "q_radps": 0.005, "r_radps": 0.005, "ax_mps2": 0.06, "ay_mps2": 0.06, "az_mps2": 0.06,
            "dp_alpha_Pa": 6.0, "dp_beta_Pa": 6.0, "q_c_Pa": 6.0, "static_Pa": 6.0,
        },
        "rad/s, m/s², Pa",
        "of one sample where the log has no rest (Table 4.1)",
    )  # fmt: skip
    least_noise_share: float = setting(
        0.1, "1", "of the noise on the bench: less at rest is quantization or a stuck channel"
    )


@dataclass(frozen=True)
class PriorSettings(Settings):
    """Priors of the sensor errors and of the initial state, and the first estimate."""

    compass_averaging_s: float = setting(10.0, "s", "of the compass, for the first estimate")
    unmeasured_zero_Pa: float = setting(
        1.0, "Pa", "of a log without rest, by `daq zero` on another day or at another temperature"
    )
    unstated: Mapping[str, tuple[float, float]] = setting(
        {
            "p_bias": (0.0, 0.002), "q_bias": (0.0, 0.002), "r_bias": (0.0, 0.002),
            "beta_bias": (0.0, float(np.radians(1.0))),
            "gps_latency": (0.1, 0.2),
            "heading_bias": (0.0, float(np.radians(10.0))),
            **dict.fromkeys(("p_scale", "q_scale", "r_scale", "ax_scale", "az_scale"), (0.0, 0.01)),
        },
        "rad/s, rad, s, 1",
        "mean and 1 sigma of errors that no aircraft file states: gyros, about their zeros at rest; how the probe sits;"
        " receivers; declination in inhabited regions, and how the tray sits; scales of gyros and accelerometers, of"
        " which the MPU-9250's data sheet (PS-MPU-9250A-01, tables 1 and 2) allows 3 % at most",
    )  # fmt: skip
    calibrated: Mapping[str, float] = setting(
        {"V_scale": 0.003, "alpha_scale": 0.005},
        "1",
        "what remains once the transducers are calibrated: error of the density, position error of the static ports,"
        " differences of the probe on the aircraft from the probe in the tunnel; assumed",
    )
    upwash_rad: float = setting(
        float(np.radians(1.0)),
        "rad",
        "1 sigma for each unit of lift coefficient, where the aircraft file does not say: a horseshoe vortex of the"
        " wing gives 1 to 2 deg at 0.2 to 0.4 spans ahead of the quarter chord; at the end of a boom from the wing tip,"
        " or far ahead, it is next to nothing",
    )
    probe_ahead_m: float = setting(
        0.2, "m", "1 sigma of the probe's place ahead of the center of gravity, where the aircraft file does not say"
    )
    north_rad: float = setting(
        0.01, "rad", "without GPS the compass defines north, and without a compass the initial heading does"
    )
    initial_blocks: int = setting(25, "1", "a log in which the aircraft is at rest within these began at rest")


@dataclass(frozen=True)
class ProcessSettings(Settings):
    """Process noise."""

    height_sigma_m: float = setting(2e-3, "m", "in a step")
    slowest_mps: float = setting(
        5.0,
        "m/s",
        "times the speed scale; least speed in quotients, and ground speed above which the track is taken as heading",
    )
    wind_walk_mps: float = setting(
        0.02, "m/s", "random walk of the wind in a second: place and time of day, without turbulence"
    )


@dataclass(frozen=True)
class PredictionSettings(Settings):
    """Windows of the predictions from past data (instrumental variables)."""

    slow_s: float = setting(
        3.0, "s", "window of predictions of speed and bank, and of means of climb and angles for kinematic consistency"
    )
    rate_s: float = setting(1.0, "s", "window of predictions of their derivatives")
    lag_limits: tuple[int, int] = setting(
        (2, 7),
        "blocks",
        "how many blocks ago the newest and the oldest load factor were that predict the angle of attack (stick"
        " movements); the last block is left out: its mean shares part of a gust's increment",
    )

    @property
    def newest(self) -> int:
        """How many blocks before an instant predictions end."""
        return self.lag_limits[0]

    @property
    def lags(self) -> range:
        """The blocks before an instant whose load factors predict its angle of attack."""
        newest, oldest = self.lag_limits
        return range(newest, oldest + 1)


@dataclass(frozen=True)
class SolverSettings(Settings):
    """Gauss-Newton iterations and the search for the intensity of gusts."""

    gusts_mps: tuple[float, ...] = setting(
        (0.0125, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2),
        "m/s",
        "vertical gusts, 1 sigma, whose evidence is compared: the second cannot be separated from the noise of the flow"
        " angles, and the last is a storm",
    )
    most_iterations: int = setting(
        100, "1", "of one intensity of gusts: usual flights need ten, a stall of an ATTAS without velocities eighty"
    )
    converged: tuple[float, float] = setting(
        (5.0, 0.02),
        "1",
        "largest last step of a sensor error, in standard errors, of the first solution, which only has to be good"
        " enough to compare gust intensities, and of the last",
    )
    draws: int = setting(16, "1", "random errors of the states: standard errors within a sixth")

    @property
    def least_gust_mps(self) -> float:
        """The smallest gust intensity that an estimate may have; the search also tries a smaller one."""
        return self.gusts_mps[1]


@dataclass(frozen=True)
class UpdraftSettings(Settings):
    """Mean vertical motion of the air, where the aircraft file does not state it."""

    slope: float = setting(
        0.0008, "1", "of the ground under the runs, 1 sigma: 0.8 m in a kilometer, as on a plain; wind rises along it"
    )
    displacement_m: float = setting(
        3.0, "m", "of air before sunrise from its level of rest, 1 sigma: waves of 0.06 m/s; 0.004 m/s over 18 minutes"
    )
    mixed_layer_m: float = setting(
        1000.0, "m", "depth in fair weather at noon; with half or twice that the mean updraft is a quarter more or less"
    )


@dataclass(frozen=True)
class ObservabilitySettings(Settings):
    """Limits for notes on what a flight lacked to determine a sensor error."""

    one_heading: float = setting(
        0.7, "1", "length of the mean heading vector above which a flight counts as flown on one heading"
    )
    one_speed: float = setting(
        1.25, "1", "ratio of fastest to slowest speed; a quarter faster has a third less lift coefficient"
    )
    uncertain_alpha_deg: float = setting(0.3, "deg", "a degree is 20 % of power near the stall")
    turbulent_mps: float = setting(
        0.3, "m/s", "vertical gusts, 1 sigma: W20 = 6 kt and more; beyond, the energy method has no curve"
    )


@dataclass(frozen=True)
class PriorCheckSettings(Settings):
    """Conflict of the sensor errors with their priors, and residuals that are too large."""

    informed: tuple[float, float] = setting(
        (0.01, 0.1),
        "1",
        "share of the prior's variance: an estimate of which the data determine less than the first is not tested,"
        " since the"
        " solver's last step is more than 0.2 of the standard deviation that it has if the prior is right; of one below"
        " the second, little is known once its prior is wide, so that it has to be beyond what noise rarely makes",
    )
    largest_rms: float = setting(
        1.5, "1", "of residuals, in standard deviations: 1.0 to 1.1 in calm air on the study's budget, less in gusts"
    )


CONSISTENCY = ConsistencySettings()
GUSTS = GustSettings()
SENSORS = SensorSettings()
PRIORS = PriorSettings()
PROCESS = ProcessSettings()
PREDICTION = PredictionSettings()
SOLVER = SolverSettings()
UPDRAFT = UpdraftSettings()
SHOWN = ObservabilitySettings()
PRIOR_CHECK = PriorCheckSettings()
