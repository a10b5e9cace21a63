"""Weight and center of gravity from readings of scales under the wheels or in a suspension, with their errors."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from analysis.signals.settings import STATISTICS
from flight.aircraft import Uncertainty
from flight.errors import InputError


class Support(NamedTuple):
    """One wheel or point of suspension: position [m] aft of the datum (None if not measured), readings [kg]."""

    position_m: float | None
    readings_kg: tuple[float, ...]


class ScaleErrors(NamedTuple):
    """Standard deviations: of one reading [kg], of the scale's gain, common to all, and of a position [m]."""

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


def weight_and_balance(supports: Sequence[Support], errors: ScaleErrors) -> WeightAndBalance:
    """The sum of the supports' means, and the center of their moments.

    The scatter of repeated readings counts where it is larger than the stated error of a reading. Raises InputError
    for no support, and for a sum that is not positive.
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
    known = [support.position_m for support in supports if support.position_m is not None]
    if len(known) == len(supports):
        x = np.array(known)
        position = float(mass @ x / total)  # a gain that is common to all scales does not move it
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
    largest = 10 * Uncertainty.weight_fraction  # of what the analysis assumes without a weighing
    if share > largest:
        return (
            f"the standard error of the weight is {100 * share:.1f} %, more than {100 * largest:.0f} %:"
            " use a better scale"
        )
    return ""


def to_toml(found: WeightAndBalance) -> str:
    """The sections of an aircraft file."""
    decimals = max(0, 4 - int(np.floor(np.log10(found.mass_kg))))
    return (
        f'[mass]\nweight = "{found.mass_kg:.{decimals}f} kg"\n\n'
        f'[uncertainty]\nweight = "{100 * found.mass_error_kg / found.mass_kg:.2g} %"\n'
    )
