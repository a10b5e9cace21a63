"""Computes weight and center of gravity, with errors, from scales under the wheels or in a suspension."""

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
import typer

from flightpower.analysis.calibrations.runner import AircraftFileLines, Calibrated, calibration
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.command_line import Quantity, numbers_and_unit
from flightpower.flight.errors import InputError
from flightpower.flight.units import to_si


class Support(NamedTuple):
    """One wheel or suspension point: position [m] aft of the datum (None if not measured), and readings [kg]."""

    position_m: float | None
    readings_kg: tuple[float, ...]


class ScaleErrors(NamedTuple):
    """Standard deviations of one reading [kg], of the gain (a fraction) that all scales share, of a position [m]."""

    reading_kg: float
    gain: float
    position_m: float


class WeightAndBalance(NamedTuple):
    """Mass [kg] and position of the center of gravity aft of the datum [m], each with its standard error.

    position_m, position_error_m : None if a support's position was not measured
    unsupported : why the readings do not support a result; empty if they do
    """

    mass_kg: float
    mass_error_kg: float
    position_m: float | None
    position_error_m: float | None
    unsupported: str


def weighed(supports: Sequence[Support], errors: ScaleErrors) -> WeightAndBalance:
    """Compute the mass from the supports' mean readings, and the center of gravity from their moments.

    The scatter of repeated readings replaces the stated error of a reading if it is larger. Raises InputError if there
    is no support, or if the sum is not positive.
    """
    if not supports:
        raise InputError("--scale: give the reading under each wheel or point of suspension")
    mass = np.array([np.mean(support.readings_kg) for support in supports])
    total = float(mass.sum())
    if not total > 0:
        raise InputError(f"--scale: the readings add up to {total:g} kg; subtract what is not part of the aircraft")
    spread = np.array([np.std(s.readings_kg, ddof=1) if len(s.readings_kg) > 1 else 0.0 for s in supports])
    counts = np.array([len(support.readings_kg) for support in supports])
    sigma = np.maximum(spread, errors.reading_kg) / np.sqrt(counts)
    mass_error = float(np.hypot(np.sqrt(np.sum(sigma**2)), errors.gain * total))
    position = position_error = None
    positions_m = [support.position_m for support in supports if support.position_m is not None]
    if len(positions_m) == len(supports):
        x = np.array(positions_m)
        position = float(mass @ x / total)  # a gain error that all scales share does not move it
        by_mass, by_position = (x - position) / total * sigma, mass / total * errors.position_m
        position_error = float(np.sqrt(np.sum(by_mass**2) + np.sum(by_position**2)))
    return WeightAndBalance(total, mass_error, position, position_error, _why_not(supports, errors, mass_error / total))


def _why_not(supports: Sequence[Support], errors: ScaleErrors, share: float) -> str:
    for number, support in enumerate(supports, start=1):
        apart = max(support.readings_kg) - min(support.readings_kg)
        if apart > STATISTICS.sigmas * np.sqrt(2) * errors.reading_kg:
            return (
                f"readings of support {number} differ by {1e3 * apart:.0f} g, more than three times their error: let"
                " the scale settle, and weigh without wind"
            )
    largest = 10 * Uncertainty.weight_fraction  # without a weighing the analysis assumes a tenth of this
    if share > largest:
        return (
            f"the standard error of the weight is {100 * share:.1f} %, more than {100 * largest:.0f} %:"
            " use a better scale"
        )
    return ""


def to_toml(balance: WeightAndBalance) -> str:
    """Return the result as sections of an aircraft file."""
    decimals = max(0, 4 - int(np.floor(np.log10(balance.mass_kg))))
    return (
        f'[mass]\nweight = "{balance.mass_kg:.{decimals}f} kg"\n\n'
        f'[uncertainty]\nweight = "{100 * balance.mass_error_kg / balance.mass_kg:.2g} %"\n'
    )


EXAMPLE = '--scale "0.12 m: 1.25 1.26 kg"'


@calibration(AircraftFileLines)
def weight_and_balance(
    scale: Annotated[
        list[str] | None,
        typer.Option(
            "--scale",
            metavar="READINGS",
            help="One wheel or point of suspension: its position aft of a datum, then the readings with their unit at"
            ' the end: "0.12 m: 1.25 1.26 kg". Once for each. Without a position only the weight is computed.',
        ),
    ] = None,
    reading_error: Annotated[
        float,
        Quantity("--reading-error", "kg", '"5 g"', above=0, most=100).as_option(
            'Error of one reading, 1 sigma, in kg or with a unit: "5 g".'
        ),
    ] = 0.005,
    gain_error: Annotated[
        float,
        Quantity("--gain-error", "%", '"0.1%"', least=0, most=10).as_option(
            "Error common to all readings, as a share of the weight, 1 sigma, in %."
        ),
    ] = 0.1,
    position_error: Annotated[
        float,
        Quantity("--position-error", "m", '"2 mm"', above=0, most=10).as_option(
            'Error of a position, 1 sigma, in m or with a unit: "2 mm".'
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

    errors = ScaleErrors(reading_error, gain_error / 100, position_error)
    balance = weighed([support(text) for text in scale or []], errors)
    return Calibrated(summary(balance), to_toml(balance), unsupported=balance.unsupported)


def support(text: str) -> "Support":
    """Parse a support from the text after --scale. Raises InputError naming the option."""

    position, _, readings = text.rpartition(":")
    numbers, unit = numbers_and_unit(readings, "--scale", EXAMPLE)
    if not numbers:
        raise InputError(f"--scale {text!r}: numbers and their unit are needed, such as {EXAMPLE}")
    values = tuple(to_si(f"{number} {unit}", "kg", "--scale") for number in numbers)
    return Support(to_si(position.strip(), "m", "--scale") if position.strip() else None, values)


def summary(balance: "WeightAndBalance") -> list[str]:
    """Return the result as lines of text."""
    from flightpower.analysis.estimation.noise import NORMAL_95

    lines = [f"weight {balance.mass_kg:.3f} ± {NORMAL_95 * balance.mass_error_kg:.3f} kg (95 % interval)"]
    if balance.position_m is None or balance.position_error_m is None:
        lines.append("note: a support has no position, so the center of gravity is not computed")
    else:
        half_mm = 1e3 * NORMAL_95 * balance.position_error_m
        lines.append(f"center of gravity {1e3 * balance.position_m:.1f} ± {half_mm:.1f} mm aft of the datum")
    return lines
