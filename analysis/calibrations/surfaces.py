"""Relates surface angle to servo pulse: the pulses are from a log, the angles are read from a protractor."""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import Annotated, NamedTuple

import numpy as np
import typer

from flightpower.analysis.air.settings import GROUND
from flightpower.analysis.calibrations.runner import AircraftFileLines, Calibrated, LogFile, calibration
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError


class HeldPulse(NamedTuple):
    """A pulse that was held: its start [s], its duration [s], and its median [us]."""

    start_s: float
    seconds: float
    pulse_us: float


class SurfaceTable(NamedTuple):
    """Pulses in ascending order with their angles, for the aircraft file.

    hysteresis_deg : largest difference between angles read for one position
    """

    pulse_us: list[int]
    angle_deg: list[float]
    hysteresis_deg: float


def held_pulses(t_s: Array, pulse_us: Array) -> list[HeldPulse]:
    """Return the pulses held for at least GROUND.held_s[1], in order of time. t_s, pulse_us : (n,)"""
    if len(t_s) < 2:
        return []
    holds: list[HeldPulse] = []
    start, first = 0, max(1, round(GROUND.reference_s / float(np.median(np.diff(t_s)))))
    for i in range(1, len(t_s) + 1):
        reference_us = np.median(pulse_us[start : min(i, start + first)])
        ended = i == len(t_s) or abs(pulse_us[i] - reference_us) > GROUND.jitter_us
        if not ended:
            continue
        if t_s[i - 1] - t_s[start] >= GROUND.held_s[1]:
            holds.append(
                HeldPulse(float(t_s[start]), float(t_s[i - 1] - t_s[start]), float(np.median(pulse_us[start:i])))
            )
        start = i
    return holds


def surface_table(holds: Sequence[HeldPulse], angles_deg: Sequence[float | None]) -> SurfaceTable:
    """Make a table of pulses and angles; an angle is None if it was not read.

    Raises InputError if the numbers of angles and held pulses differ, if too few positions were read, if the angles do
    not rise or fall steadily with the pulse, or if a step between two positions is not significant. Two readings of one
    position that differ by d have a standard deviation of d/sqrt(2) each, so a step is significant (95 %) from 1.96 d.
    """
    if len(holds) != len(angles_deg):
        raise InputError(
            f"{len(angles_deg)} angles for {len(holds)} positions: give one for each, in order, and - for one that"
            f" was not read. Positions: {found_in_words(holds)}"
        )
    read = sorted((hold.pulse_us, angle) for hold, angle in zip(holds, angles_deg, strict=True) if angle is not None)
    groups: list[list[tuple[float, float]]] = []
    for pulse, angle in read:
        if groups and pulse - groups[-1][0][0] <= GROUND.same_us:
            groups[-1].append((pulse, angle))
        else:
            groups.append([(pulse, angle)])
    _, fewest = GROUND.fewest
    if len(groups) < fewest:
        raise InputError(
            f"too few positions with an angle ({len(groups)}); {fewest} at least are needed, five are better"
        )
    pulses = [round(float(np.mean([p for p, _ in group]))) for group in groups]
    angles = [float(np.mean([a for _, a in group])) for group in groups]
    steps = np.diff(angles)
    if not (np.all(steps > 0) or np.all(steps < 0)):
        pairs = ", ".join(f"{p} us {a:+.1f} deg" for p, a in zip(pulses, angles, strict=True))
        raise InputError(f"the angle does not rise or fall steadily with the pulse ({pairs}): is the order right?")
    play = max(float(np.ptp([a for _, a in group])) for group in groups)
    least = float(np.min(np.abs(steps)))
    if least < NORMAL_95 * play:
        raise InputError(
            f"two readings of one position differ by {play:.1f} deg, neighboring positions only by {least:.1f} deg:"
            " remove the play of the linkage, or hold positions further apart, and measure again"
        )
    return SurfaceTable(pulses, angles, play)


def found_in_words(holds: Sequence[HeldPulse]) -> str:
    """Return a list of the held pulses and their times, for the user to match with the angles written down."""
    return ", ".join(f"{k}: {h.pulse_us:.0f} us at {h.start_s:.0f} s" for k, h in enumerate(holds, start=1)) or "none"


def to_toml(surface: str, channel: int, table: SurfaceTable) -> str:
    """Return the surface's section of an aircraft file."""
    angles = ", ".join(f'"{angle:.1f} deg"' for angle in table.angle_deg)
    return f"[{surface}]\nchannel = {channel}\npulse_us = {table.pulse_us}\nangle = [{angles}]\n"


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
            help='Angles read from the protractor, in order, in degrees: "-22 -11 0 11 -". Write - for a missing'
            " reading.",
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
    from flightpower.analysis.air.contents import aircraft_of
    from flightpower.analysis.sources.daemon import servo_pulses
    from flightpower.flight.aircraft import ControlSurface
    from flightpower.flight.log_reader import read_log

    angles_deg = [_angle_deg(word) for word in angles.replace(",", " ").split()]
    recorded = read_log(log)
    number = channel
    if number is None:
        previous: ControlSurface | None = getattr(aircraft_of(recorded), surface.value)
        if previous is None:
            raise InputError(f"{log}: its aircraft file has no section [{surface.value}]; give --channel, from 1")
        number = previous.channel
    if number < 1:
        raise InputError(f"--channel {number}: servo outputs count from 1")
    t_s, pulse_us = servo_pulses(recorded, number)
    if not len(pulse_us):
        raise InputError(f"{log}: no pulse of servo output {number} in this log; name another with --channel")
    pulses = held_pulses(t_s, pulse_us)
    if not pulses:
        raise InputError(f"{log}: servo output {number} was never held for two seconds; hold each position for three")
    if not angles_deg:
        return Calibrated([f"positions of output {number}: {found_in_words(pulses)}. Now give --angles."])
    table = surface_table(pulses, angles_deg)
    lines = (
        f"{len(table.pulse_us)} positions; angles of a position read twice differ by {table.hysteresis_deg:.1f} deg"
        " at most"
    )
    return Calibrated([lines], to_toml(surface.value, number, table))


def _angle_deg(word: str) -> float | None:
    if word == "-":
        return None
    try:
        angle = float(word)
    except ValueError:
        angle = math.nan
    if not abs(angle) < 90.0:
        raise InputError(f"--angles: {word!r} is not an angle in degrees; write - for a missing reading")
    return angle
