"""Mean vertical motion of the air over the runs of a flight: its standard deviation before the flight.

It is an error of the trajectory (`equations.SENSOR_ERRORS`): it acts on the angle of attack as 1/V, and a flight at
several speeds shows it within 0.035 m/s in four minutes, 0.014 m/s in twenty. The prior has three parts.
Wind over sloping ground rises with the slope, at any hour. Air that lies in layers before sunrise moves up and down in
waves: a long flight meets several. And the sun heats the ground: the heat flux gives the convective velocity scale w*
(Deardorff 1970, J. Atmos. Sci. 27, 1211), which gives how fast the air rises and sinks in eddies as deep as the mixed
layer. A flight meets several eddies, so their mean is smaller: it is derived from the places and times of the runs,
relative to the air, which carries the eddies along.

Turbulence by wind, and the smaller updrafts of convection, are vertical gusts: the trajectory finds their intensity,
and their mean over the flight is in the standard error of angle of attack.
"""

import math
from typing import NamedTuple

import numpy as np

from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.settings import EVIDENCE
from flightpower.analysis.sources.grid import rows_within
from flightpower.analysis.sources.recording import Fix
from flightpower.analysis.trajectory.observability import against_prior
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.analysis.trajectory.settings import UPDRAFT
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import GRAVITY_MPS2
from flightpower.flight.units import DAY_S

STILL_MPS = Uncertainty().updraft_mps  # before sunrise, in up to 5 m/s of wind


class Updraft(NamedTuple):
    """Standard deviation of the mean updraft over the runs [m/s], and the elevation of the sun [rad], None if the log
    lacks time or place; the standard deviation is then that of the hour before sunrise.

    lasting_mps : the part that is the same in all runs     eddies_mps : the part that differs from run to run
    """

    lasting_mps: float
    eddies_mps: float
    sun_rad: float | None

    @property
    def sigma_mps(self) -> float:
        return math.hypot(self.lasting_mps, self.eddies_mps)


def sun_elevation(utc_s: float, latitude_rad: float, longitude_rad: float) -> float:
    """Elevation of the sun [rad], within 0.02 deg (Astronomical Almanac, low-precision formulas). utc_s: Unix time."""
    days = utc_s / DAY_S - 10_957.5  # since 2000 January 1, 12:00
    anomaly = math.radians(357.528 + 0.985_600_3 * days)
    ecliptic = math.radians(280.460 + 0.985_647_4 * days + 1.915 * math.sin(anomaly) + 0.020 * math.sin(2 * anomaly))
    tilt = math.radians(23.439 - 4e-7 * days)
    right_ascension = math.atan2(math.cos(tilt) * math.sin(ecliptic), math.cos(ecliptic))
    declination = math.asin(math.sin(tilt) * math.sin(ecliptic))
    sidereal = math.radians(280.460_618_37 + 360.985_647_366_29 * days)
    hour_angle = sidereal + longitude_rad - right_ascension
    return math.asin(
        math.sin(latitude_rad) * math.sin(declination)
        + math.cos(latitude_rad) * math.cos(declination) * math.cos(hour_angle)
    )


def sun_over(fix: Fix) -> float | None:
    """The higher elevation of the sun [rad] at either end of a flight; None without place or date from satellites."""
    if fix.unix_at_zero_s is None or not fix.by_satellites or not fix.ends:
        return None
    ends = [(fix.unix_at_zero_s + t_s, math.radians(lat), math.radians(lon)) for t_s, lat, lon in fix.ends]
    return max(sun_elevation(*end) for end in ends)


def heat_flux_WPM2(sun_rad: float) -> float:
    """Sensible heat flux from the ground into the air under a clear sky; 0 where the ground cools.

    Net radiation: sunlight through a clear sky, less a fifth that grass reflects, less longwave (Stull 1988, An
    Introduction to Boundary Layer Meteorology, sec. 7.3). A tenth of it warms the ground, half of the rest evaporates
    water (Bowen ratio 1).
    """
    solar_constant_WPM2, reflected, longwave_WPM2, heating_share = 1361.0, 0.2, 100.0, 0.45
    high = max(math.sin(sun_rad), 0.0)
    sunlight = solar_constant_WPM2 * high * (0.6 + 0.2 * high)
    return heating_share * max((1 - reflected) * sunlight - longwave_WPM2, 0.0)


