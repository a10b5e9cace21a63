"""Bending of the probe's boom, from weights hung on its tip and the angle of a level on the probe under each.

The level shows how the boom bends plus how the aircraft pitches when its gear gives under the weight. The IMU in the
log shows the pitch. The rest is fitted by a constant and a term in proportion to the force at the tip. In flight the
boom carries itself and the probe: m g under each g of load factor, where m is the mass of the probe and a third of the
boom's (slope at the end of a cantilever: F l^2 / 2 E I under a force at its tip, w l^3 / 6 E I under its own weight).
"""

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
import pandas as pd
import typer

from flightpower.analysis.air.settings import STAND_LIMITS
from flightpower.analysis.calibrations.runner import AircraftFileLines, Calibrated, LogFile, calibration
from flightpower.analysis.calibrations.thrust import student_fit
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.sources.rest import FORCES, resting_stretches
from flightpower.flight.command_line import Quantity, numbers_and_unit
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2, to_si


class HangingWeight(NamedTuple):
    """A stretch in which the aircraft stood still: the time [s] at its middle, and the aircraft's pitch [rad]."""

    time_s: float
    pitch_rad: float


class CarriedMass(NamedTuple):
    """Mass that bends the boom in flight: the probe's plus a third of the boom's. error: 1 sigma, as a fraction."""

    mass_kg: float
    error: float


class BoomBending(NamedTuple):
    """Angle by which the boom bends down per g [rad], and its standard error. per_N_rad: angle per N at the tip"""

    per_g_rad: float
    error_rad: float
    per_N_rad: float


def hanging_weights(table: pd.DataFrame, source: str) -> list[HangingWeight]:
    """Return the stretches at rest, in order of time. table: from `sources.daemon.synchronize`.

    Raises InputError if there are too few for a straight line.
    """
    stops = []
    for stretch in resting_stretches(table):
        x, y, z = (float(stretch[name].mean()) for name in FORCES)
        stops.append(HangingWeight(float(stretch.index.to_numpy().mean()), math.atan2(x, math.hypot(y, z))))
    if len(stops) < STATISTICS.fewest_readings:
        raise InputError(
            f"{source}: the aircraft stood still {len(stops)} times; hang {STAND_LIMITS.fewest_speeds} weights or more,"
            " up and down, and let it stand for ten seconds with each, and before and after"
        )
    return stops


def boom_bending(
    weights: Sequence[HangingWeight], mass_kg: Sequence[float], level_rad: Sequence[float], carried: CarriedMass
) -> BoomBending:
    """Fit the bending to weights mass_kg (k,) on the tip and the level's angles level_rad (k,), positive nose up.

    Raises InputError if there are fewer different weights than a straight line needs, or if the boom bends up.
    """
    if len(set(mass_kg)) < STAND_LIMITS.fewest_speeds:
        raise InputError(
            f"--weights: {len(set(mass_kg))} different ones; {STAND_LIMITS.fewest_speeds} are needed, 0 among"
        )
    force_N = GRAVITY_MPS2 * np.array(mass_kg)
    pitch = np.array([weight.pitch_rad for weight in weights])
    bent_down = pitch - np.array(level_rad)
    X = np.column_stack([np.ones(len(force_N)), force_N])
    per_N, sigma = (float(values[1]) for values in student_fit(X, bent_down))
    at_1_g_N = GRAVITY_MPS2 * carried.mass_kg
    if per_N < -2 * sigma:
        raise InputError(
            "--angles: the boom bends up under a weight; give the level's angles positive with the nose up"
        )
    per_g = max(per_N, 0.0) * at_1_g_N
    return BoomBending(per_g, math.hypot(sigma * at_1_g_N, carried.error * per_g), per_N)


def in_words(weights: Sequence[HangingWeight]) -> str:
    """Return a list of the stretches at rest, for the user to match with written notes."""
    return ", ".join(f"{number} at {weight.time_s:.0f} s" for number, weight in enumerate(weights, start=1))


WEIGHTS, ANGLES = '"0 100 200 300 200 100 0 g"', '"4.1 2.0 -0.1 -2.2 -0.2 2.1 4.2 deg"'


