"""Scale and offset of the accelerometers from the tray lying still on each of its six sides.

At rest the specific force is g in any attitude: |(f - b)/(1 + s)| = g for each reading f (3,), with offsets b and
scales s by axis. The tray need not be exactly level, because its tilt affects all three readings and not their length.
Axes that are not at right angles have only a second-order effect. The analysis takes g as 9.80665 m/s^2 everywhere, and
the scales here refer to the same value.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.air.settings import GROUND
from flightpower.analysis.calibrations.runner import AircraftFileLines, Calibrated, LogFile, calibration
from flightpower.analysis.calibrations.settings import IMU
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.sources.rest import FORCES, resting_stretches
from flightpower.analysis.trajectory.settings import PRIORS
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2

AXES = ("forward", "right", "down")
# The sides that are up when each axis reads +1 g and -1 g: an axis that points up reads +1 g at rest.
SIDES = (("nose", "tail"), ("right side", "left side"), ("bottom", "top"))


class RestingSide(NamedTuple):
    """A stretch at rest: time at its middle [s], mean specific force (3,) [m/s^2], variance of this mean by axis."""

    time_s: float
    force_mps2: Array
    variance: Array

    @property
    def up(self) -> tuple[int, int]:
        """Number of the axis that is nearest to the vertical, and 0 if it points up or 1 if it points down."""
        axis = int(np.argmax(np.abs(self.force_mps2)))
        return axis, int(self.force_mps2[axis] < 0)


class Accelerometers(NamedTuple):
    """Offset [m/s^2] and scale of the accelerometers, (3,) each, with standard errors.

    residual_mps2 : rms of the corrected specific force's length minus g
    """

    offset_mps2: Array
    offset_error_mps2: Array
    scale: Array
    scale_error: Array
    residual_mps2: float


def resting_sides(table: pd.DataFrame, source: str) -> list[RestingSide]:
    """Return the stretches at rest in order of time. table: from `sources.daemon.synchronize`.

    Raises InputError naming the sides on which the tray never lay.
    """
    sides = []
    for rows in resting_stretches(table):
        stretch = rows[list(FORCES)]
        means = stretch.groupby((stretch.index.to_numpy() // GROUND.reference_s).astype(int)).mean()
        variance = means.var().to_numpy() / len(means)
        sides.append(RestingSide(float(stretch.index.to_numpy().mean()), stretch.mean().to_numpy(), variance))
    lain = {side.up for side in sides}
    missing = [SIDES[axis][down] for axis in range(3) for down in range(2) if (axis, down) not in lain]
    if missing:
        raise InputError(
            f"{source}: the tray lay still {len(sides)} times, never with its {', '.join(missing)} up: lay it on each"
            " of its six sides for ten seconds, motor off"
        )
    return sides


def accelerometers(sides: Sequence[RestingSide], source: str = "") -> Accelerometers:
    """Fit scale and offset by least squares on the length of the specific force, with Gauss-Newton steps.

    The error of a reading comes from the scatter within stretches, or, with more stretches than unknowns, from the
    residuals if these are larger. Raises InputError if a scale error is larger than any sensor has.
    """
    f = np.array([side.force_mps2 for side in sides])
    offset, scale = np.zeros(3), np.zeros(3)
    for _ in range(20):  # three steps are enough for scale errors of 10 %
        true = (f - offset) / (1 + scale)
        length = np.linalg.norm(true, axis=1)
        along = true / length[:, None] / (1 + scale)
        J = np.hstack([along, along * true])
        change = np.linalg.lstsq(J, length - GRAVITY_MPS2)[0]
        of_offset, of_scale = np.split(change, 2)
        offset, scale = offset + of_offset, scale + of_scale
    residual = np.linalg.norm((f - offset) / (1 + scale), axis=1) - GRAVITY_MPS2
    largest = 10 * PRIORS.unstated["az_scale"][1]
    if np.abs(scale).max() > largest:
        worst = int(np.argmax(np.abs(scale)))
        raise InputError(
            f"{source}: the accelerometer {AXES[worst]} reads {100 * scale[worst]:+.0f} % more than the force, at most"
            f" {100 * largest:.0f} % are usual: check its range and unit in the tray file"
        )
    variance = float(np.mean([np.sum((side.force_mps2 / GRAVITY_MPS2) ** 2 * side.variance) for side in sides]))
    spare = len(sides) - 6
    if spare > 0:
        variance = max(variance, float(np.sum(residual**2)) / spare)
    offset_error, scale_error = np.split(np.sqrt(variance * np.diag(np.linalg.inv(J.T @ J))), 2)
    return Accelerometers(offset, offset_error, scale, scale_error, float(np.sqrt(np.mean(residual**2))))


@calibration(AircraftFileLines)
def imu(log: LogFile) -> Calibrated:
    """Find scale and offset of the accelerometers from the tray lying still on each of its six sides.

    Start the daemon, motor off. Lay the tray, alone or in the aircraft, on one side after the other for ten seconds
    each: bottom, right side, top, left side, tail, nose. It need not be level: a tilt of 20 deg does no harm. Lay it on
    some sides twice, and the error follows from how well they agree.

    A scale that is wrong by 2 % makes lift and thrust wrong by as much. The lines printed for the aircraft file correct
    for scale and offset, and say how well. Exit code 2 if a side is missing; exit code 1 and no lines if the readings
    do not determine the scale better than the data sheet.

    To rehearse it: `sim fly --plan six-sides -o out/sides`.

    \b
    Example:
      calibrate imu log.mcap
    """
    from flightpower.analysis.sources.daemon import synchronize
    from flightpower.flight.log_reader import read_log

    sides = resting_sides(synchronize(read_log(log)).table, str(log))
    calibration = accelerometers(sides, str(log))
    lay = ", ".join(f"{SIDES[axis][down]} at {side.time_s:.0f} s" for side in sides for axis, down in [side.up])
    return Calibrated(
        [f"sides up: {lay}", *summary(calibration)], to_toml(calibration), unsupported=not_supported(calibration)
    )


def not_supported(calibration: Accelerometers) -> str:
    """Return why the readings do not determine the scale; empty if they do."""
    error, assumed = float(calibration.scale_error.max()), Uncertainty.accelerometer_scale_fraction
    if error > STATISTICS.determined_share * assumed:
        return (
            f"the scale is uncertain by {100 * error:.2f} % (1 sigma), where {100 * assumed:.0f} % are assumed without"
            " a calibration: lay the tray on something that does not move, for longer, and on each side twice"
        )
    return ""


def summary(calibration: Accelerometers) -> list[str]:
    """Return the result as lines of text."""
    from flightpower.analysis.estimation.noise import NORMAL_95

    rows = zip(
        AXES,
        calibration.scale,
        calibration.scale_error,
        calibration.offset_mps2,
        calibration.offset_error_mps2,
        strict=True,
    )
    return [
        *(
            f"{axis}: scale {100 * scale:+.2f} ± {100 * NORMAL_95 * scale_error:.2f} %, offset {offset:+.3f} ±"
            f" {NORMAL_95 * offset_error:.3f} m/s² (95 % interval)"
            for axis, scale, scale_error, offset, offset_error in rows
        ),
        f"after correction the force at rest equals g within {calibration.residual_mps2:.4f} m/s² rms",
    ]


def to_toml(calibration: Accelerometers) -> str:
    """Return the result as sections of an aircraft file. Its uncertainty includes the drift with temperature."""
    offsets = ", ".join(f'"{value:.4f} m/s^2"' for value in calibration.offset_mps2)
    scales = ", ".join(f'"{100 * value:.3f} %"' for value in calibration.scale)
    sigma = float(np.hypot(calibration.scale_error.max(), IMU.drift))
    return (
        f"[installation]\naccelerometer_offset = [{offsets}]\naccelerometer_scale = [{scales}]\n\n"
        f'[uncertainty]\naccelerometer_scale = "{100 * sigma:.2g} %"\n'
    )
