"""A strapped run-up of the motor: its vibration's effect on the accelerometer, the motor's constant, and the battery.

The log has stretches of held motor speed n. On the strapped aircraft the mean specific force changes with n for two
reasons: vibration moves the accelerometer's zero, in proportion to n^2 like the force of an imbalance, and the aircraft
leans as its thrust pulls on the straps. The gyros show how far it leans between stretches; their zeros come from the
stretches before and after, in which the aircraft does not turn. For each axis, a constant, a drift in time and a term
in n^2 are fitted to the remaining force; the residuals give the error.
"""

from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np
import pandas as pd
import typer

from flightpower.analysis.air.settings import GROUND, STAND_LIMITS
from flightpower.analysis.air.transducers import steady_stretches
from flightpower.analysis.calibrations.runner import AircraftFileLines, Calibrated, LogFile, calibration
from flightpower.analysis.calibrations.settings import RUN_UP
from flightpower.analysis.calibrations.thrust import ScaleErrorOption, StandReadings, doubts, student_fit
from flightpower.analysis.calibrations.thrust import summary as thrust_summary
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.sources.rest import FORCES
from flightpower.flight.aircraft import VIBRATION_REVPS, Aircraft, Propulsion
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import density
from flightpower.flight.command_line import numbers_and_unit
from flightpower.flight.errors import InputError
from flightpower.flight.motion import body_from_earth
from flightpower.flight.units import GRAVITY_MPS2, to_si

if TYPE_CHECKING:
    from flightpower.analysis.air.thrust_stand import ThrustStand

RATES = ("p_radps", "q_radps", "r_radps")


class HeldSpeed(NamedTuple):
    """A motor speed that was held: its rows in the table, and means over them. It is 0 rev/s with the motor stopped."""

    rows: slice
    time_s: float
    revps: float
    mean: pd.Series


class VibrationOffset(NamedTuple):
    """The accelerometer's offset due to vibration at VIBRATION_REVPS, by axis (3,) [m/s^2], and its standard error."""

    offset_mps2: Array
    error_mps2: Array

    @property
    def sigma_in_flight_mps2(self) -> float:
        """Larger standard deviation of the forward and down offsets in flight, where nothing holds the aircraft."""
        in_flight = np.hypot(self.error_mps2, RUN_UP.transfer * self.offset_mps2)
        return float(max(in_flight[0], in_flight[2]))


class Battery(NamedTuple):
    """Voltage without load and inner resistance, each with its standard error."""

    voltage_V: float
    voltage_error_V: float
    resistance_ohm: float
    resistance_error_ohm: float


def held_speeds(table: pd.DataFrame, source: str) -> list[HeldSpeed]:
    """Return the stretches of held motor speed, in order of time. table: from `sources.daemon.synchronize`.

    Raises InputError if the log does not begin and end with the motor stopped, or has too few speeds.
    """
    revps = table["n_revps"].fillna(0.0).to_numpy()  # a stopped motor sends no messages
    t_s = table.index.to_numpy()
    step_s = float(t_s[1] - t_s[0])
    settling = round(GROUND.reference_s / step_s)
    allowed = STAND_LIMITS.same_speed * float(revps.max())
    speeds = []
    for first, last in steady_stretches(revps, allowed, settling):
        rows = slice(first + settling, last + 1 - settling)
        if (last - first) * step_s >= GROUND.held_s[0]:
            held_speed = float(revps[rows].mean())
            speeds.append(HeldSpeed(rows, float(t_s[rows].mean()), held_speed, table.iloc[rows].mean()))
    turning = [held_speed for held_speed in speeds if held_speed.revps > 0]
    if len(speeds) < 2 or speeds[0].revps > 0 or speeds[-1].revps > 0:
        raise InputError(f"{source}: begin and end with the motor stopped for ten seconds")
    distinct = np.diff(np.sort([held_speed.revps for held_speed in turning])) > allowed
    if len(turning) == 0 or distinct.sum() + 1 < STAND_LIMITS.fewest_speeds:
        raise InputError(
            f"{source}: {distinct.sum() + 1 if turning else 0} motor speeds were held for {GROUND.held_s[0]:g} s; hold"
            f" {STAND_LIMITS.fewest_speeds} or more for ten seconds each, up to full throttle and down again"
        )
    return speeds


