"""Thrust of a propeller at rest, on a stand, against its table: the ratio of the two with its error.

Thrust over that of the table at J = 0 and the same motor speed, by least squares over all readings. Errors of single
readings are found from their scatter. An error of the stand's scale (load cell, lever arm, air density) shows in no
residual and is given by the user. A ratio that changes with motor speed, by Reynolds number or a stall of the blades,
is not that of another speed: half of its change over the speeds measured is part of the error.
"""

import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import special

from analysis.airdata.settings import STAND_LIMITS
from analysis.airdata.thrust_stand import ThrustStand
from analysis.estimation.noise import NORMAL_95
from analysis.settings import EVIDENCE
from analysis.signals.settings import STATISTICS
from flight.arrays import Array
from flight.atmosphere import density
from flight.errors import InputError
from flight.propeller import Propeller
from flight.unit_columns import csv_rows, si_column

# Column of the file: (field, unit).
_COLUMNS = {
    "motor_speed": ("revps", "turn/s"),
    "thrust": ("thrust_N", "N"),
    "pressure": ("pressure_Pa", "Pa"),
    "temperature": ("temperature_K", "K"),
}
_REVOLUTIONS = {"revps": "turn/s", "rev/s": "turn/s", "rev/min": "rpm"}  # names that pint does not know
_EXAMPLE = "motor_speed_rpm, thrust_N, pressure_hPa, temperature_degC"


class StandReadings(NamedTuple):
    """Readings on a stand, each (n,): motor speed [rev/s], thrust [N], air density [kg/m^3]."""

    revps: Array
    thrust_N: Array
    rho: Array


def calibrate(
    readings: StandReadings, propeller: Propeller, scale_error: float, source: str
) -> tuple[ThrustStand, str]:
    """The ratio of thrust to that of the table, and why the readings do not support it (empty if they do).

    scale_error : standard deviation of the stand's scale, as a fraction
    Raises InputError for too few readings or speeds, a table that does not reach J = 0, and a ratio that no propeller
    has.
    """
    n = readings.revps
    speeds = _speeds(n)
    if len(n) < STATISTICS.fewest_readings or len(speeds) < STAND_LIMITS.fewest_speeds:
        raise InputError(
            f"{source}: {len(n)} readings at {len(speeds)} motor speeds; measure {STATISTICS.fewest_readings} at"
            f" {STAND_LIMITS.fewest_speeds} speeds at least, from half to full throttle"
        )
    begins_at = np.interp(60 * n, [row.rpm for row in propeller.rows], [row.J[0] for row in propeller.rows])
    if np.any(begins_at > 0):
        raise InputError(
            f"propeller {propeller.name}: its table begins at J = {begins_at.max():.2g}, and the stand measures at"
            " J = 0; give a table with a static test (docs/use/propellers.md)"
        )
    table_N = np.asarray(propeller.thrust_and_power(np.zeros(len(n)), n, readings.rho)[0])
    weight = table_N @ table_N
    ratio = float(table_N @ readings.thrust_N / weight)
    if not abs(ratio - 1) <= STAND_LIMITS.largest_difference:
        raise InputError(
            f"{source}: thrust is {ratio:.2g} times that of propeller {propeller.name}; check the units, the number of"
            " pole pairs that the motor speed was counted with, and that this is the propeller on the stand"
        )
    # The second regressor is orthogonal to the first.
    change = table_N * (n / (table_N**2 @ n / weight) - 1)
    slope = float(change @ readings.thrust_N / (change @ change))
    residuals = readings.thrust_N - table_N * ratio
    with_slope = residuals - change * slope
    by_speed = slope * float(np.ptp(change / table_N))
    slope_sigma = student_sigma(with_slope, 2) / math.sqrt(change @ change)
    depends = abs(slope) > NORMAL_95 * slope_sigma and abs(by_speed) > EVIDENCE.negligible
    scatter = (student_sigma(with_slope, 2) if depends else student_sigma(residuals, 1)) / math.sqrt(weight)
    speed_error = abs(by_speed) / 2 if depends else 0.0
    found = ThrustStand(
        source=source,
        propeller=propeller.name,
        diameter_m=propeller.diameter_m,
        readings=len(n),
        revps=speeds,
        table_cT=np.asarray(propeller.table(np.zeros(len(speeds)), 60 * np.array(speeds))[0]).tolist(),
        ratio=ratio,
        ratio_error=math.hypot(scatter, scale_error * ratio, speed_error),
        scatter_error=scatter,
        scale_error=scale_error,
        speed_error=speed_error,
    )
    return found, _why_not_supported(found)


