"""`calibrate run-up`"""

from typing import TYPE_CHECKING, Annotated

import typer

from analysis.cli.calibrate.runner import AircraftFileLines, Calibrated, LogFile, calibration
from analysis.cli.calibrate.thrust import ScaleErrorOption, doubts
from analysis.cli.calibrate.thrust import summary as thrust_summary
from flight.aircraft import Aircraft
from flight.command_line import numbers_and_unit
from flight.errors import InputError
from flight.units import to_si

if TYPE_CHECKING:
    from analysis.airdata.thrust_stand import ThrustStand
    from analysis.ground.run_up import Battery, VibrationOffset

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
            f" end, and - for one not read: {EXAMPLE}.",
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
    tell that from drag. The lines printed for the aircraft file correct for it, and say how well. Motor speed at full
    throttle is compared with kV (V - I R): the number of poles is wrong if the two differ by a tenth. Voltage against
    current gives the battery's resistance; thrust gives the same as `calibrate thrust`.

    Run this command without --thrust first: it lists the speeds found. Exit code 1 and no lines if the motor's speed
    contradicts its constant; exit code 2 if too few speeds were held.

    To rehearse it: `sim fly --plan run-up -o out/run-up`.

    \b
    Examples:
      calibrate run-up log.mcap
      calibrate run-up log.mcap --thrust "4.9 9.1 16 23 16 9 4.8 N"
    """
    from analysis.ground import run_up as computation
    from analysis.ground.thrust_stand import calibrate
    from analysis.log_contents import aircraft_of, propeller_of
    from analysis.results.settings import TRUST
    from analysis.signals.channels import synchronize
    from flight.log_reader import read_log

    read = thrusts_N(thrust)
    recorded = read_log(log)
    aircraft, table = aircraft_of(recorded), synchronize(recorded).table
    held = computation.held_speeds(table, str(log))
    offset, battery = computation.vibration_offset(table, held), computation.battery(held)
    ratio = computation.speed_over_constant(held, aircraft.propulsion)
    lines = [f"motor speeds held: {computation.in_words(held)}", *summary(offset, battery, ratio)]
    warnings, stand, unsupported = [], None, ""
    if ratio is None:
        warnings.append(UNCHECKED)
    elif abs(ratio - 1) > TRUST.motor_constant:
        unsupported = wrong_speed(ratio, aircraft)
    if read:
        propeller = propeller_of(recorded, aircraft)
        readings = computation.thrust_readings(held, read, str(log))
        stand, not_known = calibrate(readings, propeller, scale_error / 100, log.name)
        lines += thrust_summary(stand)
        warnings += doubts(stand, readings, propeller, aircraft)
        unsupported = unsupported or not_known
    return Calibrated(lines, to_toml(offset, battery, stand), warnings=warnings, unsupported=unsupported)


def thrusts_N(text: str) -> list[float | None]:
    """Thrusts [N] of a list with its unit at the end; None for -. Raises InputError naming --thrust."""
    numbers, unit = numbers_and_unit(text, "--thrust", EXAMPLE)
    values = [None if word == "-" else to_si(f"{word} {unit}", "N", "--thrust") for word in numbers]
    if numbers and (not any(values) or not all(value is None or value > 0 for value in values)):
        raise InputError(f"--thrust {text!r}: positive numbers and their unit are needed, such as {EXAMPLE}")
    return values


def wrong_speed(ratio: float, aircraft: Aircraft) -> str:
    """What contradicts the motor's constant, and the number of poles that would not."""
    said = f"motor speed at full throttle is {ratio:.2f} times kV (V - I R)"
    pairs = aircraft.propulsion.pole_pairs
    if pairs is None or round(pairs * ratio) == pairs:
        return f"{said}: check the number of poles, kV, resistance and the power module"
    return f"{said}: the motor has {2 * round(pairs * ratio)} poles rather than {2 * pairs}, or kV or voltage are wrong"


def summary(offset: "VibrationOffset", battery: "Battery | None", ratio: float | None) -> list[str]:
    """The result in lines."""
    from analysis.estimation.noise import NORMAL_95

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
    """The sections of an aircraft file."""
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