def vibration_offset(table: pd.DataFrame, speeds: list[HeldSpeed]) -> VibrationOffset:
    """Fit the accelerometer's offset, which is proportional to the square of the motor speed."""
    force = np.array([[speed.mean[name] for name in FORCES] for speed in speeds])
    without_lean = force - _by_lean(table, speeds, force[0])
    time_s = np.array([speed.time_s for speed in speeds])
    square = np.array([(speed.revps / VIBRATION_REVPS) ** 2 for speed in speeds])
    X = np.column_stack([np.ones(len(speeds)), (time_s - time_s.mean()) / np.ptp(time_s), square])
    by_axis = [student_fit(X, of_axis) for of_axis in without_lean.T]
    return VibrationOffset(*(np.array([values[2] for values in column]) for column in zip(*by_axis, strict=True)))


def _by_lean(table: pd.DataFrame, speeds: list[HeldSpeed], at_rest: Array) -> Array:
    """Return the change of specific force (k, 3) from the first held stretch on that is due to the aircraft's lean."""
    x, y, z = at_rest
    pitch, roll = np.arctan2(x, np.hypot(y, z)), np.arctan2(-y, -z)
    step_s = float(table.index[1] - table.index[0])
    rates, t_s = table[list(RATES)].fillna(0.0).to_numpy(), table.index.to_numpy()
    times = [speed.time_s for speed in speeds]
    zeros = np.column_stack([np.interp(t_s, times, [speed.mean[name] for speed in speeds]) for name in RATES])
    turned = np.zeros((len(speeds), 3))
    for i, (before, after) in enumerate(pairwise(speeds), start=1):
        between = slice(before.rows.stop, after.rows.start)
        turned[i] = turned[i - 1] + (rates - zeros)[between].sum(axis=0) * step_s
    # The turns are small: p changes roll, and the parts of q and r about the level lateral axis change pitch.
    leaned_roll = roll + turned[:, 0]
    leaned_pitch = pitch + turned[:, 1] * np.cos(roll) - turned[:, 2] * np.sin(roll)
    down = (0.0, 0.0, -GRAVITY_MPS2)
    leaned = np.column_stack(body_from_earth(down, (leaned_roll, leaned_pitch, np.zeros(len(speeds)))))
    return np.asarray(leaned - leaned[0])


def speed_over_constant(speeds: list[HeldSpeed], propulsion: Propulsion) -> float | None:
    """Return motor speed over kV (V - I R) at full throttle; None if that was not held or a value is missing."""
    kv, resistance = propulsion.motor_kv_rpm_per_volt, propulsion.motor_resistance_ohm
    if kv is None or resistance is None:
        return None
    ratios = [
        60 * speed.revps / (kv * (speed.mean["battery_V"] - speed.mean["battery_A"] * resistance))
        for speed in speeds
        if speed.mean["throttle"] >= 1 - STAND_LIMITS.same_speed
    ]
    finite = [float(ratio) for ratio in ratios if np.isfinite(ratio)]
    return float(np.median(finite)) if finite else None


def battery(speeds: list[HeldSpeed]) -> Battery | None:
    """Fit the battery to voltage and current of the held stretches; None if too few were measured."""
    volts, amperes = (np.array([speed.mean[name] for speed in speeds]) for name in ("battery_V", "battery_A"))
    finite = np.isfinite(volts) & np.isfinite(amperes)
    if finite.sum() < STATISTICS.fewest_readings:
        return None
    volts, amperes = volts[finite], amperes[finite]
    X = np.column_stack([np.ones(len(volts)), -amperes])
    return Battery(*(float(value) for pair in zip(*student_fit(X, volts), strict=True) for value in pair))


