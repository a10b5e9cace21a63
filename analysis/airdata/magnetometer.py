"""Hard and soft iron of a magnetometer from measurements in many directions, and the compass in flight.

The strength of the earth's field does not depend on the aircraft's attitude. Magnets aboard add a constant vector b
(hard iron), steel and current loops distort the field (soft iron): the measured vectors m lie on an ellipsoid, and
|A (m - b)| = F. Lengths do not determine a rotation in A, so A is symmetric; its mean diagonal is one, so that F is in
tesla.

In flight the corrected field shows the heading (`compass`). The variation of its strength gives its error.
"""

from typing import NamedTuple

import msgspec
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.settings import MAGNETOMETER
from analysis.signals.settings import STATISTICS
from flight.errors import InputError
from flight.files import JsonFormat

Array = NDArray[np.float64]

FORMAT = "flightpower-magnetometer-1"


class MagnetometerCalibration(msgspec.Struct, frozen=True, kw_only=True):
    """The content of `magnetometer.json`: corrected = soft_iron (measured - hard_iron), body axes."""

    format: str = FORMAT
    source: str
    samples: int
    hard_iron_T: tuple[float, float, float]
    hard_iron_error_T: tuple[float, float, float]  # 1 sigma
    soft_iron: tuple[tuple[float, float, float], ...]  # (3, 3), symmetric
    soft_iron_error: float  # largest 1 sigma among its elements
    field_T: float
    residual_before_T: float  # rms of the field's strength about its mean, as measured
    residual_T: float  # and corrected
    directions: float  # smallest spread of the measured directions along any axis; 0.58 is uniform, 0 a plane

    @property
    def near_one_plane(self) -> bool:
        """Whether the aircraft was turned about one axis only."""
        return self.directions < MAGNETOMETER.flattest

    def corrected(self, field_T: Array) -> Array:
        """Flux density without the aircraft's own iron; (n, 3) to (n, 3)."""
        corrected: Array = (field_T - np.array(self.hard_iron_T)) @ np.array(self.soft_iron).T
        return corrected


def _check(calibration: MagnetometerCalibration, where: str) -> None:
    if len(calibration.soft_iron) != 3:
        raise InputError(
            f"{where}: not a magnetometer calibration (soft_iron has {len(calibration.soft_iron)} rows, not 3)"
        )
    if not MAGNETOMETER.earth_T[0] < calibration.field_T < MAGNETOMETER.earth_T[1]:
        raise InputError(f"{where}: a field of {1e6 * calibration.field_T:.0f} uT is nowhere on earth; calibrate again")


MAGNETOMETER_FILE = JsonFormat(MagnetometerCalibration, (FORMAT,), "a magnetometer calibration", _check)


class Compass(NamedTuple):
    """Flux density in body axes without the aircraft's iron (n, 3) [T], NaN where it is not reliable.

    error_T : its standard error across the field [T]; a function of heading and motor current, so it does not average
    out over a flight
    """

    field_T: Array
    error_T: float


def compass(table: pd.DataFrame, calibration: MagnetometerCalibration) -> tuple[Compass | None, list[str]]:
    """The earth's field in flight, or None if it is not reliable; and notes with the reason. table: of `air_data`.

    The variation of the field strength shows its error: an error across the field changes the strength in proportion to
    the horizontal share of the field. Samples on the ground, near cars and reinforced concrete, are not used.
    """
    field = calibration.corrected(table.reindex(columns=[f"mag_{axis}_T" for axis in "xyz"]).to_numpy(dtype=float))
    field[~table["flying"].to_numpy(dtype=bool)] = np.nan
    strength = np.linalg.norm(field, axis=1)
    seen = np.isfinite(strength)
    if seen.sum() < MAGNETOMETER.fewest_samples:
        return None, [f"{_NOT_USED}: it is calibrated, but has too few samples in flight."]
    F, usual = calibration.field_T, float(np.median(strength[seen]))
    if abs(usual / F - 1) > MAGNETOMETER.off:
        why = f"the field in flight is {1e6 * usual:.0f} uT, but {1e6 * F:.0f} uT in its calibration"
        return None, [f"{_NOT_USED}: {why}. {_AGAIN}"]
    off = seen & (np.abs(strength / usual - 1) > MAGNETOMETER.off)
    field[off] = np.nan
    share = float(off.sum() / seen.sum())
    level_T = float(np.nanmedian(np.hypot(field[:, 0], field[:, 1])))
    step_s = float(table.index[1] - table.index[0])
    second = max(1, round(1 / step_s))
    varies_T = pd.Series(np.where(off, np.nan, strength)).rolling(second, min_periods=1).mean().std()
    error_T = float(
        np.sqrt(
            MAGNETOMETER.iron_change_T**2
            + np.sum(np.square(calibration.hard_iron_error_T))
            + (calibration.soft_iron_error * F) ** 2
            + (MAGNETOMETER.tilt_rad * F) ** 2
            + (varies_T * usual / level_T) ** 2
        )
    )
    if share > MAGNETOMETER.off or error_T > MAGNETOMETER.worst_rad * level_T:
        varies_uT = 1e6 * float(np.std(strength[seen]))
        why = f"the field strength varies by {varies_uT:.1f} uT in flight, but should be constant"
        return None, [f"{_NOT_USED}: {why}. {_AGAIN}"]
    notes = []
    if share > STATISTICS.unmentioned_share:
        notes.append(
            f"The magnetometer is left out for {100 * share:.0f} % of the flight, where the field strength is more than"
            f" {100 * MAGNETOMETER.off:.0f} % off."
        )
    return Compass(field, error_T), notes


