"""A plan over the ground: headings and durations with which a flight in wind stays near its observer.

Positions come from dead reckoning in the mean wind. A plan is a series of straight parts with turns between them. A
straight part is crabbed so that it ends on the line of the legs. Its held or porpoised maneuver is shortened if the
part would be longer over the ground than a leg, and lengthened so that the next part and the turn after it are centered
on the take-off: the flight takes longer against the wind than with it. The landing is into the wind.

x is along the first leg, y to its right, from the place of take-off [m].
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import asin, copysign, cos, inf, pi, sin

import numpy as np

from flightpower.analysis.missions.expected_aircraft import ExpectedAircraft
from flightpower.analysis.missions.pieces import Hold, Maneuver, Porpoise, Space, Turn
from flightpower.analysis.missions.plan_settings import PATH
from flightpower.analysis.missions.time_history import Path, fly, paths, turn_path, turn_rate, wind_vector
from flightpower.flight.arrays import Array


@dataclass(frozen=True)
class _Part:
    """A straight part through the air, and the turn after it.

    adjusted : index of the maneuver that is lengthened or shortened, the fastest one     turn : its index or None
    spare_s : by how much `adjusted` can be shortened     held_mps : its speed     turn_s : duration of the turn
    """

    through_air_m: float
    seconds: float
    adjusted: int | None
    turn: int | None
    spare_s: float
    held_mps: float
    turn_s: float

    def reached_m(self, direction: float, wind_x_mps: float, leg_m: float) -> tuple[float, float]:
        """Return distances along x from the start of a part to its end, shortened to a leg if possible, and to its
        turn's end.

        direction : 1 along x, -1 back
        """
        longest_m = direction * self.through_air_m + wind_x_mps * self.seconds
        least_m = longest_m - (direction * self.held_mps + wind_x_mps) * self.spare_s
        end_m = copysign(max(min(abs(longest_m), leg_m), abs(least_m)), longest_m)
        return end_m, end_m + wind_x_mps * self.turn_s


def kept_in_place(
    plan: Sequence[Maneuver],
    expected: ExpectedAircraft,
    space: Space,
    wind_mps: float,
    wind_from_deg: float = PATH.wind_from_deg,
) -> list[Maneuver]:
    """Adjust angles of turns and durations of held or porpoised maneuvers to keep the flight in place.

    wind_from_deg : clockwise from the first leg
    """
    flown, maneuvers = paths(plan, expected, space.height_m), list(plan)
    wind = wind_vector(wind_mps, wind_from_deg)
    parts = list(_parts(plan, flown))
    place, heading, direction, before = np.zeros(2), 0.0, 1.0, None  # direction along x; index of the turn before
    turned = place  # where the part begins if the turn before it is flown as first planned
    for part, after in pairwise([*parts, None]):
        assert part is not None
        headwind_mps = -direction * float(wind[0])
        if part.adjusted is not None and part.turn is not None and after is not None:
            adjusted = maneuvers[part.adjusted]
            assert isinstance(adjusted, Hold | Porpoise)
            turn_x_m = _turn_x_m(flown[part.turn], after, direction, space, float(wind[0]))
            turn_m = direction * (turn_x_m - float(turned[0]))
            longer_s = _longer_s(part, adjusted, headwind_mps, (turn_m, space.leg_m))
            if before is None:
                longer_s = min(longer_s, _until_a_leg_away_s(part, wind, space.leg_m))
            maneuvers[part.adjusted] = replace(adjusted, duration_s=adjusted.duration_s + longer_s)
            through_air_m = part.through_air_m + longer_s * adjusted.speed_mps
            part = replace(part, through_air_m=through_air_m, seconds=part.seconds + longer_s)
        if before is None:
            until_turn = fly(maneuvers[: part.turn], expected, space.height_m, wind_mps, wind_from_deg=wind_from_deg)
            place = until_turn.position_m[-1]
        else:
            turn, begun_mps = maneuvers[before], float(flown[before].V[0])
            assert isinstance(turn, Turn)
            for _ in range(3):  # a turn through a different angle takes a different time
                crab = _crab_rad(part, turned, wind)
                turn = _turned_to(turn, (crab if direction > 0 else pi - crab) - heading)
                turned = place + _moved(turn_path(expected, begun_mps, turn), heading, wind)
            maneuvers[before], place = turn, turned
            heading += turn.angle_rad
            place = place + part.through_air_m * np.array([cos(heading), sin(heading)]) + part.seconds * wind
        if part.turn is not None and after is not None:
            turned = place + _moved(flown[part.turn], heading, wind)
            before = part.turn
            direction = _way_after(flown[part.turn], after, direction, float(turned[0]), float(wind[0]))
    return maneuvers


def _parts(plan: Sequence[Maneuver], flown: Sequence[Path]) -> Iterator[_Part]:
    turns = [i for i, maneuver in enumerate(plan) if isinstance(maneuver, Turn)]
    for before, turn in pairwise([-1, *turns, len(plan)]):
        numbers = range(before + 1, turn)
        candidates = [
            (maneuver.speed_mps, i, maneuver.duration_s)
            for i in numbers
            if isinstance(maneuver := plan[i], Hold | Porpoise)
        ]
        held_mps, number, duration_s = max(candidates, default=(0.0, None, 0.0))
        shortest_s = 8.0  # of a held maneuver in a circuit
        yield _Part(
            through_air_m=sum(float(flown[i].V.sum()) for i in numbers) * PATH.step_s,
            seconds=sum(float((flown[i].V > 0).sum()) for i in numbers) * PATH.step_s,
            adjusted=number,
            turn=turn if turn < len(plan) else None,
            spare_s=max(duration_s - shortest_s, 0.0),
            held_mps=held_mps,
            turn_s=len(flown[turn].V) * PATH.step_s if turn < len(plan) else 0.0,
        )


def _turned_to(turn: Turn, angle_rad: float) -> Turn:
    """Return the turn to the same side, by about as much, that ends at this angle plus any number of whole circles."""
    turn_rad = 2 * pi
    more = (angle_rad - turn.angle_rad + pi) % turn_rad - pi
    angle = turn.angle_rad + more
    if abs(angle) < pi / 2:  # a circle is better than no turn
        angle += copysign(turn_rad, turn.angle_rad)
    return replace(turn, angle_rad=angle)


def _crab_rad(part: _Part, begun: Array, wind: Array) -> float:
    """Return the heading, relative to the legs' line, with which a part that begins at (2,) ends on that line."""
    across = -float(begun[1] + wind[1] * part.seconds) / max(part.through_air_m, 1.0)
    steepest = 0.64  # sine of 40 deg; beyond this angle a leg hardly advances
    return asin(min(max(across, -steepest), steepest))