def thrust_readings(speeds: list[HeldSpeed], thrust_N: list[float | None], source: str) -> StandReadings:
    """Turn thrusts read from a scale, one per held motor speed and None if not read, into readings on a stand.

    Raises InputError if the number of thrusts is not that of the motor speeds.
    """
    turning = [speed for speed in speeds if speed.revps > 0]
    if len(turning) != len(thrust_N):
        raise InputError(
            f"{source}: {len(thrust_N)} readings of thrust for {len(turning)} motor speeds: {in_words(speeds)}; give"
            " one for each, in order, and - for a missing one"
        )
    read = [(speed, thrust) for speed, thrust in zip(turning, thrust_N, strict=True) if thrust is not None]
    first = speeds[0].mean  # only the first temperature is the air's, because the tray warms up
    rho = float(density(first["static_Pa"], first["static_temperature_K"]))
    return StandReadings(
        np.array([speed.revps for speed, _ in read]), np.array([thrust for _, thrust in read]), np.full(len(read), rho)
    )


def in_words(speeds: list[HeldSpeed]) -> str:
    """Return a list of the held speeds, for the user to match with the thrusts written down."""
    turning = [speed for speed in speeds if speed.revps > 0]
    return ", ".join(
        f"{number}: {60 * speed.revps:.0f} rpm at {speed.time_s:.0f} s" for number, speed in enumerate(turning, 1)
    )


UNCHECKED = (
    "the number of poles was not checked: that needs full throttle, and throttle, voltage and current in the log, and"
    " motor_kv_rpm_per_volt and motor_resistance in its aircraft file"
)


EXAMPLE = '"6.1 12 - 27 12.1 6 N"'


@calibration(AircraftFileLines)
def run_up(
    log: LogFile,
    thrust: Annotated[
        str,
        typer.Option(
            "--thrust",
            metavar="LIST",
            help="Thrust read from a scale between tail and strap at each motor speed, in order, with its unit at the"
            f" end, and - for a missing one: {EXAMPLE}.",
        ),
    ] = "",
    scale_error: ScaleErrorOption = 1.0,
) -> Calibrated:
    """Run the motor up on the strapped aircraft: vibration on the accelerometer, the motor's constant, the battery.

    Strap the aircraft down outdoors, out of the wind, tail to a post, with a scale in between if you have one, and stay
    clear of the propeller. Start the daemon and let all stand still for ten seconds. Hold three motor speeds or more
    for ten seconds each, up to full throttle and down again, and write the thrusts down. Stop the motor for ten
    seconds.

    Vibration moves the zero of an accelerometer, in proportion to the square of the motor's speed; level flight cannot
    separate that from drag. The lines printed for the aircraft file correct for it, and say how well. Motor speed at
    full throttle is compared with kV (V - I R): the number of poles is wrong if the two differ by a tenth. Voltage
    against current gives the battery's resistance; thrust gives the same as `calibrate thrust`.

    Run this command without --thrust first: it lists the speeds found. Exit code 1 and no lines if the motor's speed
    contradicts its constant; exit code 2 if too few speeds were held.

    To rehearse it: `sim fly --plan run-up -o out/run-up`.

    \b
    Examples:
      calibrate run-up log.mcap
      calibrate run-up log.mcap --thrust "4.9 9.1 16 23 16 9 4.8 N"
    """
    from flightpower.analysis.air.contents import aircraft_of, propeller_of
    from flightpower.analysis.calibrations.thrust import calibrate
    from flightpower.analysis.results.settings import TRUST
    from flightpower.analysis.sources.daemon import synchronize
    from flightpower.flight.log_reader import read_log

    read = thrusts_N(thrust)
    recorded = read_log(log)
    aircraft, table = aircraft_of(recorded), synchronize(recorded).table
    speeds = held_speeds(table, str(log))
    offset, fitted = vibration_offset(table, speeds), battery(speeds)
    ratio = speed_over_constant(speeds, aircraft.propulsion)
    lines = [f"motor speeds held: {in_words(speeds)}", *summary(offset, fitted, ratio)]
    warnings, stand, unsupported = [], None, ""
    if ratio is None:
        warnings.append(UNCHECKED)
    elif abs(ratio - 1) > TRUST.motor_constant:
        unsupported = wrong_speed(ratio, aircraft)
    if read:
        propeller = propeller_of(recorded, aircraft)
        readings = thrust_readings(speeds, read, str(log))
        stand, not_known = calibrate(readings, propeller, scale_error / 100, log.name)
        lines += thrust_summary(stand)
        warnings += doubts(stand, readings, propeller, aircraft)
        unsupported = unsupported or not_known
    return Calibrated(lines, to_toml(offset, fitted, stand), warnings=warnings, unsupported=unsupported)