def convective_velocity(sun_rad: float) -> float:
    """The convective velocity scale w* [m/s]: the cube root of g/T times heat flux times depth of the mixed layer."""
    heat_capacity_JPM3K, temperature_K = 1200.0, 290.0  # of the air; the cube root of both hardly matters
    warming_Kmps = heat_flux_WPM2(sun_rad) / heat_capacity_JPM3K
    return math.cbrt(GRAVITY_MPS2 / temperature_K * warming_Kmps * UPDRAFT.mixed_layer_m)


def by_waves(duration_s: float) -> float:
    """Standard deviation [m/s] of the mean updraft over a time, before sunrise.

    Air that lies in layers swings about its level with the buoyancy frequency N at most. Where temperature rises by
    0.2 K over 100 m, N^2 = g/T (dT/dz + g/c_p) (Stull 1988, sec. 12.2) gives 0.02 rad/s, a period of 310 s; on a mast
    periods were 200 to 300 s at night (Byzova et al. 1998, Izv. Atmos. Ocean. Phys. 34, 799). The mean updraft is the
    height that the air gains from beginning to end, divided by the time. Heights that far apart in time are normal
    with the correlation exp(-(N t)^2 / 2).
    """
    buoyancy_radps = 0.02
    phase = buoyancy_radps * max(duration_s, 1.0)
    return UPDRAFT.displacement_m * buoyancy_radps * math.sqrt(-2 * math.expm1(-(phase**2) / 2)) / phase


def mean_updraft(trajectory: Trajectory, runs_s: list[tuple[float, float]], sun_rad: float | None) -> Updraft:
    """The mean updraft over runs with these beginnings and ends, in the time of the trajectory's states."""
    states = trajectory.states
    t_s = states.index.to_numpy()
    in_run = rows_within(t_s, runs_s)
    if not in_run.any():
        in_run[:] = True
    flown = states[in_run]
    wind_mps = float(np.hypot(flown["wind_north"], flown["wind_east"]).mean())
    duration_s = max(end_s for _, end_s in runs_s) - min(start_s for start_s, _ in runs_s)
    lasting = max(STILL_MPS, UPDRAFT.slope * wind_mps, by_waves(duration_s))
    if sun_rad is None:
        return Updraft(lasting, 0.0, None)
    step_s = np.diff(t_s, prepend=t_s[0])
    through_air = [
        np.cumsum((states[f"v_{axis}"] - states[f"wind_{axis}"]).to_numpy() * step_s) for axis in ("north", "east")
    ]
    path_m = np.stack(through_air, axis=1)[in_run]
    height_m = float(np.clip(flown["height"].mean(), 0.0, UPDRAFT.mixed_layer_m / 2))
    eddies = convective_mean(path_m, t_s[in_run], height_m, sun_rad)
    return Updraft(lasting, eddies, sun_rad)


class UpdraftByDay(NamedTuple):
    """Tests the mean updraft of a whole flight against what is usual at its time of day.

    z : the estimate, in units of the standard deviation that it has if the prior for the hour is right
    sigma_mps : standard deviation of the prior that the trajectory is given: the hour's, or the size that the flight
        shows if that is larger
    note : for the reader; empty where the flight does not contradict the hour
    """

    z: float
    sigma_mps: float
    note: str

    @property
    def contradicted(self) -> bool:
        """Whether the flight contradicts the hour. By chance, one daytime flight in 80 does."""
        return abs(self.z) > EVIDENCE.contradiction


