"""`calibrate thrust`"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from analysis.cli.calibrate.runner import Calibrated, CalibrationFile, calibration
from flight.aircraft import Aircraft, Uncertainty, load_aircraft
from flight.command_line import quantity
from flight.errors import InputError

if TYPE_CHECKING:
    from analysis.airdata.thrust_stand import ThrustStand
    from analysis.ground.thrust_stand import StandReadings
    from flight.propeller import Propeller


ScaleErrorOption = Annotated[
    float,
    typer.Option(
        "--thrust-scale-error",
        metavar="SHARE",
        parser=quantity("--thrust-scale-error", "%", '"0.5%"', least=0, most=10),
        help="Error common to all readings, 1 sigma, in %: load cell, its lever arm, air density. Errors of single"
        " readings are found from their scatter.",
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
        typer.Option(
            "--pressure",
            metavar="PRESSURE",
            parser=quantity("--pressure", "Pa", '"1013 hPa"', above=3e4, most=1.2e5),
            help='Air pressure at the stand (not reduced to sea level), such as "1013 hPa", for a file without it.',
        ),
    ] = None,
    temperature: Annotated[
        float | None,
        typer.Option(
            "--temperature",
            metavar="TEMPERATURE",
            parser=quantity("--temperature", "K", '"15 degC"', above=200, most=340),
            help='Air temperature at the stand, such as "15 degC", for a file without it.',
        ),
    ] = None,
    scale_error: ScaleErrorOption = 1.0,  # a load cell checked with a weight 0.5 %, its arm 0.7 %, density 0.3 %
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
    given = load_aircraft(aircraft) if aircraft else None
    name = given.propulsion.propeller if given else propeller
    if name is None:
        raise InputError(f"{aircraft}: no [propulsion] propeller; name it there, or give --propeller")
    if (pressure is None) != (temperature is None):
        raise InputError("--pressure, --temperature: give both, or none")
    from analysis.ground.thrust_stand import calibrate, read_stand
    from flight.atmosphere import density
    from flight.propeller_files import load_propeller

    table = load_propeller(name)
    rho = density(pressure, temperature) if pressure is not None and temperature is not None else None
    readings = read_stand(stand, rho)
    found, unsupported = calibrate(readings, table, scale_error / 100, stand.name)
    return Calibrated(
        summary(found),
        found,
        warnings=doubts(found, readings, table, given),
        unsupported=unsupported,
        remark=f"; the same in the aircraft file:\n{to_toml(found)}".rstrip("\n"),
    )


def summary(found: "ThrustStand") -> list[str]:
    """The result in lines."""
    from analysis.estimation.noise import NORMAL_95

    parts = ((found.scatter_error, "scatter"), (found.scale_error, "scale"), (found.speed_error, "motor speed"))
    by = ", ".join(f"{100 * error:.1f} % {name}" for error, name in parts if error)
    return [
        f"{found.readings} readings from {60 * found.revps[0]:.0f} to {60 * found.revps[-1]:.0f} rpm",
        f"thrust at rest is {found.ratio:.3f} ± {NORMAL_95 * found.ratio_error:.3f} (95 % interval) times that of"
        f" propeller {found.propeller}; standard errors: {by}",
    ]


def doubts(
    found: "ThrustStand", readings: "StandReadings", propeller: "Propeller", aircraft: Aircraft | None
) -> list[str]:
    """What the user should look at, in sentences."""
    from analysis.ground.thrust_prior import stand_conflict

    sentences = []
    if found.speed_error:
        sentences.append(
            f"the ratio changes by {200 * found.speed_error:.1f} % over the motor speeds measured (Reynolds number, or"
            " blades that stall at rest); half of it is part of the error. Measure at the motor speeds of the flight"
        )
    slowest, fastest = propeller.rows[0].rpm, propeller.rows[-1].rpm
    outside = int(((60 * readings.revps < slowest) | (60 * readings.revps > fastest)).sum())
    if outside:
        sentences.append(
            f"{outside} of {found.readings} readings are outside the table's {slowest:g} to {fastest:g} rpm; its"
            " nearest row was compared"
        )
    conflict = stand_conflict(found.ratio, found.ratio_error, aircraft.uncertainty if aircraft else Uncertainty())
    if conflict:
        sentences.append(conflict)
    return sentences


def to_toml(found: "ThrustStand") -> str:
    """The sections of an aircraft file."""
    return (
        f"[propulsion]\nstatic_thrust_ratio = {found.ratio:.4f}\n\n"
        f'[uncertainty]\nstatic_thrust_ratio = "{100 * found.ratio_error / found.ratio:.2g} %"\n'
    )