def thrusts_N(text: str) -> list[float | None]:
    """Return the thrusts [N] in a list that ends with its unit; None for -. Raises InputError naming --thrust."""
    numbers, unit = numbers_and_unit(text, "--thrust", EXAMPLE)
    values = [None if word == "-" else to_si(f"{word} {unit}", "N", "--thrust") for word in numbers]
    if numbers and (not any(values) or not all(value is None or value > 0 for value in values)):
        raise InputError(f"--thrust {text!r}: positive numbers and their unit are needed, such as {EXAMPLE}")
    return values


def wrong_speed(ratio: float, aircraft: Aircraft) -> str:
    """Return text on how the motor speed contradicts its constant, and a number of poles that would agree."""
    fact = f"motor speed at full throttle is {ratio:.2f} times kV (V - I R)"
    pairs = aircraft.propulsion.pole_pairs
    if pairs is None or round(pairs * ratio) == pairs:
        return f"{fact}: check the number of poles, kV, resistance and the power module"
    return f"{fact}: the motor has {2 * round(pairs * ratio)} poles rather than {2 * pairs}, or kV or voltage are wrong"


def summary(offset: "VibrationOffset", battery: "Battery | None", ratio: float | None) -> list[str]:
    """Return the result as lines of text."""
    from flightpower.analysis.estimation.noise import NORMAL_95

    axes = ", ".join(
        f"{axis} {value:+.3f} ± {NORMAL_95 * error:.3f}"
        for axis, value, error in zip(("forward", "right", "down"), *offset, strict=True)
    )
    lines = [f"offset of the accelerometer at 100 rev/s, m/s² (95 % interval): {axes}"]
    if ratio is not None:
        lines.append(f"motor speed at full throttle is {ratio:.3f} times kV (V - I R)")
    if battery is not None:
        lines.append(
            f"battery {battery.voltage_V:.2f} ± {NORMAL_95 * battery.voltage_error_V:.2f} V without load,"
            f" {1e3 * battery.resistance_ohm:.1f} ± {1e3 * NORMAL_95 * battery.resistance_error_ohm:.1f} mohm"
        )
    return lines


def to_toml(offset: "VibrationOffset", battery: "Battery | None", stand: "ThrustStand | None") -> str:
    """Return the result as sections of an aircraft file."""
    vector = ", ".join(f'"{value:.3f} m/s^2"' for value in offset.offset_mps2)
    propulsion, uncertainty = [], [f'accelerometer_vibration = "{offset.sigma_in_flight_mps2:.2g} m/s^2"']
    if battery is not None:
        propulsion.append(f'battery_resistance = "{battery.resistance_ohm:.4f} ohm"')
    if stand is not None:
        propulsion.append(f"static_thrust_ratio = {stand.ratio:.4f}")
        uncertainty.append(f'static_thrust_ratio = "{100 * stand.ratio_error / stand.ratio:.2g} %"')
    sections = {
        "installation": [f"accelerometer_vibration = [{vector}]"], "propulsion": propulsion, "uncertainty": uncertainty
    }  # fmt: skip
    return "\n".join(
        f"[{name}]\n" + "".join(f"{line}\n" for line in lines) for name, lines in sections.items() if lines
    )