@calibration(AircraftFileLines)
def boom(
    log: LogFile,
    weights: Annotated[
        str,
        typer.Option(
            "--weights",
            metavar="LIST",
            help=f"Mass hung on the tip at each stop, with its unit at the end: {WEIGHTS}.",
        ),
    ] = "",
    angles: Annotated[
        str,
        typer.Option(
            "--angles",
            metavar="LIST",
            help=f"Reading of a level on the probe with each, positive nose up, with its unit at the end: {ANGLES}.",
        ),
    ] = "",
    carried: Annotated[
        float | None,
        Quantity("--carried", "kg", '"45 g"', above=0, most=10).as_option(
            "Mass that bends the boom in flight: the probe, plus a third of the boom beyond its clamp."
        ),
    ] = None,
    carried_error: Annotated[
        float,
        Quantity("--carried-error", "%", '"10%"', least=0, most=100).as_option("Error of this mass, 1 sigma, in %."),
    ] = 10.0,
) -> Calibrated:
    """Measure how far the probe's boom bends under load, with weights on its tip and a level on the probe.

    Put the aircraft on its gear, indoors, and a digital level on the probe. Start the daemon and let all stand still
    for ten seconds. Hang a weight on the tip, read the level, and let it stand for ten seconds; three weights or more,
    up and down again, so that the boom bends by some degrees. Let it stand for ten seconds without weight at the end.

    A boom that bends under its load factor makes the angle of attack wrong, most in slow and accelerated flight. The
    lines printed for the aircraft file correct for it, and say how well. The yielding of the landing gear is in the log
    and is subtracted.

    Run this command without --weights first: it lists the times at which the aircraft stood still. Exit code 2 if the
    lists do not fit them.

    To rehearse it: `sim fly --plan boom-weights -o out/boom`.

    \b
    Examples:
      calibrate boom log.mcap
      calibrate boom log.mcap --weights "0 100 200 300 200 100 0 g"
        --angles "4.1 2.0 -0.1 -2.2 -0.2 2.1 4.2 deg" --carried "45 g"
    """
    from flightpower.analysis.sources.daemon import synchronize
    from flightpower.flight.log_reader import read_log

    mass_kg, level_rad = quantities(weights, "kg", "--weights", WEIGHTS), quantities(angles, "rad", "--angles", ANGLES)
    hung = hanging_weights(synchronize(read_log(log)).table, str(log))
    if not mass_kg and not level_rad:
        stood = f"the aircraft stood still {len(hung)} times: {in_words(hung)}"
        return Calibrated([f"{stood}. Now give --weights, --angles and --carried."])
    for option, values in (("--weights", mass_kg), ("--angles", level_rad)):
        if len(values) != len(hung):
            raise InputError(
                f"{option}: {len(values)} values, but the aircraft stood still {len(hung)} times:"
                f" {in_words(hung)}; give one for each, with 0 where nothing hung on the tip"
            )
    if carried is None:
        raise InputError('--carried: give the mass of the probe and a third of the boom\'s, such as "45 g"')
    bending = boom_bending(hung, mass_kg, level_rad, CarriedMass(carried, carried_error / 100))
    return Calibrated(summary(bending), to_toml(bending))


def quantities(text: str, unit: str, option: str, example: str) -> list[float]:
    """Convert a list that ends with its unit to values in `unit`; empty for an empty text. Raises InputError."""
    numbers, unit_text = numbers_and_unit(text, option, example)
    return [to_si(f"{number} {unit_text}", unit, option) for number in numbers]


def summary(bending: "BoomBending") -> list[str]:
    """Return the result as lines of text."""
    from flightpower.analysis.estimation.noise import NORMAL_95

    per_g, half, per_N = (
        math.degrees(x) for x in (bending.per_g_rad, NORMAL_95 * bending.error_rad, bending.per_N_rad)
    )
    return [
        f"the boom bends down by {per_N:.3f} deg per newton at its tip: in flight by {per_g:.3f} ± {half:.3f} deg"
        " under each g (95 % interval)"
    ]


def to_toml(bending: "BoomBending") -> str:
    """Return the result as sections of an aircraft file."""
    return (
        f'[uncertainty]\nboom_bending = "{math.degrees(bending.error_rad):.2g} deg"\n\n'
        f'[probe]\nboom_bending = "{math.degrees(bending.per_g_rad):.4f} deg"\n'
    )
