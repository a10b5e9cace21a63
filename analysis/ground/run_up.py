"""A strapped run-up of the motor: what its vibration adds to the accelerometer, the motor's constant, the battery.

The log has stretches of held motor speed n. On the strapped aircraft the mean specific force changes with n for two
reasons: the accelerometer's zero moves with vibration, in proportion to n^2 as the force of an imbalance does, and
the aircraft leans as the thrust pulls at its straps. How far it leans follows from the gyros between the stretches;
their zeros are those of the stretches before and after, in which the aircraft does not turn. What remains is fitted by
a constant, a drift in time and a term in n^2, for each axis; the residuals give its error.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pandas as pd

from analysis.airdata.settings import GROUND, STAND_LIMITS
from analysis.airdata.transducers import steady_stretches
from analysis.ground.settings import RUN_UP
from analysis.ground.thrust_stand import StandReadings, student_fit
from analysis.signals.settings import STATISTICS
from flight.aircraft import VIBRATION_REVPS, Propulsion
from flight.arrays import Array
from flight.atmosphere import density
from flight.errors import InputError
from flight.motion import body_from_earth
from flight.units import GRAVITY_MPS2

FORCES, RATES = ("ax_mps2", "ay_mps2", "az_mps2"), ("p_radps", "q_radps", "r_radps")


class HeldSpeed(NamedTuple):
    """A motor speed that was held: rows of the table, and means over them; 0 rev/s with the motor stopped."""

    rows: slice
    time_s: float
    revps: float
    mean: pd.Series


class VibrationOffset(NamedTuple):
    """What the accelerometer reads more at VIBRATION_REVPS, by axis (3,) [m/s^2], and its standard error."""

    offset_mps2: Array
    error_mps2: Array

    @property
    def sigma_in_flight_mps2(self) -> float:
        """Standard deviation of forward and downward axis in flight, where nothing holds the aircraft."""
        in_flight = np.hypot(self.error_mps2, RUN_UP.transfer * self.offset_mps2)
        return float(max(in_flight[0], in_flight[2]))


class Battery(NamedTuple):
    """Voltage without load and inner resistance, each with its standard error."""

    voltage_V: float
    voltage_error_V: float
    resistance_ohm: float
    resistance_error_ohm: float


def held_speeds(table: pd.DataFrame, source: str) -> list[HeldSpeed]:
    """Stretches of held motor speed, in order of time. table: of `signals.channels.synchronize`.

    Raises InputError where the log does not begin and end with a motor that stands, or has too few speeds.
    """
    revps = table["n_revps"].fillna(0.0).to_numpy()  # a standing motor sends no messages
    t_s = table.index.to_numpy()
    step_s = float(t_s[1] - t_s[0])
    settling = round(GROUND.reference_s / step_s)
    allowed = STAND_LIMITS.same_speed * float(revps.max())
    found = []
    for first, last in steady_stretches(revps, allowed, settling):
        rows = slice(first + settling, last + 1 - settling)
        if (last - first) * step_s >= GROUND.held_s[0]:
            held = float(revps[rows].mean())
            found.append(HeldSpeed(rows, float(t_s[rows].mean()), held, table.iloc[rows].mean()))
    turning = [one for one in found if one.revps > 0]
    if len(found) < 2 or found[0].revps > 0 or found[-1].revps > 0:
        raise InputError(f"{source}: begin and end with the motor stopped for ten seconds")
    distinct = np.diff(np.sort([one.revps for one in turning])) > allowed
    if len(turning) == 0 or distinct.sum() + 1 < STAND_LIMITS.fewest_speeds:
        raise InputError(
            f"{source}: {distinct.sum() + 1 if turning else 0} motor speeds were held for {GROUND.held_s[0]:g} s; hold"
            f" {STAND_LIMITS.fewest_speeds} or more for ten seconds each, up to full throttle and down again"
        )
    return found


def vibration_offset(table: pd.DataFrame, held: list[HeldSpeed]) -> VibrationOffset:
    """Offset of the accelerometer in proportion to the square of the motor's speed."""
    force = np.array([[one.mean[name] for name in FORCES] for one in held])
    without_lean = force - _by_lean(table, held, force[0])
    time_s = np.array([one.time_s for one in held])
    square = np.array([(one.revps / VIBRATION_REVPS) ** 2 for one in held])
    X = np.column_stack([np.ones(len(held)), (time_s - time_s.mean()) / np.ptp(time_s), square])
    by_axis = [student_fit(X, of_axis) for of_axis in without_lean.T]
    return VibrationOffset(*(np.array([values[2] for values in column]) for column in zip(*by_axis, strict=True)))


