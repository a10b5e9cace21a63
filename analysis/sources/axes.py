"""Axes and signs that only motion shows: angular rate, angle of attack, sideslip and GPS velocity, from the air data.

Each is compared with another sensor by a law of mechanics. The limits were tried on simulated flights of all plans and
aircraft, also with large sensor errors and in 15 kt of turbulence; the figures are those of the worst of them.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.sources.check_settings import AXES
from flightpower.analysis.sources.grid_settings import CHANNELS, REST, STATISTICS
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2


class _Law(NamedTuple):
    """Two quantities (n,) of the means that a law of mechanics lets rise together.

    least : correlation below which one of them has the wrong sign. spread : standard deviation of the second one, in
    its unit, below which nothing is judged. remedy : for the user.
    """

    first: Callable[[pd.DataFrame], pd.Series]
    second: Callable[[pd.DataFrame], pd.Series]
    least: float
    spread: float
    remedy: str


def _lift(means: pd.DataFrame) -> pd.Series:
    """Lift coefficient over its mean."""
    lift = -means["az_mps2"] / means["qbar_Pa"]
    return lift / lift.mean()


def _forward_force(means: pd.DataFrame) -> pd.Series:
    """Specific force along the flight path."""
    return pd.Series(means["ax_mps2"] * np.cos(means["alpha_rad"]) + means["az_mps2"] * np.sin(means["alpha_rad"]))


def _gain(means: pd.DataFrame) -> pd.Series:
    """Gain of speed, and the share of gravity in a climb."""
    V = means["V_mps"]
    return (V.shift(-1) - V.shift(1)) / (2 * REST.window_s) + GRAVITY_MPS2 * means["climb_mps"] / V


def _turn(means: pd.DataFrame) -> pd.Series:
    """Rate of the course over ground."""
    course = pd.Series(np.arctan2(means["gps_east_mps"], means["gps_north_mps"]), means.index)
    change = course.shift(-1) - course.shift(1)
    return pd.Series(np.arctan2(np.sin(change), np.cos(change)), means.index) / (2 * REST.window_s)


def _bank_change(means: pd.DataFrame) -> pd.Series:
    """Change of the bank of a turn without sideslip: its sine is V r/g."""
    bank = np.arcsin((means["V_mps"] * means["r_radps"] / GRAVITY_MPS2).clip(-1, 1))
    return pd.Series(bank.shift(-1) - bank.shift(1))


PITCH = _Law(
    lambda means: means["V_mps"] * means["q_radps"], lambda means: -means["az_mps2"], *AXES.wrong_sign.pitch,
    "/imu: the nose goes down where specific_force_z_mps2 shows a pull-up: angular_rate_y_radps has the wrong sign;"
    " write it positive nose up",
)  # fmt: skip
ANGLE_OF_ATTACK = _Law(  # at a constant lift coefficient nothing correlates with it
    lambda means: means["alpha_rad"], _lift, *AXES.wrong_sign.angle_of_attack,
    "/probe/alpha: the angle of attack falls where lift rises: differential_pressure_Pa has the wrong sign; write lower"
    " minus upper port, in the calibration of the probe too",
)  # fmt: skip
FORWARD_FORCE = _Law(
    _forward_force, _gain, *AXES.wrong_sign.forward_force,
    "/imu: specific_force_x_mps2 falls where the aircraft speeds up or climbs; write it positive forward",
)  # fmt: skip
# Air from the right pushes to the left. Changes are compared: offsets of both sensors drop out. Calm flights hardly
# sideslip, and their curve does not depend on it.
SIDESLIP = _Law(
    lambda means: (means["beta_rad"] * means["qbar_Pa"]).diff(), lambda means: -means["ay_mps2"].diff(),
    *AXES.wrong_sign.sideslip,
    "/probe/beta: the side force points to where the air comes from: differential_pressure_Pa (right minus left port,"
    " in the probe's calibration too) or specific_force_y_mps2 of /imu (to the right) has the wrong sign",
)  # fmt: skip
CLIMB = _Law(
    lambda means: -means["gps_down_mps"], lambda means: means["climb_mps"], *AXES.wrong_sign.climb,
    "/gps: velocity_down_mps is positive where /static shows a climb: write it positive downwards",
)  # fmt: skip
COURSE = _Law(  # in a turn the course turns as the nose does
    lambda means: means["r_radps"], _turn, *AXES.wrong_sign.course,
    "/imu and /gps: angular_rate_z_radps turns against the course of velocity_north_mps and velocity_east_mps: the rate"
    " is not positive to the right, or north and east are exchanged",
)  # fmt: skip
ROLL = _Law(
    lambda means: means["p_radps"], _bank_change, *AXES.wrong_sign.roll,
    "/imu: the aircraft rolls out of the turns that angular_rate_z_radps shows: angular_rate_x_radps has the wrong"
    " sign; write it positive right wing down",
)  # fmt: skip


def check_axes(table: pd.DataFrame, log: str) -> None:
    """Raises InputError naming the log if an axis, sign or unit contradicts the motion of the aircraft.

    table: of `air_data`. Nothing is judged by less than STATISTICS.fewest_values of flight.
    """
    flown = table["flying"] & (table["qbar_Pa"] > table["qbar_Pa"].quantile(AXES.slowest_share))
    means = _means(table, flown, REST.window_s)
    if means["V_mps"].notna().sum() < STATISTICS.fewest_values:
        return
    means = means.assign(climb_mps=_climb_mps(table)[means.index])
    _check_rate_unit(means, log)
    _check(PITCH, means, log)
    _check_side_ports(means, log)
    _check(ANGLE_OF_ATTACK, means, log)
    _check(FORWARD_FORCE, means, log)
    _check(SIDESLIP, _means(table, flown, CHANNELS.smoothing_s), log)
    _check(SIDESLIP, means, log)
    _check_ground_speed(means, log)
    for law in (CLIMB, COURSE, ROLL):
        _check(law, means, log)


def _check(law: _Law, means: pd.DataFrame, log: str) -> None:
    second = law.second(means)
    if (law.spread == 0 or second.std() > law.spread) and _correlation(law.first(means), second) < law.least:
        raise InputError(f"{log}: {law.remedy}")


def _check_rate_unit(means: pd.DataFrame, log: str) -> None:
    """V times pitch and yaw rate is acceleration, which specific force and gravity supply: at most |f| + g."""
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
    """More lift needs more angle of attack: the pressure of alpha follows it, that of beta does not."""
    lift = _lift(means)
    if not lift.std() > ANGLE_OF_ATTACK.spread:
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
    if abs(alpha) > -ANGLE_OF_ATTACK.least and abs(slope) < least_slope:
        raise InputError(
            f"{log}: /probe/alpha: differential_pressure_Pa changes with the lift, but by {slope:+.4f} of that of"
            " /probe/airspeed only: is it in hPa (mbar), kPa or inches of water?"
        )


def _check_ground_speed(means: pd.DataFrame, log: str) -> None:
    """The ground speed is airspeed and wind."""
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
    """Climb rate by the barometer over REST.window_s on both sides."""
    step_s = float(table.index[1] - table.index[0])
    n = max(1, round(REST.window_s / step_s))
    height = table["height_m"].rolling(n, center=True, min_periods=1).mean()
    return (height.shift(-n) - height.shift(n)) / (2 * n * step_s)


def _means(table: pd.DataFrame, rows: pd.Series, seconds: float) -> pd.DataFrame:
    """Means over `seconds`, of those stretches all of whose rows count; the others are NaN."""
    n = max(1, round(seconds / float(table.index[1] - table.index[0])))
    counting = table.where(rows)
    # The stretches are centered at rows 0, n, 2 n, …; the first and the last one are not whole.
    before = n // 2
    after = -(before + len(table)) % n
    padded = np.pad(counting.to_numpy(dtype=float), ((before, after), (0, 0)), constant_values=np.nan)
    means = padded.reshape(-1, n, table.shape[1]).mean(axis=1)
    times_s = table.index[::n]
    return pd.DataFrame(means[: len(times_s)], times_s, table.columns)


def _correlation(x: pd.Series, y: pd.Series) -> float:
    """0 where it is not known."""
    known = x.notna() & y.notna()
    if known.sum() < STATISTICS.fewest_values or x[known].std() == 0 or y[known].std() == 0:
        return 0.0
    return float(np.corrcoef(x[known], y[known])[0, 1])
