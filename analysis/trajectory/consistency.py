"""Kinematic consistency of a flight's channels, as measured and with the estimated sensor errors corrected.

These are two checks of classic flight-path reconstruction. With wings level, pitch attitude less angle of attack is the
angle of climb: theta - alpha - gamma = 0, gamma from the barometer (a small bank is included). And airspeed equals GPS
velocity less wind. No sensor measures attitude or wind: both come from the reconstructed trajectory in either case, so
"before" shows the errors of air data and GPS, and "after" what is left of them.

All known delays have been removed before. The reconstruction estimates the remaining time shifts along with everything
else: those of the probe's channels, whose tubes have nearly the same length, and of GPS, both relative to the inertial
sensors. It always corrects for them, significant or not; this module only reports them.

A fit of alpha alone to pitch rate and lift (3.22) cannot replace this: the aircraft heaves with a gust and turns into
it, which looks like a late probe. On simulated flights with lags of 15 to 20 ms such a fit gave 53 to 75 ms in
turbulence of W20 = 3 kt and 120 to 134 ms at 15 kt, with standard errors of 3 to 8 ms and residuals that look like
white noise.

`calibrate` returns the airspeed scale and wind of a flight, from airspeed compared with GPS on different headings.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.records.flight import Check, ConsistencyCheck
from flightpower.analysis.settings import FLOWN
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.trajectory.equations import PREDICTED_FLOW, SENSOR_ERRORS, STATES, NamedArrays
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.analysis.trajectory.settings import CONSISTENCY, PREDICTION, SHOWN
from flightpower.flight.arrays import Array
from flightpower.flight.motion import earth_from_body, velocity_of

ANGLES, SPEED = "angles_rad", "speed_mps"


class Consistency(NamedTuple):
    """Differences in flight, index t_s, columns ANGLES [rad] and SPEED [m/s]; NaN where something was not measured.

    ANGLES : theta - alpha - gamma, wings nearly level     SPEED : airspeed less GPS velocity with the wind taken out
    before : as measured                                   after : with sensor errors and gusts corrected
    """

    before: pd.DataFrame
    after: pd.DataFrame


class _AirDataAndGps(NamedTuple):
    """Channels (n,) that the checks compare."""

    V: Array
    alpha: Array
    beta: Array
    gps_north: Array
    gps_east: Array


def consistency(trajectory: Trajectory) -> Consistency:
    """Return the differences of both checks, before and after the correction."""
    blocks = trajectory.block_means
    names = ("V_mps", "alpha_rad", "beta_rad", "gps_north_mps", "gps_east_mps")
    measured = _AirDataAndGps(*(blocks[name] for name in names))
    return Consistency(_differences(trajectory, measured), _differences(trajectory, _corrected(trajectory, measured)))


def consistency_checks(agreement: Consistency) -> list[ConsistencyCheck]:
    """Return the mean and scatter of each difference that was measured."""
    checks = []
    for column, title, factor, unit in (
        (ANGLES, "pitch attitude less angle of attack less climb angle, wings level", float(np.degrees(1.0)), "deg"),
        (SPEED, "airspeed less GPS ground speed with the wind taken out", 1.0, "m/s"),
    ):
        before, after = (difference_check(factor * differences[column], title, unit) for differences in agreement)
        if before and after:
            checks.append(ConsistencyCheck(before=before, after=after))
    return checks


def difference_check(difference: pd.Series, title: str = "", unit: str = "") -> Check | None:
    """Mean and scatter of a difference in flight, NaN left out; None if fewer than two batches were measured.

    The standard error comes from the means of batches of CONSISTENCY.batch_s, so slow changes count.
    """
    finite = difference.dropna()
    batches = finite.groupby((finite.index.to_numpy() // CONSISTENCY.batch_s).astype(int)).mean()
    if len(batches) < 2:
        return None
    return Check(
        title=title,
        unit=unit,
        mean=float(finite.mean()),
        mean_standard_error=float(batches.std() / np.sqrt(len(batches))),
        sigma=float(finite.std()),
    )


def _differences(trajectory: Trajectory, channels: _AirDataAndGps) -> pd.DataFrame:
    """Return the two differences, columns ANGLES and SPEED, for these channels."""
    blocks, t_s = trajectory.block_means, trajectory.block_means.t_s
    x = _states(trajectory)
    flying = np.where(blocks.flying, 1.0, np.nan)
    level = np.where(np.abs(x.phi) < FLOWN.level_rad, 1.0, np.nan)
    V, beta = channels.V, np.nan_to_num(channels.beta)  # no sideslip where it was not measured
    u, v, w = velocity_of(1.0, channels.alpha, beta)
    _, _, down = earth_from_body((u, v, w), (x.phi, x.theta, x.psi))
    climb_angle = _moving_average(np.arcsin(np.clip(-np.asarray(down), -1, 1)) * flying, t_s)
    climb = np.gradient(_moving_average(blocks["height_m"], t_s), t_s)
    gamma = np.arcsin(np.clip(climb / _moving_average(V * flying, t_s), -1, 1))
    inertial_V = np.sqrt(
        (channels.gps_north - x.wind_north) ** 2 + (channels.gps_east - x.wind_east) ** 2 + x.v_down**2
    )
    return pd.DataFrame({ANGLES: (climb_angle - gamma) * flying * level, SPEED: (V - inertial_V) * flying}, index=t_s)


def _corrected(trajectory: Trajectory, measured: _AirDataAndGps) -> _AirDataAndGps:
    """The channels corrected for the sensor errors and gusts that `measurement_model` adds to the flow."""
    t_s, x = trajectory.block_means.t_s, _states(trajectory)
    errors = NamedArrays(SENSOR_ERRORS, trajectory.sensor_errors)
    flow = NamedArrays(PREDICTED_FLOW, trajectory.predicted_flow.T)
    cos_alpha, sin_alpha = np.cos(flow.alpha_predicted), np.sin(flow.alpha_predicted)
    alpha_slope = errors.alpha_scale - 2 * errors.V_scale
    gust_V = x.gust_u * cos_alpha + x.gust_w * sin_alpha + flow.transverse_gust_variance / (2 * flow.V_predicted)
    V, alpha, beta = (_advanced(c, t_s, errors.air_data_lag) for c in (measured.V, measured.alpha, measured.beta))
    return _AirDataAndGps(
        V - (errors.V_scale + flow.dlnV_dlndp_alpha * alpha_slope) * flow.V_predicted + gust_V,
        alpha
        - errors.alpha_bias
        - alpha_slope * flow.alpha_predicted
        - (x.gust_u * sin_alpha - x.gust_w * cos_alpha) / flow.V_predicted,
        beta - errors.beta_bias + x.gust_v / flow.V_predicted,
        _advanced(measured.gps_north, t_s, errors.gps_latency),
        _advanced(measured.gps_east, t_s, errors.gps_latency),
    )


def _states(trajectory: Trajectory) -> NamedArrays:
    return NamedArrays(STATES, trajectory.states[list(STATES)].to_numpy().T)


def _moving_average(values: Array, t_s: Array) -> Array:
    """Means over PREDICTION.slow_s about each instant; NaN where any value in the window is missing."""
    window = 2 * round(PREDICTION.slow_s / (t_s[1] - t_s[0]) / 2) + 1
    return pd.Series(values).rolling(window, center=True).mean().to_numpy()


def _advanced(values: Array, t_s: Array, lag_s: float) -> Array:
    """Return a channel with its lag removed; NaN stays in place."""
    finite = np.isfinite(values)
    if not finite.any():
        return values
    return np.where(finite, np.interp(t_s + lag_s, t_s[finite], values[finite]), np.nan)


SHIFTED_CHANNELS = {"air_data_lag": "the probe", "gps_latency": "GPS"}


class TimeShift(NamedTuple):
    """Delay of channels against the inertial sensors, and its standard error [s]. error: key of SHIFTED_CHANNELS."""

    error: str
    delay_s: float
    standard_error_s: float
    determined: bool  # by this flight, not only by the prior

    @property
    def significant(self) -> bool:
        return abs(self.delay_s) > max(STATISTICS.sigmas * self.standard_error_s, CONSISTENCY.least_shift_s)

    def in_words(self) -> str:
        """Return "GPS is 212 ± 3 ms late against the IMU.", or say that the flight does not show the shift."""
        name = SHIFTED_CHANNELS[self.error]
        if not self.determined:
            return f"This flight does not show how late {name} is against the IMU."
        shift = f"{1e3 * abs(self.delay_s):.0f} ± {1e3 * self.standard_error_s:.0f} ms"
        side = "late" if self.delay_s >= 0 else "early"
        return f"{name[0].upper()}{name[1:]} is {shift} {side} against the IMU."


def time_shifts(trajectory: Trajectory) -> list[TimeShift]:
    """The time shifts of a reconstructed flight."""
    return [_time_shift(trajectory, name) for name in SHIFTED_CHANNELS]


def _time_shift(trajectory: Trajectory, name: str) -> TimeShift:
    error = trajectory.standard_error(name)
    determined = error < STATISTICS.determined_share * trajectory.prior_standard_error(name)
    return TimeShift(name, trajectory.value(name), error, determined)


def time_shift_notes(trajectory: Trajectory) -> list[str]:
    """Return a note on a significant time shift of the probe; none on GPS, whose latency is normal."""
    shift = _time_shift(trajectory, "air_data_lag")
    if not (shift.determined and shift.significant):
        return []
    return [
        f"{shift.in_words()} The analysis corrects for it. Check the tube lengths in the aircraft file, or the log"
        " times; `calibrate tubing` measures the lag."
    ]


class AirspeedCalibration(NamedTuple):
    """scale: fraction by which airspeed reads high, and its standard error; wind: mean over the flight [m/s]."""

    scale: float
    scale_error: float
    wind_mps: float
    wind_from_deg: float
    one_way: float  # length of the mean heading vector: 0 for evenly distributed headings, 1 for a single one
    notes: list[str]
    unsupported: str  # why the flight does not determine the scale, and what to fly; empty if it does


def why_not_determined(error: float, prior: float) -> str:
    """Why a flight does not determine the scale, and what to fly; empty if it does. Both are standard errors."""
    if error <= STATISTICS.determined_share * prior:
        return ""
    return (
        f"the flight does not determine the scale (standard error {100 * error:.1f} %, before the flight"
        f" {100 * prior:.1f} %): fly legs of half a minute there and back, with GPS"
    )


def notes_on(one_way: float, error: float, prior: float) -> list[str]:
    """Return notes on what limits the scale. one_way: length of the mean heading vector; error, prior: standard errors
    of the scale after and before the flight."""
    notes = []
    if one_way > SHOWN.one_heading:
        notes.append(
            "Nearly all was flown in one direction: scale and wind along it cannot be separated. Fly back as well."
        )
    if error > STATISTICS.determined_share * prior:
        notes.append(
            f"This flight hardly determines the scale: standard error {100 * error:.1f} %,"
            f" before the flight {100 * prior:.1f} %."
        )
    return notes


def calibrate(table: pd.DataFrame, trajectory: Trajectory) -> AirspeedCalibration:
    """Airspeed scale and wind of a reconstructed flight. table: as `air_data` returns it."""
    flying = table["flying"].to_numpy()[trajectory.block_means.rows]
    heading = trajectory.states["psi"].to_numpy()[flying]
    north, east = (trajectory.states[f"wind_{axis}"].to_numpy()[flying].mean() for axis in ("north", "east"))
    one_way = float(abs(np.mean(np.exp(1j * heading)))) if len(heading) else 1.0
    error = trajectory.standard_error("V_scale")
    prior = trajectory.prior_standard_error("V_scale")
    notes = []
    if not trajectory.block_means.measured("gps_north_mps"):
        notes.append("No GPS in this log: neither scale nor wind can be determined.")
        notes += notes_on(0.0, error, prior)
    else:
        notes += notes_on(one_way, error, prior)
    if not trajectory.converged:
        notes.append("The trajectory reconstruction did not converge: do not rely on these values.")
    if not trajectory.converged:
        unsupported = "the trajectory reconstruction did not converge"
    elif not trajectory.block_means.measured("gps_north_mps"):
        unsupported = "no GPS in this log, so wind and scale are not determined: fly with GPS"
    else:
        unsupported = why_not_determined(error, prior)
    return AirspeedCalibration(
        scale=trajectory.value("V_scale"),
        scale_error=error,
        wind_mps=float(np.hypot(north, east)),
        wind_from_deg=float(np.degrees(np.arctan2(-east, -north)) % 360),
        one_way=one_way,
        notes=notes,
        unsupported=unsupported,
    )