def _by_lean(table: pd.DataFrame, held: list[HeldSpeed], at_rest: Array) -> Array:
    """Change of the specific force (k, 3) in the held stretches since the first, by how the aircraft leans."""
    x, y, z = at_rest
    pitch, roll = np.arctan2(x, np.hypot(y, z)), np.arctan2(-y, -z)
    step_s = float(table.index[1] - table.index[0])
    rates, t_s = table[list(RATES)].fillna(0.0).to_numpy(), table.index.to_numpy()
    times = [one.time_s for one in held]
    zeros = np.column_stack([np.interp(t_s, times, [one.mean[name] for one in held]) for name in RATES])
    turned = np.zeros((len(held), 3))
    for i, (before, after) in enumerate(pairwise(held), start=1):
        between = slice(before.rows.stop, after.rows.start)
        turned[i] = turned[i - 1] + (rates - zeros)[between].sum(axis=0) * step_s
    # Small turns: of roll by p, of pitch by the part of q and r about the level lateral axis.
    leaned_roll = roll + turned[:, 0]
    leaned_pitch = pitch + turned[:, 1] * np.cos(roll) - turned[:, 2] * np.sin(roll)
    down = (0.0, 0.0, -GRAVITY_MPS2)
    leaned = np.column_stack(body_from_earth(down, (leaned_roll, leaned_pitch, np.zeros(len(held)))))
    return np.asarray(leaned - leaned[0])


def speed_over_constant(held: list[HeldSpeed], propulsion: Propulsion) -> float | None:
    """Motor speed at full throttle over kV (V - I R). None where it was not held, or something was not measured."""
    kv, resistance = propulsion.motor_kv_rpm_per_volt, propulsion.motor_resistance_ohm
    if kv is None or resistance is None:
        return None
    ratios = [
        60 * one.revps / (kv * (one.mean["battery_V"] - one.mean["battery_A"] * resistance))
        for one in held
        if one.mean["throttle"] >= 1 - STAND_LIMITS.same_speed
    ]
    known = [float(ratio) for ratio in ratios if np.isfinite(ratio)]
    return float(np.median(known)) if known else None


def battery(held: list[HeldSpeed]) -> Battery | None:
    """By voltage and current of the held stretches; None where these were not measured."""
    volts, amperes = (np.array([one.mean[name] for one in held]) for name in ("battery_V", "battery_A"))
    known = np.isfinite(volts) & np.isfinite(amperes)
    if known.sum() < STATISTICS.fewest_readings:
        return None
    volts, amperes = volts[known], amperes[known]
    X = np.column_stack([np.ones(len(volts)), -amperes])
    return Battery(*(float(value) for pair in zip(*student_fit(X, volts), strict=True) for value in pair))


def thrust_readings(held: list[HeldSpeed], thrust_N: list[float | None], source: str) -> StandReadings:
    """Thrust as read from a scale at each speed that was held, None where it was not read; as readings on a stand.

    Raises InputError if there is not one for each.
    """
    turning = [one for one in held if one.revps > 0]
    if len(turning) != len(thrust_N):
        raise InputError(
            f"{source}: {len(thrust_N)} readings of thrust for {len(turning)} motor speeds: {in_words(held)}; give one"
            " for each, in order, and - for one not read"
        )
    read = [(one, thrust) for one, thrust in zip(turning, thrust_N, strict=True) if thrust is not None]
    first = held[0].mean  # the tray warms up: its first temperature is that of the air
    rho = float(density(first["static_Pa"], first["static_temperature_K"]))
    return StandReadings(
        np.array([one.revps for one, _ in read]), np.array([thrust for _, thrust in read]), np.full(len(read), rho)
    )


def in_words(held: list[HeldSpeed]) -> str:
    """The speeds that were held, to be matched with the thrusts written down."""
    turning = [one for one in held if one.revps > 0]
    return ", ".join(
        f"{number}: {60 * one.revps:.0f} rpm at {one.time_s:.0f} s" for number, one in enumerate(turning, 1)
    )
