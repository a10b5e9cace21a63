"""Compares a propeller's thrust at rest on a stand with its table, and gives the ratio of the two with its error.

The ratio of thrust to the table's thrust at J = 0 and the same motor speed is fitted to all readings by least squares.
Errors of single readings follow from their scatter. An error of the stand's scale (load cell, lever arm, air density)
shows in no residual, so the user gives it. If the ratio changes with motor speed (Reynolds number, stalled blades), it
does not hold at other speeds; half of its change over the measured speeds is then added to the error.
"""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np
import typer
from scipy import special

from flightpower.analysis.air.settings import STAND_LIMITS
from flightpower.analysis.air.thrust_stand import ThrustStand
from flightpower.analysis.calibrations.runner import Calibrated, CalibrationFile, calibration
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.settings import EVIDENCE
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.flight.aircraft import Aircraft, Uncertainty, load_aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import density
from flightpower.flight.command_line import Quantity
from flightpower.flight.errors import InputError
from flightpower.flight.propeller import Propeller
from flightpower.flight.unit_columns import read_unit_columns

if TYPE_CHECKING:
    from flightpower.analysis.air.thrust_stand import ThrustStand
    from flightpower.flight.propeller import Propeller

# Columns of the file, each with its (field, unit).
_COLUMNS = {
    "motor_speed": ("revps", "turn/s"),
    "thrust": ("thrust_N", "N"),
    "pressure": ("pressure_Pa", "Pa"),
    "temperature": ("temperature_K", "K"),
}
_EXAMPLE = "motor_speed_rpm, thrust_N, pressure_hPa, temperature_degC"


class StandReadings(NamedTuple):
    """Readings on a stand, each (n,): motor speed [rev/s], thrust [N], air density [kg/m^3]."""

    revps: Array
    thrust_N: Array
    rho: Array