def updraft_by_day(trajectory: Trajectory, sun_rad: float | None) -> UpdraftByDay | None:
    """The mean updraft of a whole flight; None where there are no eddies, as before sunrise.

    With the prior for lasting updrafts, 0.02 m/s, sinking air is mistaken for an offset of the angle of attack (1 m/s
    of sink: 40 to 80 % of power, up to five half widths). So the prior is that of the eddies. Their size is known for
    fair weather only: the prior is as wide as the flight itself makes most probable, and never narrower than the hour's
    (empirical Bayes, as in `observability`). In gusts a flight shows the updraft so poorly that an estimate of 1.5
    standard deviations, no contradiction, may be air that sinks at ten times the prior.
    """
    t_s = trajectory.states.index.to_numpy()[trajectory.block_means.airborne]
    of_hour = mean_updraft(trajectory, [(t_s[0], t_s[-1])], sun_rad) if len(t_s) else None
    if of_hour is None or of_hour.eddies_mps == 0:
        return None
    by_day = UpdraftByDay(*against_prior(trajectory.with_prior("updraft", of_hour.sigma_mps), "updraft"), note="")
    if not by_day.contradicted:
        return by_day
    z, sigma_mps, _ = by_day
    wider = trajectory.with_prior("updraft", sigma_mps)
    half_mps = NORMAL_95 * wider.standard_error("updraft")
    return UpdraftByDay(
        z,
        sigma_mps,
        f"Over the flight the air seems to have {'risen' if z > 0 else 'sunk'} by {abs(wider.value('updraft')):.1f} ±"
        f" {half_mps:.1f} m/s, {abs(z):.1f} standard deviations from what is usual at that hour. The curve is corrected"
        " for it, and the interval is wider. Fly at dawn.",
    )


def convective_mean(path_m: Array, t_s: Array, height_m: float, sun_rad: float) -> float:
    """Standard deviation [m/s] of the mean of deep updrafts and sinks over instants t_s (n,) at places path_m (n, 2).

    path_m : horizontal, in the frame that moves with the mean wind
    Eddies that span a mixed layer of depth z_i have a standard deviation of 0.65 w* in its middle (from
    1.8 w*^2 (z/z_i)^(2/3) (1 - 0.8 z/z_i)^2, Lenschow & Stephens 1980, Boundary-Layer Meteorol. 19, 509), and vanish
    at its bottom and top: as the sine of pi z/z_i. Their integral length is 0.28 z_i (Lenschow & Stankov 1986, J.
    Atmos. Sci. 43, 1198), and they change within the turnover time z_i / w*. The variance of the mean is the mean of
    the covariance over all pairs of instants.
    """
    w_star = convective_velocity(sun_rad)
    if w_star == 0:
        return 0.0
    depth_m = UPDRAFT.mixed_layer_m
    sigma_mps = 0.65 * w_star * math.sin(math.pi * height_m / depth_m)
    length_m, lifetime_s = 0.28 * depth_m, depth_m / w_star
    some = np.unique(np.linspace(0, len(t_s) - 1, 400).astype(int))  # enough to average over all pairs
    path_m, t_s = path_m[some], t_s[some]
    apart_m = np.hypot(*(path_m[:, None] - path_m).transpose(2, 0, 1))
    correlation = np.exp(-apart_m / length_m - np.abs(t_s[:, None] - t_s) / lifetime_s)
    return sigma_mps * math.sqrt(float(correlation.mean()))


def updraft_notes(updraft: Updraft) -> list[str]:
    """Return a note if the hour is unknown, or if the hour or a short time between the runs widens the interval."""
    if updraft.sun_rad is None:
        return [
            "This log has no date, time or place from satellites: the mean updraft is assumed to be that of a calm"
            f" morning, {updraft.lasting_mps:.2g} m/s (1 sigma). If you flew later in the day, enter a larger"
            " [uncertainty] updraft."
        ]
    if updraft.sigma_mps < 2 * STILL_MPS:
        return []
    if updraft.eddies_mps < updraft.lasting_mps:
        return [
            "The runs lie within a short time, over which rising and sinking air does not average out: a mean of"
            f" {updraft.sigma_mps:.2f} m/s (1 sigma) is assumed, and the interval includes it. Runs spread over twenty"
            f" minutes before sunrise would need only {STILL_MPS:g} m/s. Spread the runs over more time."
        ]
    return [
        f"The sun was up to {math.degrees(updraft.sun_rad):.0f} deg high: a mean updraft or downdraft of"
        f" {updraft.sigma_mps:.2f} m/s (1 sigma) over the runs is assumed; before sunrise it would be"
        f" {STILL_MPS:g} m/s."
        " The interval has been widened accordingly. Fly at dawn; after a flight under clouds enter a larger"
        " [uncertainty] updraft."
    ]
