"""`calibrate magnetometer`"""

from typing import TYPE_CHECKING

from analysis.cli.calibrate.runner import Calibrated, CalibrationFile, LogFile, calibration
from flight.errors import InputError

if TYPE_CHECKING:
    from analysis.airdata.magnetometer import MagnetometerCalibration


@calibration(CalibrationFile, "magnetometer.json")
def magnetometer(log: LogFile) -> Calibrated:
    """Estimate hard and soft iron of the magnetometer from a log in which the aircraft was turned.

    Best on the ground, away from cars and reinforced concrete, with everything aboard switched on and the motor off:
    turn the aircraft slowly through all attitudes for a minute, nose up and down, on its sides and on its back. Steep
    turns in flight in both directions also serve, but determine the vertical component poorly. The standard error of
    each component is printed. Nothing is written if they would leave the heading uncertain by 10 deg (1 sigma) even
    where the earth's field is level.

    To rehearse it: `sim fly --plan magnetometer-turn -o out/turned`.

    \b
    Example:
      calibrate magnetometer log.mcap -o magnetometer.json
    """
    import numpy as np

    from analysis.ground.magnetometer import calibrate
    from analysis.signals.channels import field_of
    from flight.log_reader import read_log

    recorded = read_log(log)
    components = [field_of(recorded, "/mag", f"field_{axis}_T")[1] for axis in "xyz"]
    if not len(components[0]):
        raise InputError(f"{log}: no magnetometer in this log")
    found = calibrate(np.column_stack(components), str(log))
    return Calibrated(summary(found), found)


def summary(found: "MagnetometerCalibration") -> list[str]:
    """The result in lines."""
    lines = [
        f"hard iron {axis} {1e6 * b:+.1f} ± {1e6 * error:.1f} uT"
        for axis, b, error in zip("xyz", found.hard_iron_T, found.hard_iron_error_T, strict=True)
    ]
    lines.append(f"soft iron ± {100 * found.soft_iron_error:.1f} %; field {1e6 * found.field_T:.1f} uT")
    lines.append(
        f"field strength varies by {1e6 * found.residual_before_T:.2f} uT rms as measured,"
        f" {1e6 * found.residual_T:.2f} uT corrected"
    )
    if found.near_one_plane:
        lines.append("note: all directions lie near one plane; turn the aircraft about another axis, too")
    return lines
