"""`calibrate surfaces`"""

import math
from enum import StrEnum
from typing import Annotated

import typer

from analysis.cli.calibrate.runner import AircraftFileLines, Calibrated, LogFile, calibration
from flight.errors import InputError


class SurfaceName(StrEnum):
    elevator = "elevator"
    aileron = "aileron"
    rudder = "rudder"


@calibration(AircraftFileLines)
def surfaces(
    log: LogFile,
    surface: Annotated[
        SurfaceName,
        typer.Option("--surface", metavar="SURFACE", help="The surface that was moved: elevator, aileron or rudder."),
    ] = SurfaceName.elevator,
    angles: Annotated[
        str,
        typer.Option(
            "--angles",
            metavar="ANGLES",
            help='Angles read from the protractor, in order, in degrees: "-22 -11 0 11 -". Give - for one not read.',
        ),
    ] = "",
    channel: Annotated[
        int | None,
        typer.Option("--channel", metavar="N", help="Servo output, from 1; default: that of the log's aircraft file."),
    ] = None,
) -> Calibrated:
    """Relate surface angle to servo pulse, from a session with a protractor.

    Start the daemon, motor disarmed. Clamp a protractor (a digital level will do) to the surface, zero it at neutral.
    Move the stick to five positions from end to end, hold each still for three seconds or more, and write the angles
    down in order. Moving there and back shows the play of the linkage. Positive: elevator trailing edge down, aileron
    rolls right, rudder trailing edge left.

    Run this command without --angles first: it lists the time and pulse of each position found. Then give the angles,
    and - for a position that was not read (a pause at neutral, for example). The resulting section goes into the
    aircraft file. Nothing is written for fewer than three positions, or if positions are nearer to each other than
    twice the difference of two readings of one position.

    To rehearse it: `sim fly --plan surface-deflections -o out/surfaces`.

    \b
    Examples:
      calibrate surfaces log.mcap --surface elevator
      calibrate surfaces log.mcap --surface elevator --angles "-22 -11 0 11 22"
    """
    from analysis.airdata.surfaces import found_in_words, held_pulses, surface_table, to_toml
    from analysis.log_contents import aircraft_of
    from analysis.signals.channels import servo_pulses
    from flight.aircraft import ControlSurface
    from flight.log_reader import read_log

    angles_deg = [_angle_deg(word) for word in angles.replace(",", " ").split()]
    recorded = read_log(log)
    number = channel
    if number is None:
        known: ControlSurface | None = getattr(aircraft_of(recorded), surface.value)
        if known is None:
            raise InputError(f"{log}: its aircraft file has no section [{surface.value}]; give --channel, from 1")
        number = known.channel
    if number < 1:
        raise InputError(f"--channel {number}: servo outputs count from 1")
    t_s, pulse_us = servo_pulses(recorded, number)
    if not len(pulse_us):
        raise InputError(f"{log}: no pulse of servo output {number} in this log; name another with --channel")
    found = held_pulses(t_s, pulse_us)
    if not found:
        raise InputError(f"{log}: servo output {number} was never held for two seconds; hold each position for three")
    if not angles_deg:
        return Calibrated([f"positions of output {number}: {found_in_words(found)}. Now give --angles."])
    table = surface_table(found, angles_deg)
    said = (
        f"{len(table.pulse_us)} positions; angles of a position read twice differ by {table.hysteresis_deg:.1f} deg"
        " at most"
    )
    return Calibrated([said], to_toml(surface.value, number, table))


def _angle_deg(word: str) -> float | None:
    if word == "-":
        return None
    try:
        angle = float(word)
    except ValueError:
        angle = math.nan
    if not abs(angle) < 90.0:
        raise InputError(f"--angles: {word!r} is not an angle in degrees; give - for a position not read")
    return angle
