"""Finds hard and soft iron of the magnetometer from a log with turns: the field is equally long in all attitudes."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flightpower.analysis.air.magnetometer import MagnetometerCalibration
from flightpower.analysis.air.settings import MAGNETOMETER
from flightpower.analysis.calibrations.runner import Calibrated, CalibrationFile, LogFile, calibration
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError

if TYPE_CHECKING:
    from flightpower.analysis.air.magnetometer import MagnetometerCalibration


def calibrate(field_T: Array, source: str = "") -> MagnetometerCalibration:
    """Estimate hard and soft iron from measurements in many directions, (n, 3) [T].

    Raises InputError if there are too few, if their strength is not that of the earth's field, or if the standard error
    of the calibration exceeds the largest allowed heading error even where the earth's field is level, where a compass
    works best.
    """
    from scipy.optimize import least_squares  # takes 0.2 s to import, which an analysis of a flight does not need

    field = field_T[np.isfinite(field_T).all(axis=1)]
    if len(field) < MAGNETOMETER.fewest_samples:
        raise InputError(
            f"{source}: {len(field)} magnetometer samples are too few; {MAGNETOMETER.fewest_samples} are needed,"
            " in many directions"
        )
    strength = np.linalg.norm(field, axis=1)
    sigma = 1e-6
    for _ in range(2):  # the second fit uses the noise found in the first
        start = np.concatenate([np.zeros(8), [np.median(strength) / MAGNETOMETER.hard_iron_T]])
        fit = least_squares(_residuals, start, args=(field, sigma), x_scale="jac")
        unknowns = _unpacked(fit.x)
        residual = _lengths(unknowns, field) - unknowns.field_T
        sigma = max(float(np.std(residual)) * np.sqrt(MAGNETOMETER.correlated), 1e-9)
    jacobian = np.asarray(fit.jac)
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    error = np.sqrt(np.diag(covariance))
    F = float(unknowns.field_T)
    least_T, largest_T = MAGNETOMETER.earth_T
    if not least_T < F < largest_T:
        raise InputError(
            f"{source}: the estimated field is {1e6 * F:.0f} uT, which is nowhere on earth ({1e6 * least_T:.0f} to"
            f" {1e6 * largest_T:.0f}): turn the aircraft through more directions, away from iron and motors"
        )
    hard_iron_error_T = _unpacked(error).hard_iron_T
    soft_iron_error = float(_unpacked(error).soft_iron.max())
    if np.hypot(np.linalg.norm(hard_iron_error_T), soft_iron_error * F) > MAGNETOMETER.worst_rad * F:
        axis = int(np.argmax(hard_iron_error_T))
        raise InputError(
            f"{source}: hard iron along {'xyz'[axis]} stays uncertain by {1e6 * hard_iron_error_T[axis]:.0f} uT"
            f" (1 sigma, of a field of {1e6 * F:.0f}): turn the aircraft about more axes, nose up and down, on its"
            " sides and its back"
        )
    A, b = unknowns.matrix, unknowns.hard_iron_T
    unit = (field - b) @ A.T / np.linalg.norm((field - b) @ A.T, axis=1)[:, None]
    return MagnetometerCalibration(
        source=source,
        samples=len(field),
        hard_iron_T=tuple(b.tolist()),
        hard_iron_error_T=tuple(hard_iron_error_T.tolist()),
        soft_iron=tuple(tuple(row) for row in A.tolist()),
        soft_iron_error=soft_iron_error,
        field_T=F,
        residual_before_T=float(np.std(strength)),
        residual_T=float(np.std(residual)),
        directions=float(np.sqrt(np.linalg.eigvalsh(np.cov(unit.T))[0])),
    )


def _residuals(x: Array, field: Array, sigma: float) -> Array:
    """Return each sample's distance from the ellipsoid over sigma, and the prior's residuals, (n + 9,).

    x : (9,) hard iron, soft iron and field, in units of their priors. The difference in length is divided by its
    gradient; otherwise a matrix that only shrinks the noise would appear to fit.
    """
    unknowns = _unpacked(x)
    lengths = _lengths(unknowns, field)
    outward = (field - unknowns.hard_iron_T) @ unknowns.matrix.T @ unknowns.matrix / lengths[:, None]
    lengths = (lengths - unknowns.field_T) / (sigma * np.linalg.norm(outward, axis=1))
    mean_T, sigma_T = MAGNETOMETER.field_T
    *of_iron, _ = x
    return np.concatenate([lengths, of_iron, [(unknowns.field_T - mean_T) / sigma_T]])


class _Unknowns(NamedTuple):
    """Unknowns of the fit. hard_iron_T : (3,)     soft_iron : (5,) xx, yy, xy, xz, yz     field_T : strength"""

    hard_iron_T: Array
    soft_iron: Array
    field_T: float

    @property
    def matrix(self) -> Array:
        """Symmetric matrix (3, 3) that turns the ellipsoid into a sphere."""
        xx, yy, xy, xz, yz = self.soft_iron
        return np.asarray(np.eye(3) + np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, -xx - yy]]))


def _unpacked(x: Array) -> _Unknowns:
    """Unpack a vector (9,) that is in units of the priors."""
    hard_iron, soft_iron, field = np.split(x, [3, 8])
    unit_T = MAGNETOMETER.hard_iron_T
    return _Unknowns(hard_iron * unit_T, soft_iron * MAGNETOMETER.soft_iron, float(field.item() * unit_T))


def _lengths(unknowns: _Unknowns, field: Array) -> Array:
    return np.asarray(np.linalg.norm((field - unknowns.hard_iron_T) @ unknowns.matrix.T, axis=1))


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

    from flightpower.analysis.sources.daemon import field_of
    from flightpower.flight.log_reader import read_log

    recorded = read_log(log)
    components = [field_of(recorded, "/mag", f"field_{axis}_T")[1] for axis in "xyz"]
    if not len(components[0]):
        raise InputError(f"{log}: no magnetometer in this log")
    calibration = calibrate(np.column_stack(components), str(log))
    return Calibrated(summary(calibration), calibration)


def summary(calibration: "MagnetometerCalibration") -> list[str]:
    """Return the result as lines of text."""
    lines = [
        f"hard iron {axis} {1e6 * b:+.1f} ± {1e6 * error:.1f} uT"
        for axis, b, error in zip("xyz", calibration.hard_iron_T, calibration.hard_iron_error_T, strict=True)
    ]
    lines.append(f"soft iron ± {100 * calibration.soft_iron_error:.1f} %; field {1e6 * calibration.field_T:.1f} uT")
    lines.append(
        f"field strength varies by {1e6 * calibration.residual_before_T:.2f} uT rms as measured,"
        f" {1e6 * calibration.residual_T:.2f} uT corrected"
    )
    if calibration.near_one_plane:
        lines.append("note: all directions lie near one plane; turn the aircraft about another axis, too")
    return lines