_NOT_USED = "The magnetometer is not used"
_AGAIN = "Calibrate it again, in the aircraft ready to fly."


def calibrate(field_T: Array, source: str = "") -> MagnetometerCalibration:
    """Hard and soft iron from measurements in many directions, (n, 3) [T].

    Raises InputError if there are too few, if their strength is not that of the earth's field, or if the standard error
    of the calibration exceeds the largest error of heading even where the whole field is level: no compass could
    use it.
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
    for _ in range(2):  # the second time with the noise found in the first
        start = np.concatenate([np.zeros(8), [np.median(strength) / MAGNETOMETER.hard_iron_T]])
        fit = least_squares(_residuals, start, args=(field, sigma), x_scale="jac")
        residual = _lengths(fit.x, field) - fit.x[8] * MAGNETOMETER.hard_iron_T
        sigma = max(float(np.std(residual)) * np.sqrt(MAGNETOMETER.correlated), 1e-9)
    jacobian = np.asarray(fit.jac)
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    error = np.sqrt(np.diag(covariance))
    F = float(fit.x[8] * MAGNETOMETER.hard_iron_T)
    least_T, largest_T = MAGNETOMETER.earth_T
    if not least_T < F < largest_T:
        raise InputError(
            f"{source}: the estimated field is {1e6 * F:.0f} uT, which is nowhere on earth ({1e6 * least_T:.0f} to"
            f" {1e6 * largest_T:.0f}): turn the aircraft through more directions, away from iron and motors"
        )
    hard_iron_error_T, soft_iron_error = (
        error[:3] * MAGNETOMETER.hard_iron_T,
        float(error[3:8].max() * MAGNETOMETER.soft_iron),
    )
    if np.hypot(np.linalg.norm(hard_iron_error_T), soft_iron_error * F) > MAGNETOMETER.worst_rad * F:
        axis = int(np.argmax(hard_iron_error_T))
        raise InputError(
            f"{source}: hard iron along {'xyz'[axis]} stays uncertain by {1e6 * hard_iron_error_T[axis]:.0f} uT"
            f" (1 sigma, of a field of {1e6 * F:.0f}): turn the aircraft about more axes, nose up and down, on its"
            " sides and its back"
        )
    A, b = _matrix(fit.x), fit.x[:3] * MAGNETOMETER.hard_iron_T
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
    """Distance of each sample from the ellipsoid over sigma, and the prior's residuals, (n + 9,).

    x : (9,) hard iron, soft iron and field, in units of their prior. The difference of lengths is divided by its
    gradient; otherwise a matrix that shrinks the noise would seem to fit.
    """
    A = _matrix(x)
    lengths = _lengths(x, field)
    outward = (field - x[:3] * MAGNETOMETER.hard_iron_T) @ A.T @ A / lengths[:, None]
    lengths = (lengths - x[8] * MAGNETOMETER.hard_iron_T) / (sigma * np.linalg.norm(outward, axis=1))
    mean_T, sigma_T = MAGNETOMETER.field_T
    prior = np.append(x[:8], (x[8] * MAGNETOMETER.hard_iron_T - mean_T) / sigma_T)
    return np.concatenate([lengths, prior])


def _lengths(x: Array, field: Array) -> Array:
    return np.asarray(np.linalg.norm((field - x[:3] * MAGNETOMETER.hard_iron_T) @ _matrix(x).T, axis=1))


def _matrix(x: Array) -> Array:
    xx, yy, xy, xz, yz = x[3:8] * MAGNETOMETER.soft_iron
    matrix: Array = np.eye(3) + np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, -xx - yy]])
    return matrix
