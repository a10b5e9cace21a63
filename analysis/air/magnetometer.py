"""Hard and soft iron of a magnetometer from measurements in many directions, and the compass in flight.

The strength of the earth's field does not depend on the aircraft's attitude. Magnets aboard add a constant vector b
(hard iron), and steel and current loops distort the field (soft iron): the measured vectors m lie on an ellipsoid, and
|A (m - b)| = F. Lengths do not determine a rotation in A, so A is symmetric; its mean diagonal is one, so that F is in
tesla.

In flight the corrected field shows the heading (`compass`). The variation of the field's strength gives its error.
"""

from typing import NamedTuple

import msgspec
import numpy as np
import pandas as pd

from flightpower.analysis.air.settings import MAGNETOMETER
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.files import JsonFormat

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
    residual_T: float  # the same after correction
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

    error_T : its standard error across the field [T]; the error depends on heading and motor current, so it does not
    average out over a flight
    """

    field_T: Array
    error_T: float


def compass(table: pd.DataFrame, calibration: MagnetometerCalibration) -> tuple[Compass | None, list[str]]:
    """The earth's field in flight, or None if it is not reliable; and notes with the reason. table: from `air_data`.

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
        return None, [f"{_NOT_USED}: {why}. {REPEAT_CALIBRATION}"]
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
        return None, [f"{_NOT_USED}: {why}. {REPEAT_CALIBRATION}"]
    notes = []
    if share > STATISTICS.unmentioned_share:
        notes.append(
            f"The magnetometer is left out for {100 * share:.0f} % of the flight, where the field strength is more than"
            f" {100 * MAGNETOMETER.off:.0f} % off."
        )
    return Compass(field, error_T), notes


_NOT_USED = "The magnetometer is not used"
REPEAT_CALIBRATION = "Calibrate it again, in the aircraft ready to fly."
