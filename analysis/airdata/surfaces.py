"""Surface angle against servo pulse: pulses from a log, angles read from a protractor."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from analysis.airdata.settings import GROUND
from analysis.estimation.noise import NORMAL_95
from flight.arrays import Array
from flight.errors import InputError


class HeldPulse(NamedTuple):
    """A pulse that was held: when it began [s], for how long [s], and its median [us]."""

    start_s: float
    seconds: float
    pulse_us: float


class SurfaceTable(NamedTuple):
    """Pulses in ascending order with their angles, for the aircraft file.

    hysteresis_deg : largest difference of the angles read for one position
    """

    pulse_us: list[int]
    angle_deg: list[float]
    hysteresis_deg: float


def held_pulses(t_s: Array, pulse_us: Array) -> list[HeldPulse]:
    """Pulses held for the time of GROUND.held_s at least, in order of time. t_s, pulse_us : (n,)."""
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
    """The table of pulses and angles; an angle is None where it was not read.

    Raises InputError if there are not as many angles as held pulses, if too few positions were read, if they
    do not rise or fall with the pulse, or if a step between two positions is not significant: two readings of one
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
        raise InputError(f"too few positions with an angle ({len(groups)}); {fewest} at least are needed, better five")
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
    """The held pulses with their times, to be matched with the written angles."""
    return ", ".join(f"{k}: {h.pulse_us:.0f} us at {h.start_s:.0f} s" for k, h in enumerate(holds, start=1)) or "none"


def to_toml(surface: str, channel: int, table: SurfaceTable) -> str:
    """The surface's section of an aircraft file."""
    angles = ", ".join(f'"{angle:.1f} deg"' for angle in table.angle_deg)
    return f"[{surface}]\nchannel = {channel}\npulse_us = {table.pulse_us}\nangle = [{angles}]\n"
