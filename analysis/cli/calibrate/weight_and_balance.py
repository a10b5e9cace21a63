"""`calibrate weight-and-balance`"""

from typing import TYPE_CHECKING, Annotated

import typer

from analysis.cli.calibrate.runner import AircraftFileLines, Calibrated, calibration
from flight.command_line import numbers_and_unit, quantity
from flight.errors import InputError
from flight.units import to_si

if TYPE_CHECKING:
    from analysis.ground.weight_and_balance import Support, WeightAndBalance

EXAMPLE = '--scale "0.12 m: 1.25 1.26 kg"'


@calibration(AircraftFileLines)
def weight_and_balance(
    scale: Annotated[
        list[str] | None,
        typer.Option(
            "--scale",
            metavar="READINGS",
            help="One wheel or point of suspension: its position aft of a datum, then the readings with their unit at"
            ' the end: "0.12 m: 1.25 1.26 kg". Once for each. Without a position, the weight alone is found.',
        ),
    ] = None,
    reading_error: Annotated[
        float,
        typer.Option(
            "--reading-error",
            metavar="MASS",
            parser=quantity("--reading-error", "kg", '"5 g"', above=0, most=100),
            help='Error of one reading, 1 sigma, in kg or with a unit: "5 g".',
        ),
    ] = 0.005,
    gain_error: Annotated[
        float,
        typer.Option(
            "--gain-error",
            metavar="SHARE",
            parser=quantity("--gain-error", "%", '"0.1%"', least=0, most=10),
            help="Error common to all readings, as a share of the weight, 1 sigma, in %.",
        ),
    ] = 0.1,
    position_error: Annotated[
        float,
        typer.Option(
            "--position-error",
            metavar="LENGTH",
            parser=quantity("--position-error", "m", '"2 mm"', above=0, most=10),
            help='Error of a position, 1 sigma, in m or with a unit: "2 mm".',
        ),
    ] = 0.002,
) -> Calibrated:
    """Compute weight and center of gravity with their errors, from scales under the wheels or in a suspension.

    Set the aircraft level and ready to fly on one scale a wheel, or hang it from spring scales; indoors. Measure the
    position of each support aft of a datum, such as the leading edge. Read each scale several times, the aircraft
    lifted off in between. The result is the weight with its uncertainty for the aircraft file ([mass] weight and
    [uncertainty] weight), which enters the interval of the power curve, and the center of gravity, from which the
    positions of probe and IMU are measured.

    Exit code 1 and no file if readings of one support contradict each other, or the weight stays uncertain by 2 %.

    \b
    Examples:
      calibrate weight-and-balance --scale "4.08 4.09 kg"
      calibrate weight-and-balance --scale "0.0 m: 1.2 kg" --scale "0.4 m: 2.9 kg"
    """
    from analysis.ground import weight_and_balance as computation

    errors = computation.ScaleErrors(reading_error, gain_error / 100, position_error)
    found = computation.weight_and_balance([support(text) for text in scale or []], errors)
    return Calibrated(summary(found), computation.to_toml(found), unsupported=found.unsupported)


def support(text: str) -> "Support":
    """A support of the text after --scale. Raises InputError naming the option."""
    from analysis.ground.weight_and_balance import Support

    position, _, readings = text.rpartition(":")
    numbers, unit = numbers_and_unit(readings, "--scale", EXAMPLE)
    if not numbers:
        raise InputError(f"--scale {text!r}: numbers and their unit are needed, such as {EXAMPLE}")
    values = tuple(to_si(f"{number} {unit}", "kg", "--scale") for number in numbers)
    return Support(to_si(position.strip(), "m", "--scale") if position.strip() else None, values)


def summary(found: "WeightAndBalance") -> list[str]:
    """The result in lines."""
    from analysis.estimation.noise import NORMAL_95

    lines = [f"weight {found.mass_kg:.3f} ± {NORMAL_95 * found.mass_error_kg:.3f} kg (95 % interval)"]
    if found.position_m is None or found.position_error_m is None:
        lines.append("note: a support has no position, so the center of gravity is not computed")
    else:
        half_mm = 1e3 * NORMAL_95 * found.position_error_m
        lines.append(f"center of gravity {1e3 * found.position_m:.1f} ± {half_mm:.1f} mm aft of the datum")
    return lines
