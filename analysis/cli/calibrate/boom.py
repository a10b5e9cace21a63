"""`calibrate boom`"""

import math
from typing import TYPE_CHECKING, Annotated

import typer

from analysis.cli.calibrate.runner import AircraftFileLines, Calibrated, LogFile, calibration
from flight.command_line import numbers_and_unit, quantity
from flight.errors import InputError
from flight.units import to_si

if TYPE_CHECKING:
    from analysis.ground.boom import BoomBending

WEIGHTS, ANGLES = '"0 100 200 300 200 100 0 g"', '"4.1 2.0 -0.1 -2.2 -0.2 2.1 4.2 deg"'


@calibration(AircraftFileLines)
def boom(
    log: LogFile,
    weights: Annotated[
        str,
        typer.Option(
            "--weights",
            metavar="LIST",
            help=f"What hung on the tip each time the aircraft stood still, with its unit at the end: {WEIGHTS}.",
        ),
    ] = "",
    angles: Annotated[
        str,
        typer.Option(
            "--angles",
            metavar="LIST",
            help=f"What a level on the probe showed with each, positive nose up, with its unit at the end: {ANGLES}.",
        ),
    ] = "",
    carried: Annotated[
        float | None,
        typer.Option(
            "--carried",
            metavar="MASS",
            parser=quantity("--carried", "kg", '"45 g"', above=0, most=10),
            help="Mass that bends the boom in flight: that of the probe, and a third of the boom's, from its clamp on.",
        ),
    ] = None,
    carried_error: Annotated[
        float,
        typer.Option(
            "--carried-error",
            metavar="SHARE",
            parser=quantity("--carried-error", "%", '"10%"', least=0, most=100),
            help="Error of this mass, 1 sigma, in %.",
        ),
    ] = 10.0,
) -> Calibrated:
    """Measure how far the probe's boom bends under load, with weights on its tip and a level on the probe.

    Put the aircraft on its gear, indoors, and a digital level on the probe. Start the daemon and let all stand still
    for ten seconds. Hang a weight on the tip, read the level, and let it stand for ten seconds; three weights or more,
    up and down again, so that the boom bends by some degrees. Let it stand for ten seconds without weight at the end.

    A boom that bends under its load factor makes the angle of attack wrong, most in slow and accelerated flight. The
    lines printed for the aircraft file correct for it, and say how well. How far the aircraft gives on its gear is
    subtracted: it is in the log.

    Run this command without --weights first: it lists the times at which the aircraft stood still. Exit code 2 if the
    lists do not fit them.

    To rehearse it: `sim fly --plan boom-weights -o out/boom`.

    \b
    Examples:
      calibrate boom log.mcap
      calibrate boom log.mcap --weights "0 100 200 300 200 100 0 g"
        --angles "4.1 2.0 -0.1 -2.2 -0.2 2.1 4.2 deg" --carried "45 g"
    """
    from analysis.ground import boom as computation
    from analysis.signals.channels import synchronize
    from flight.log_reader import read_log

    mass_kg, level_rad = quantities(weights, "kg", "--weights", WEIGHTS), quantities(angles, "rad", "--angles", ANGLES)
    found = computation.hanging_weights(synchronize(read_log(log)).table, str(log))
    if not mass_kg and not level_rad:
        stood = f"the aircraft stood still {len(found)} times: {computation.in_words(found)}"
        return Calibrated([f"{stood}. Now give --weights, --angles and --carried."])
    for option, values in (("--weights", mass_kg), ("--angles", level_rad)):
        if len(values) != len(found):
            raise InputError(
                f"{option}: {len(values)} values, but the aircraft stood still {len(found)} times:"
                f" {computation.in_words(found)}; give one for each, with 0 where nothing hung on the tip"
            )
    if carried is None:
        raise InputError('--carried: give the mass of the probe and a third of the boom\'s, such as "45 g"')
    bending = computation.boom_bending(found, mass_kg, level_rad, computation.CarriedMass(carried, carried_error / 100))
    return Calibrated(summary(bending), to_toml(bending))


def quantities(text: str, unit: str, option: str, example: str) -> list[float]:
    """Values in `unit` of a list with its unit at the end; empty for an empty text. Raises InputError."""
    numbers, given = numbers_and_unit(text, option, example)
    return [to_si(f"{number} {given}", unit, option) for number in numbers]


def summary(bending: "BoomBending") -> list[str]:
    """The result in lines."""
    from analysis.estimation.noise import NORMAL_95

    per_g, half, per_N = (
        math.degrees(x) for x in (bending.per_g_rad, NORMAL_95 * bending.error_rad, bending.per_N_rad)
    )
    return [
        f"the boom bends down by {per_N:.3f} deg per newton at its tip: in flight by {per_g:.3f} ± {half:.3f} deg"
        " under each g (95 % interval)"
    ]


def to_toml(bending: "BoomBending") -> str:
    """The sections of an aircraft file."""
    return (
        f'[uncertainty]\nboom_bending = "{math.degrees(bending.error_rad):.2g} deg"\n\n'
        f'[probe]\nboom_bending = "{math.degrees(bending.per_g_rad):.4f} deg"\n'
    )