def _speeds(revps: Array) -> list[float]:
    """The different speeds among the readings, ascending."""
    found: list[float] = []
    for n in np.sort(revps).tolist():
        if not found or n > (1 + STAND_LIMITS.same_speed) * found[-1]:
            found.append(n)
    return found


def student_sigma(residuals: Array, parameters: int) -> float:
    """Standard deviation of a reading by its residuals, so that +-1.96 of it are Student's 95 %."""
    dof = len(residuals) - parameters
    factor = float(special.stdtrit(dof, 0.975)) / NORMAL_95
    return factor * math.sqrt(float(residuals @ residuals) / dof)


def student_fit(X: Array, y: Array) -> tuple[Array, Array]:
    """Coefficients (m,) of y (n,) on the columns of X (n, m), and their errors as of `student_sigma`."""
    coefficients = np.asarray(np.linalg.lstsq(X, y, rcond=None)[0])
    unit = np.sqrt(np.diag(np.linalg.inv(X.T @ X)))
    return coefficients, student_sigma(y - X @ coefficients, X.shape[1]) * unit


def _why_not_supported(found: ThrustStand) -> str:
    """Empty if the ratio is known well enough to be of use."""
    error = found.ratio_error / found.ratio
    if error <= STAND_LIMITS.largest_error:
        return ""
    return (
        f"the standard error of the ratio is {100 * error:.1f} %, more than {100 * STAND_LIMITS.largest_error:.0f} %:"
        f" scatter of the readings {100 * found.scatter_error:.1f} %, scale {100 * found.scale_error:.1f} %, change"
        f" with motor speed {100 * found.speed_error:.1f} %; measure again without wind, and more readings"
    )


def read_stand(path: Path, rho: float | None = None) -> StandReadings:
    """The readings in a CSV file whose header names each column with its unit: `thrust_N` or `thrust [N]`.

    rho : density, for a file without air pressure and temperature
    Raises InputError naming file and cause.
    """
    rows = [row for row in csv_rows(path) if not row[0].startswith("#")]
    if len(rows) < 2:
        raise InputError(f"{path}: holds no readings; give columns such as {_EXAMPLE}")
    header, *lines = rows
    values: dict[str, Array] = {}
    for i, title in enumerate(header):
        found = re.fullmatch(rf"\s*({'|'.join(_COLUMNS)})(?:_|\s*\[)([^\]]+)\]?\s*", title)
        if found is None:
            raise InputError(
                f"{path}: column {title!r}: must be one of {', '.join(_COLUMNS)} with its unit: {_EXAMPLE}"
            )
        (name, unit), given = _COLUMNS[found[1]], _REVOLUTIONS.get(found[2], found[2])
        values[name] = si_column(lines, i, given, unit, f"{path}: {title}")
        positive = np.isfinite(values[name]) & (values[name] > 0)
        if not positive.all():
            wrong = lines[int(positive.argmin())]
            raise InputError(f"{path}: column {title!r}: not a positive number in the line {','.join(wrong)}")
    if missing := [title for title in ("motor_speed", "thrust") if _COLUMNS[title][0] not in values]:
        raise InputError(f"{path}: no column {' and '.join(missing)}; give columns such as {_EXAMPLE}")
    if "pressure_Pa" in values and "temperature_K" in values:
        air = np.asarray(density(values["pressure_Pa"], values["temperature_K"]))
    elif rho is not None:
        air = np.full(len(lines), rho)
    else:
        raise InputError(
            f"{path}: the air density is not known; give columns pressure and temperature, or --pressure and"
            " --temperature"
        )
    return StandReadings(values["revps"], values["thrust_N"], air)
