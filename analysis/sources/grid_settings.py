"""Settings of `analysis.sources`: limits, priors and windows, with units and reasons."""

from collections.abc import Mapping
from dataclasses import dataclass

from flightpower.flight.settings import Settings, setting


@dataclass(frozen=True)
class StatisticsSettings(Settings):
    """Thresholds for what is enough, significant, determined or worth a note; used by all folders above this one."""

    sigmas: float = setting(
        3.0, "1", "standard errors beyond which a departure from what is assumed counts: one in 400 by chance"
    )
    false_alarm_rate: float = setting(0.01, "1", "of tests of several values together")
    fewest_values: int = setting(
        30, "1", "fewest samples for judging a correlation or a fit: 0.36 is then two standard errors"
    )
    fewest_readings: int = setting(5, "1", "on a stand, or in a tunnel at one speed: fewer do not show their scatter")
    largest_misfit: float = setting(
        2.0, "1", "rms of residuals over their standard deviation, beyond which the model or the sensor is doubted"
    )
    determined_share: float = setting(
        0.8,
        "1",
        "a standard error below this share of the prior's standard deviation: the measurement determined the value",
    )
    unmentioned_share: float = setting(0.02, "1", "of a flight that is left out, lost or extrapolated without a note")
    unmentioned_gaps: float = setting(
        0.002, "1", "of a log or a maneuver that is clipped or interpolated without a note"
    )


@dataclass(frozen=True)
class ChannelSettings(Settings):
    """Limits for the synchronized channels of a log."""

    smoothing_s: float = setting(
        0.2,
        "s",
        "for smoothing q_c in quotients, and gusts before a comparison; short compared with the seconds of a run",
    )
    fewest_samples: int = setting(250, "1", "to judge a channel by: ten seconds of the default tray")
    long_gap_s: float = setting(2.0, "s", "gaps this long are noted, the three longest of each topic")
    gap: float = setting(
        3.5, "1", "median intervals, beyond which samples are not connected, and the nominal period is not theirs"
    )
    clock_set_unix_s: float = setting(
        1e9, "s", "2001: earlier times are of a clock without battery, which begins at 1970, 1980 or 2000"
    )


@dataclass(frozen=True)
class RestSettings(Settings):
    """Limits for rest on the ground and its zeros. `flight.runs.STANDING` has the spreads of the sensors at rest."""

    window_s: float = setting(
        1.0,
        "s",
        "of standard deviations and means; longer than the correlation of the noise: means over such are independent",
    )
    force_change_mps2: float = setting(
        0.1,
        "m/s²",
        "largest difference of the mean specific force over a window from the median of the whole rest: ten"
        " standard deviations at bench noise; a take-off or landing whose acceleration grows gently has no spread,"
        " but it changes this mean",
    )
    rolling_mps: float = setting(1.0, "m/s", "mean speed by GPS over a window; the noise of one solution is 0.1 m/s")
    noise_scatter: float = setting(1.5, "1", "3.5 standard errors of a standard deviation over 25 samples")
    fewest_blocks: int = setting(8, "1", "fewest windows whose means give a standard error by their scatter")
    flying_s: float = setting(
        2.0, "s", "q_c above its zero by the dynamic pressure of flight for this time is flight, not wind"
    )
    significant_drift: float = setting(4.0, "standard errors", "a larger drift of a zero is corrected")
    zero_drift: Mapping[str, float] = setting(
        {"Pa": 3.0, "rad/s": 0.01},
        "Pa, rad/s",
        "largest difference of zeros of two days, by drift with temperature: MPU-9250 PS 3.1, 30 deg/s over the range,"
        " here 10 K; MS4515DO and SSC, 1 % and 2 % of the span over their ranges",
    )

    @property
    def shortest_s(self) -> float:
        """Least duration of a rest: four windows."""
        return 4 * self.window_s


STATISTICS = StatisticsSettings()
CHANNELS = ChannelSettings()
REST = RestSettings()


@dataclass(frozen=True)
class FlightDetection(Settings):
    """Limits that find the flight in a log by airspeed, GPS and height; the autopilot's flight state is not used."""

    step_s: float = setting(0.2, "s", "the fastest change that matters, of the throttle, takes a few steps")
    smoothing_s: float = setting(1.0, "s", "of pressures and accelerations: slower than short-period motion")
    recognized_over_s: float = setting(3.0, "s", "a gust on the ground is shorter")
    highest_CL: float = setting(
        3.0, "1", "at a smaller dynamic pressure the aircraft stands or rolls, even with flaps out"
    )
    standing_mps: float = setting(1.0, "m/s", "ground speed that GPS shows at rest")
    climb_mps: float = setting(1.0, "m/s", "any take-off climbs faster, at an efficiency of 1")
    clear_of_ground_m: float = setting(3.0, "m", "above ground effect of a small wing, and a barometer's error")
    shortest_flight_s: float = setting(60.0, "s", "a shorter flight holds too few independent windows")
    longest_gap_s: float = setting(
        2.5, "s", "longest gap bridged by interpolation: well below a window; for telemetry one window"
    )
    longest_log_s: float = setting(40_000.0, "s", "eleven hours; a longer flight means a wrong clock")
    measured_share: float = setting(0.98, "1", "of the flight, from which a channel counts as measured throughout")


FLIGHT = FlightDetection()


@dataclass(frozen=True)
class ReceiverSettings(Settings):
    """Noise of a GPS receiver."""

    velocity_mps: tuple[float, float] = setting(
        (0.3, 1.0),
        "m/s",
        "horizontal and vertical velocity: GPS errors are correlated over a minute; horizontal ones look like wind, and"
        " height comes from the barometer",
    )


RECEIVER = ReceiverSettings()
