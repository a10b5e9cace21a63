"""Checks axes and signs that only motion reveals: angular rate, angle of attack, sideslip and GPS velocity.

A law of mechanics compares each with another sensor. The limits were tested on simulated flights of all plans and
aircraft, including large sensor errors and 15 kt turbulence; the figures are from the worst of these flights.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.sources.check_settings import AXES
from flightpower.analysis.sources.grid_settings import CHANNELS, REST, STATISTICS
from flightpower.analysis.sources.motion import SIDES, Motion, Signals
from flightpower.analysis.sources.quantities import Quantity
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2

Q = Quantity


class _Limit(NamedTuple):
    """Limits beyond which the signs in a log contradict a law of `motion`.

    least : correlation below which one side of the law has the wrong sign. spread : standard deviation of the second
    side, in its unit, up to which the law is not judged. remedy : message for the user.
    """

    least: float
    spread: float
    remedy: str


LIMITS = {
    Motion.PULL_UP: _Limit(
        *AXES.wrong_sign.pitch,
        "/imu: the nose goes down where specific_force_z_mps2 shows a pull-up: angular_rate_y_radps has the wrong sign;"
        " write it positive nose up",
    ),
    Motion.LIFT_BY_ANGLE_OF_ATTACK: _Limit(  # nothing correlates with a constant lift coefficient
        *AXES.wrong_sign.angle_of_attack,
        "/probe/alpha: the angle of attack falls where lift rises: differential_pressure_Pa has the wrong sign; write"
        " lower minus upper port, in the calibration of the probe too",
    ),
    Motion.FORCE_ALONG_PATH: _Limit(
        *AXES.wrong_sign.forward_force,
        "/imu: specific_force_x_mps2 falls where the aircraft speeds up or climbs; write it positive forward",
    ),
    Motion.SIDE_FORCE: _Limit(  # in calm air there is hardly any sideslip, so the curve does not depend on it
        *AXES.wrong_sign.sideslip,
        "/probe/beta: the side force points to where the air comes from: differential_pressure_Pa (right minus left"
        " port, in the probe's calibration too) or specific_force_y_mps2 of /imu (to the right) has the wrong sign",
    ),
    Motion.CLIMB: _Limit(
        *AXES.wrong_sign.climb,
        "/gps: velocity_down_mps is positive where /static shows a climb: write it positive downwards",
    ),
    Motion.COURSE_IN_TURN: _Limit(  # in a turn the course changes in the same direction as the nose
        *AXES.wrong_sign.course,
        "/imu and /gps: angular_rate_z_radps turns against the course of velocity_north_mps and velocity_east_mps: the"
        " rate is not positive to the right, or north and east are exchanged",
    ),
    Motion.BANK_OF_TURN: _Limit(
        *AXES.wrong_sign.roll,
        "/imu: the aircraft rolls out of the turns that angular_rate_z_radps shows: angular_rate_x_radps has the wrong"
        " sign; write it positive right wing down",
    ),
}
COLUMNS = {
    Q.FORCE_FORWARD: "ax_mps2", Q.FORCE_RIGHT: "ay_mps2", Q.FORCE_DOWN: "az_mps2", Q.ROLL_RATE: "p_radps",
    Q.PITCH_RATE: "q_radps", Q.YAW_RATE: "r_radps", Q.ANGLE_OF_ATTACK: "alpha_rad", Q.SIDESLIP: "beta_rad",
    Q.VELOCITY_DOWN: "gps_down_mps",
}  # fmt: skip


class _Means(Signals):
    """The quantities in a table of means over stretches of flight."""

    def __init__(self, means: pd.DataFrame):
        self._means = means
        self._step_s = float(means.index[1] - means.index[0])

    def __getitem__(self, quantity: Quantity) -> Array | None:
        return self._column(COLUMNS[quantity]) if quantity in COLUMNS else None

    def true_airspeed(self) -> Array:
        return self._column("V_mps")

    def pressure_of_flight(self) -> Array:
        return self._column("qbar_Pa")

    def climb(self) -> Array:
        return self._column("climb_mps")

    def turn_rate(self) -> Array:
        turned = self.change(np.arctan2(self._column("gps_east_mps"), self._column("gps_north_mps")), 2)
        return np.asarray(np.arctan2(np.sin(turned), np.cos(turned)) / (2 * self._step_s))

    def rate(self, value: Array) -> Array:
        return self.change(value, 2) / (2 * self._step_s)

    def change(self, value: Array, samples: int = 1) -> Array:
        """Return the change from the sample before to each sample, or for samples=2 to the sample after it."""
        change = np.full(len(value), np.nan)
        late = samples // 2
        change[samples - late : len(value) - late] = value[samples:] - value[:-samples]
        return change

    def _column(self, name: str) -> Array:
        return self._means[name].to_numpy()


def check_axes(table: pd.DataFrame, log: str) -> None:
    """Raises InputError naming the log if an axis, sign or unit contradicts the motion of the aircraft.

    table: from `air_data`. Nothing is judged from fewer than STATISTICS.fewest_values means of flight.
    """
    flown = table["flying"] & (table["qbar_Pa"] > table["qbar_Pa"].quantile(AXES.slowest_share))
    means = _means(table, flown, REST.window_s)
    if means["V_mps"].notna().sum() < STATISTICS.fewest_values:
        return
    means = means.assign(climb_mps=_climb_mps(table)[means.index])
    signals = _Means(means)
    _check_rate_unit(means, log)
    _check(Motion.PULL_UP, signals, log)
    _check_side_ports(means, log)
    _check(Motion.LIFT_BY_ANGLE_OF_ATTACK, signals, log)
    _check(Motion.FORCE_ALONG_PATH, signals, log)
    _check(Motion.SIDE_FORCE, _Means(_means(table, flown, CHANNELS.smoothing_s)), log)
    _check(Motion.SIDE_FORCE, signals, log)
    _check_ground_speed(means, log)
    for law in (Motion.CLIMB, Motion.COURSE_IN_TURN, Motion.BANK_OF_TURN):
        _check(law, signals, log)


def _check(law: Motion, signals: Signals, log: str) -> None:
    limit, (first, second) = LIMITS[law], SIDES[law](signals)
    if law is Motion.LIFT_BY_ANGLE_OF_ATTACK:
        second = _over_mean(second)
    varies = limit.spread == 0 or pd.Series(second).std() > limit.spread
    if varies and _correlation(pd.Series(first), pd.Series(second)) < limit.least:
        raise InputError(f"{log}: {limit.remedy}")


def _over_mean(value: Array) -> Array:
    return np.asarray(value / pd.Series(value).mean())


def _check_rate_unit(means: pd.DataFrame, log: str) -> None:
    """Check that V times pitch and yaw rate, an acceleration, is at most |f| + g, all that force and gravity supply."""
    force = np.sqrt(sum(means[f"a{axis}_mps2"] ** 2 for axis in "xyz"))
    needed = means["V_mps"] * np.hypot(means["q_radps"], means["r_radps"])
    slack_mps2, most_exceeded = AXES.rate_unit
    exceeded = float((needed > force + GRAVITY_MPS2 + slack_mps2)[needed.notna()].mean())
    if exceeded > most_exceeded:
        raise InputError(
            f"{log}: /imu: angular_rate_y_radps and angular_rate_z_radps are too large for the specific force in"
            f" {100 * exceeded:.0f} % of the flight: they look like degrees per second; multiply by 0.0174533"
        )


def _check_side_ports(means: pd.DataFrame, log: str) -> None:
    """Check that the pressure of alpha follows the lift, as angle of attack does, and that of beta does not."""
    _, lift_coefficient = SIDES[Motion.LIFT_BY_ANGLE_OF_ATTACK](_Means(means))
    limit, lift = LIMITS[Motion.LIFT_BY_ANGLE_OF_ATTACK], pd.Series(_over_mean(lift_coefficient), means.index)
    if not lift.std() > limit.spread:
        return
    ratio = {name: means[f"dp_{name}_Pa"] / means["q_c_Pa"] for name in ("alpha", "beta")}
    alpha, beta = (_correlation(ratio[name], lift) for name in ("alpha", "beta"))
    least, more, least_slope = AXES.side_ports
    if abs(beta) > max(least, abs(alpha) + more):
        raise InputError(
            f"{log}: /probe/alpha and /probe/beta: differential_pressure_Pa of beta follows the lift (correlation"
            f" {beta:+.2f}), that of alpha does not ({alpha:+.2f}): the topics or tubes are exchanged"
        )
    slope = alpha * float(ratio["alpha"].std() / lift.std())
    if abs(alpha) > -limit.least and abs(slope) < least_slope:
        raise InputError(
            f"{log}: /probe/alpha: differential_pressure_Pa changes with the lift, but by {slope:+.4f} of that of"
            " /probe/airspeed only: is it in hPa (mbar), kPa or inches of water?"
        )


def _check_ground_speed(means: pd.DataFrame, log: str) -> None:
    """Check that the ground speed is plausible for the airspeed."""
    if means["gps_north_mps"].notna().sum() < STATISTICS.fewest_values:
        return
    ground = float(np.nanmedian(np.hypot(means["gps_north_mps"], means["gps_east_mps"])))
    ratio = ground / float(means["V_mps"].median())
    least, largest = AXES.ground_speed
    if ratio > largest or ratio < least:
        factors = {"km/h": 1 / 3.6, "cm/s": 0.01, "mm/s": 0.001}
        near = [unit for unit, factor in factors.items() if 0.5 < ratio * factor < 1.5]
        remedy = f"it looks like {near[0]}; multiply by {factors[near[0]]:.4g}" if near else "write m/s"
        raise InputError(
            f"{log}: /gps: velocity_north_mps and velocity_east_mps make {ground:.3g} m/s (median of the flight) at"
            f" {ground / ratio:.1f} m/s of airspeed: {remedy}"
        )


def _climb_mps(table: pd.DataFrame) -> pd.Series:
    """Return the barometric climb rate [m/s] from means over REST.window_s on either side of each row."""
    step_s = float(table.index[1] - table.index[0])
    n = max(1, round(REST.window_s / step_s))
    height = table["height_m"].rolling(n, center=True, min_periods=1).mean()
    return (height.shift(-n) - height.shift(n)) / (2 * n * step_s)


def _means(table: pd.DataFrame, rows: pd.Series, seconds: float) -> pd.DataFrame:
    """Return means over stretches of `seconds`; a stretch is NaN unless all of its rows are in `rows`."""
    n = max(1, round(seconds / float(table.index[1] - table.index[0])))
    counting = table.where(rows)
    # The stretches are centered at rows 0, n, 2 n, …; the first and the last stretch may be incomplete.
    before = n // 2
    after = -(before + len(table)) % n
    padded = np.pad(counting.to_numpy(dtype=float), ((before, after), (0, 0)), constant_values=np.nan)
    means = padded.reshape(-1, n, table.shape[1]).mean(axis=1)
    times_s = table.index[::n]
    return pd.DataFrame(means[: len(times_s)], times_s, table.columns)


def _correlation(x: pd.Series, y: pd.Series) -> float:
    """Return the correlation; 0 if there are too few values or one of them is constant."""
    finite = x.notna() & y.notna()
    if finite.sum() < STATISTICS.fewest_values or x[finite].std() == 0 or y[finite].std() == 0:
        return 0.0
    return float(np.corrcoef(x[finite], y[finite])[0, 1])