def calibrate(
    readings: StandReadings, propeller: Propeller, scale_error: float, source: str
) -> tuple[ThrustStand, str]:
    """Return the ratio of thrust to the table's thrust, and why the readings do not support it (empty if they do).

    scale_error : standard deviation of the stand's scale, as a fraction
    Raises InputError for too few readings or speeds, for a table that does not reach J = 0, and for a ratio that no
    propeller has.
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
    stand = ThrustStand(
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
    return stand, _why_not_supported(stand)


def _speeds(revps: Array) -> list[float]:
    """Return the distinct motor speeds among the readings, in ascending order."""
    speeds: list[float] = []
    for n in np.sort(revps).tolist():
        if not speeds or n > (1 + STAND_LIMITS.same_speed) * speeds[-1]:
            speeds.append(n)
    return speeds


def student_sigma(residuals: Array, parameters: int) -> float:
    """Return a reading's standard deviation from residuals, scaled: +-1.96 times it is Student's 95 % interval."""
    dof = len(residuals) - parameters
    factor = float(special.stdtrit(dof, 0.975)) / NORMAL_95
    return factor * math.sqrt(float(residuals @ residuals) / dof)


def student_fit(X: Array, y: Array) -> tuple[Array, Array]:
    """Fit y (n,) by the columns of X (n, m). Return coefficients (m,) and their errors, as in `student_sigma`."""
    coefficients = np.asarray(np.linalg.lstsq(X, y, rcond=None)[0])
    unit = np.sqrt(np.diag(np.linalg.inv(X.T @ X)))
    return coefficients, student_sigma(y - X @ coefficients, X.shape[1]) * unit


def _why_not_supported(stand: ThrustStand) -> str:
    """Return why the ratio is not known well enough to be of use; empty if it is."""
    error = stand.ratio_error / stand.ratio
    if error <= STAND_LIMITS.largest_error:
        return ""
    return (
        f"the standard error of the ratio is {100 * error:.1f} %, more than {100 * STAND_LIMITS.largest_error:.0f} %:"
        f" scatter of the readings {100 * stand.scatter_error:.1f} %, scale {100 * stand.scale_error:.1f} %, change"
        f" with motor speed {100 * stand.speed_error:.1f} %; measure again without wind, and more readings"
    )


def read_stand(path: Path, rho: float | None = None) -> StandReadings:
    """Read a CSV file whose header gives each column's name and unit, such as `thrust_N` or `thrust [N]`.

    rho : air density [kg/m^3], for a file without pressure and temperature of the air
    Raises InputError naming file and cause.
    """
    values = read_unit_columns(path, _COLUMNS, ("motor_speed", "thrust"), _EXAMPLE)
    for name, value in values.items():
        if not (value > 0).all():
            raise InputError(f"{path}: {name} is {value[value <= 0][0]:.4g} in a line; it must be positive")
    if "pressure_Pa" in values and "temperature_K" in values:
        air = np.asarray(density(values["pressure_Pa"], values["temperature_K"]))
    elif rho is not None:
        air = np.full(len(values["thrust_N"]), rho)
    else:
        raise InputError(
            f"{path}: the air density is not known; give columns pressure and temperature, or --pressure and"
            " --temperature"
        )
    return StandReadings(values["revps"], values["thrust_N"], air)


ScaleErrorOption = Annotated[
    float,
    Quantity("--thrust-scale-error", "%", '"0.5%"', least=0, most=10).as_option(
        "Error common to all readings, 1 sigma, in %: load cell, its lever arm, air density. Errors of single"
        " readings are found from their scatter."
    ),
]


@calibration(CalibrationFile, "stand.json")
def thrust(
    stand: Annotated[
        Path, typer.Argument(metavar="STAND", help="CSV with a header such as `motor_speed_rpm,thrust_N`.")
    ],
    *,
    propeller: Annotated[
        str | None,
        typer.Option(
            "--propeller",
            metavar="NAME",
            help="Table of the propeller: a name that `flightpower propellers` lists,"
            " or a file (docs/use/propellers.md).",
        ),
    ] = None,
    aircraft: Annotated[
        Path | None,
        typer.Option("--aircraft", metavar="FILE", help="Aircraft file that names the propeller instead."),
    ] = None,
    pressure: Annotated[
        float | None,
        Quantity("--pressure", "Pa", '"1013 hPa"', above=3e4, most=1.2e5).as_option(
            'Air pressure at the stand (not reduced to sea level), such as "1013 hPa", if the file does not have it.'
        ),
    ] = None,
    temperature: Annotated[
        float | None,
        Quantity("--temperature", "K", '"15 degC"', above=200, most=340).as_option(
            'Air temperature at the stand, such as "15 degC", if the file does not have it.'
        ),
    ] = None,
    scale_error: ScaleErrorOption = 1.0,  # load cell checked with a weight 0.5 %, lever arm 0.7 %, air density 0.3 %
) -> Calibrated:
    """Measure thrust at rest on a stand, and compare it with the propeller's table.

    Mount the motor with its propeller, best with the aircraft's nose behind it, on a load cell, outdoors in calm air
    or in a large room, two diameters from the ground and walls. Check the load cell with a weight. Hold motor speeds
    from half to full throttle for some seconds each, up and down again, and write down motor speed and thrust: five
    readings at three speeds at least, better ten at five.

    The file has the columns motor_speed and thrust, each with its unit (motor_speed_rpm, thrust_N), and may have
    pressure and temperature of the air (pressure_hPa, temperature_degC); else give these by options.

    `analyze --thrust-stand FILE` uses the result: a prior of the propeller's thrust at J = 0. The lines printed do
    the same in the aircraft file. Exit code 1 and no file if the ratio stays uncertain by 6 % (1 sigma); exit code 2
    if the readings are too few or the table does not reach J = 0.

    \b
    Examples:
      calibrate thrust stand.csv --propeller mine.csv
      calibrate thrust stand.csv --aircraft my.toml --thrust-scale-error 0.5%
    with stand.csv such as
      motor_speed_rpm,thrust_N,pressure_hPa,temperature_degC
      4000,4.88,1002,18     (then a line a reading)
    """
    if (propeller is None) == (aircraft is None):
        raise InputError("--propeller, --aircraft: give one of the two, which names the table to compare with")
    craft = load_aircraft(aircraft) if aircraft else None
    name = craft.propulsion.propeller if craft else propeller
    if name is None:
        raise InputError(f"{aircraft}: no [propulsion] propeller; name it there, or give --propeller")
    if (pressure is None) != (temperature is None):
        raise InputError("--pressure, --temperature: give both, or none")
    from flightpower.flight.atmosphere import density
    from flightpower.flight.propeller_files import load_propeller

    table = load_propeller(name)
    rho = density(pressure, temperature) if pressure is not None and temperature is not None else None
    readings = read_stand(stand, rho)
    thrust_stand, unsupported = calibrate(readings, table, scale_error / 100, stand.name)
    return Calibrated(
        summary(thrust_stand),
        thrust_stand,
        warnings=doubts(thrust_stand, readings, table, craft),
        unsupported=unsupported,
        remark=f"; the same in the aircraft file:\n{to_toml(thrust_stand)}".rstrip("\n"),
    )


def summary(stand: "ThrustStand") -> list[str]:
    """Return the result as lines of text."""
    parts = ((stand.scatter_error, "scatter"), (stand.scale_error, "scale"), (stand.speed_error, "motor speed"))
    by = ", ".join(f"{100 * error:.1f} % {name}" for error, name in parts if error)
    return [
        f"{stand.readings} readings from {60 * stand.revps[0]:.0f} to {60 * stand.revps[-1]:.0f} rpm",
        f"thrust at rest is {stand.ratio:.3f} ± {NORMAL_95 * stand.ratio_error:.3f} (95 % interval) times that of"
        f" propeller {stand.propeller}; standard errors: {by}",
    ]


def doubts(
    stand: "ThrustStand", readings: "StandReadings", propeller: "Propeller", aircraft: Aircraft | None
) -> list[str]:
    """Return sentences on points that the user should check."""
    from flightpower.analysis.methods.thrust_prior import stand_conflict

    sentences = []
    if stand.speed_error:
        sentences.append(
            f"the ratio changes by {200 * stand.speed_error:.1f} % over the motor speeds measured (Reynolds number, or"
            " blades that stall at rest); half of it is part of the error. Measure at the motor speeds of the flight"
        )
    slowest, fastest = propeller.rows[0].rpm, propeller.rows[-1].rpm
    outside = int(((60 * readings.revps < slowest) | (60 * readings.revps > fastest)).sum())
    if outside:
        sentences.append(
            f"{outside} of {stand.readings} readings are outside the table's {slowest:g} to {fastest:g} rpm; its"
            " nearest row was compared"
        )
    conflict = stand_conflict(stand.ratio, stand.ratio_error, aircraft.uncertainty if aircraft else Uncertainty())
    if conflict:
        sentences.append(conflict)
    return sentences


def to_toml(stand: "ThrustStand") -> str:
    """Return the result as sections of an aircraft file."""
    return (
        f"[propulsion]\nstatic_thrust_ratio = {stand.ratio:.4f}\n\n"
        f'[uncertainty]\nstatic_thrust_ratio = "{100 * stand.ratio_error / stand.ratio:.2g} %"\n'
    )
