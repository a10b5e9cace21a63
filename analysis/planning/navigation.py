"""A plan over the ground: headings and durations by which a flight stays, in wind, where it is watched from.

Dead reckoning in the mean wind. A plan is a row of straight parts with turns between them. A straight part is crabbed
so that it ends on the line of the legs. What is held or porpoised in it becomes shorter where the part would be longer
over the ground than a leg, and longer until the next part will lie about the middle of the legs: the flight takes
longer against the wind than with it.

x is along the first leg, y to its right, from the place of take-off [m].
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import asin, cos, pi, sin

import numpy as np
from numpy.typing import NDArray

from analysis.planning.expected_aircraft import ExpectedAircraft
from analysis.planning.pieces import Hold, Maneuver, Porpoise, Space, Turn
from analysis.planning.settings import PATH
from analysis.planning.time_history import Path, paths, turn_path, turn_rate, wind_vector

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Part:
    """A straight part through the air, and the turn after it.

    held : number of the maneuver that becomes longer or shorter, the fastest one     turn : of the turn; None: none
    """

    air_m: float
    seconds: float
    held: int | None
    turn: int | None


def kept_in_place(
    plan: Sequence[Maneuver], expected: ExpectedAircraft, space: Space, wind_mps: float
) -> list[Maneuver]:
    """The same maneuvers, with other angles of turns and other durations of what is held or porpoised."""
    flown, wind, found = paths(plan, expected, space.height_m), wind_vector(wind_mps), list(plan)
    parts = list(_parts(plan, flown))
    place, heading, way, before = np.zeros(2), 0.0, 1.0, None  # of x, the turn before
    turned = place  # where the part begins, if the turn before is flown as planned first
    for part, after in pairwise([*parts, None]):
        assert part is not None
        headwind_mps = -way * float(wind[0])
        if part.held is not None and part.turn is not None and after is not None:
            held = found[part.held]
            assert isinstance(held, Hold | Porpoise)
            back_m = _turn_back_m(flown[part.turn], after, headwind_mps, space)
            longer_s = _longer_s(part, held, headwind_mps, (back_m - way * float(turned[0]), space.leg_m))
            found[part.held] = replace(held, duration_s=held.duration_s + longer_s)
            part = replace(part, air_m=part.air_m + longer_s * held.speed_mps, seconds=part.seconds + longer_s)
        if before is None:
            place = turned
        else:
            across = -float(turned[1] + wind[1] * part.seconds) / max(part.air_m, 1.0)
            steepest = 0.64  # 40 deg: beyond it a leg hardly advances
            crab = asin(min(max(across, -steepest), steepest))
            turn = found[before]
            assert isinstance(turn, Turn)
            more = ((crab if way > 0 else pi - crab) - heading - turn.angle_rad + pi) % (2 * pi) - pi
            found[before] = turn = replace(turn, angle_rad=turn.angle_rad + more)
            place = place + _moved(turn_path(expected, float(flown[before].V[0]), turn), heading, wind)
            heading += turn.angle_rad
        place = place + part.air_m * np.array([cos(heading), sin(heading)]) + part.seconds * wind
        if part.turn is not None:
            turned = place + _moved(flown[part.turn], heading, wind)
            circles = _circles(flown[part.turn])
            way = (-1.0 if turned[0] > 0 else 1.0) if circles else -way
            before = part.turn
    return found


def _parts(plan: Sequence[Maneuver], flown: Sequence[Path]) -> Iterator[_Part]:
    turns = [i for i, maneuver in enumerate(plan) if isinstance(maneuver, Turn)]
    for before, turn in pairwise([-1, *turns, len(plan)]):
        numbers = range(before + 1, turn)
        held = [(one.speed_mps, i) for i in numbers if isinstance(one := plan[i], Hold | Porpoise)]
        yield _Part(
            air_m=sum(float(flown[i].V.sum()) for i in numbers) * PATH.step_s,
            seconds=sum(float((flown[i].V > 0).sum()) for i in numbers) * PATH.step_s,
            held=max(held)[1] if held else None,
            turn=turn if turn < len(plan) else None,
        )


def _longer_s(part: _Part, held: Hold | Porpoise, headwind_mps: float, until_m: tuple[float, float]) -> float:
    """By how much longer the held maneuver is flown. until_m: way to where to turn back, and longest leg"""
    ground_m = part.air_m - headwind_mps * part.seconds
    turn_m, leg_m = until_m
    longer_m = leg_m - ground_m if ground_m > leg_m else max(turn_m - ground_m, 0.0)
    longer_s = longer_m / max(held.speed_mps - headwind_mps, 0.1 * held.speed_mps)
    least_s, most_s = 8.0, 120.0  # that of a circuit; in wind nearly as fast as the aircraft
    return min(max(longer_s, min(least_s - held.duration_s, 0.0)), most_s)


def _turn_back_m(turn: Path, after: _Part, headwind_mps: float, space: Space) -> float:
    """Where a turn is begun for the part after it, and for circles themselves, to lie about the middle, along the way
    before it."""
    drift_m = headwind_mps * len(turn.V) * PATH.step_s
    if _circles(turn):
        return drift_m / 2
    return min(after.air_m + headwind_mps * after.seconds, space.leg_m) / 2 + drift_m


def _circles(turn: Path) -> bool:
    return float(np.abs(turn_rate(turn.bank, turn.V)).sum()) * PATH.step_s > 1.9 * pi


def _moved(path: Path, heading: float, wind: Array) -> Array:
    """Over the ground (2,) [m]."""
    along = heading + np.cumsum(turn_rate(path.bank, path.V)) * PATH.step_s
    air = np.array([path.V @ np.cos(along), path.V @ np.sin(along)])
    return np.asarray((air + wind * len(path.V)) * PATH.step_s)