def _longer_s(part: _Part, adjusted: Hold | Porpoise, headwind_mps: float, until_m: tuple[float, float]) -> float:
    """Return how much longer to fly the held maneuver [s]. until_m: distance to the turning point, and longest leg"""
    ground_m = part.through_air_m - headwind_mps * part.seconds
    turn_m, leg_m = until_m
    longer_m = max(turn_m - ground_m, min(leg_m - ground_m, 0.0))
    least_mps = 0.1 * adjusted.speed_mps  # below this ground speed a longer leg leads nowhere
    if adjusted.speed_mps - headwind_mps < least_mps and longer_m > 0:
        return 0.0
    most_s = 120.0  # limit for wind nearly as fast as the aircraft
    return min(max(longer_m / max(adjusted.speed_mps - headwind_mps, least_mps), -part.spare_s), most_s)


def _until_a_leg_away_s(part: _Part, wind: Array, leg_m: float) -> float:
    """Return how much longer [s] the uncrabbed hold after take-off can last until the flight is a leg away."""
    place = np.array([part.through_air_m, 0.0]) + part.seconds * wind
    return max(leg_m - float(np.hypot(*place)), 0.0) / float(np.hypot(part.held_mps + wind[0], wind[1]))


def _turn_x_m(turn: Path, after: _Part, direction: float, space: Space, wind_x_mps: float) -> float:
    """Return the place x where a turn must begin to center what follows on the take-off: circles, or the part after the
    turn together with the next turn. direction: before the turn"""
    drift_m = wind_x_mps * len(turn.V) * PATH.step_s
    if _circles(turn):
        return -drift_m / 2
    next_way = _way_back(after, direction, wind_x_mps)
    passed_m = (0.0, *after.reached_m(next_way, wind_x_mps, space.leg_m))
    return -(max(passed_m) + min(passed_m)) / 2 - drift_m * (2 if direction == next_way else 1)  # twice: full circle


def _way_back(after: _Part, direction: float, wind_x_mps: float) -> float:
    """Return the direction after a turn: into the wind to land, else reversed; 1 along x, -1 back."""
    return -copysign(1.0, wind_x_mps) if after.turn is None and wind_x_mps else -direction


def _way_after(turn: Path, after: _Part, direction: float, x_m: float, wind_x_mps: float) -> float:
    """Return the direction after a turn or circles that end at x; after circles, the one that stays closer."""
    if not _circles(turn) or (after.turn is None and wind_x_mps):
        return _way_back(after, direction, wind_x_mps)
    return min((1.0, -1.0), key=lambda sense: max(abs(x_m + m) for m in after.reached_m(sense, wind_x_mps, inf)))


def _circles(turn: Path) -> bool:
    return float(np.abs(turn_rate(turn.bank, turn.V)).sum()) * PATH.step_s > 1.9 * pi


def _moved(path: Path, heading: float, wind: Array) -> Array:
    """Return the displacement over the ground (2,) [m]."""
    along = heading + np.cumsum(turn_rate(path.bank, path.V)) * PATH.step_s
    air = np.array([path.V @ np.cos(along), path.V @ np.sin(along)])
    return np.asarray((air + wind * len(path.V)) * PATH.step_s)
