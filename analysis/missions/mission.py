"""A mission as steps over flat ground; parses the text of `--legs` and `--wind`.

Positions are in meters east and north of home, heights in meters above it. Airspeeds are equivalent airspeeds, as
autopilots show them.
"""

import re
from collections.abc import Sequence
from itertools import pairwise
from math import atan2, cos, degrees, hypot, pi, radians, sin
from typing import NamedTuple

from flightpower.analysis.missions.items import Start
from flightpower.flight.command_line import Quantity
from flightpower.flight.errors import InputError
from flightpower.flight.units import EARTH_RADIUS_M, GRAVITY_MPS2, to_si, weight_to_N


class Place(NamedTuple):
    """A point: meters east and north of home, and above it."""

    east_m: float = 0.0
    north_m: float = 0.0
    height_m: float = 0.0

    def distance_m(self, other: "Place") -> float:
        """Return the distance over the ground [m]."""
        return hypot(other.east_m - self.east_m, other.north_m - self.north_m)


HOME = Place()


class Speed(NamedTuple):
    """A speed that a mission requests [m/s]: equivalent airspeed, or speed over the ground."""

    mps: float
    over_ground: bool = False


class Step(NamedTuple):
    """Straight flight to a point, then circles there.

    speed: None if the mission does not set it     circle_s, turns: of the circles     radius_m: None: set by the bank
    launched: whether it begins at rest     dropped_kg: payload that leaves the aircraft at the end
    """

    name: str
    to: Place
    speed: Speed | None = None
    circle_s: float = 0.0
    turns: float = 0.0
    radius_m: float | None = None
    launched: bool = False
    dropped_kg: float = 0.0


class Mission(NamedTuple):
    """The steps from `start` on. notes: which items are assumed to use no energy, and other assumptions."""

    start: Place
    steps: tuple[Step, ...]
    notes: tuple[str, ...] = ()


class Assumed(NamedTuple):
    """Values that a file may lack: home [deg], height of a line without heights [m], payload of one release [kg].
    elevation_m : of home above the sea
    """

    home_deg: tuple[float, float] | None = None
    height_m: float = 100.0
    dropped_kg: float = 0.0
    elevation_m: float | None = None


class Allowance(NamedTuple):
    """How far below home a height may lie [m], if it is stated above home, or above the sea.

    The latter limit is small because heights above home are often marked as above the sea; to fly down into a valley,
    state heights above home.
    """

    above_home_m: float = 300.0
    above_sea_m: float = 30.0


ALLOWED = Allowance()


def check_height(height_m: float, where: str, advice: str, allowed_m: float = ALLOWED.above_home_m) -> None:
    """Raise InputError, which begins with `where`, for a height [m] so far below home that it must be wrong."""
    if height_m < -allowed_m:
        raise InputError(f"{where}: {-height_m:.0f} m below home; {advice}")


def local_m(latitude_deg: float, longitude_deg: float, start: Start, where: str) -> tuple[float, float]:
    """Return meters east and north of the start, on a flat earth.

    Raises InputError that begins with `where` for an invalid position, or one too far away for a flat earth.
    """
    farthest_m = 500_000.0
    if not (abs(latitude_deg) <= 90 and abs(longitude_deg) <= 360):
        raise InputError(f"{where}: {latitude_deg:g}, {longitude_deg:g} is not a latitude and longitude")
    middle = radians((latitude_deg + start.latitude_deg) / 2)
    east = radians((longitude_deg - start.longitude_deg + 180) % 360 - 180) * cos(middle)
    north = radians(latitude_deg - start.latitude_deg)
    distance_m = hypot(east, north) * EARTH_RADIUS_M
    if not distance_m <= farthest_m:
        raise InputError(f"{where}: {distance_m / 1000:.0f} km from home; check both")
    return EARTH_RADIUS_M * east, EARTH_RADIUS_M * north


def with_return(mission: Mission, ends_by_landing: bool, at_home_m: float = 100.0) -> Mission:
    """Return the mission, with a straight flight home at its last height unless it ends there or by landing.

    at_home_m: distance from home within which the mission counts as ended at home, to allow for circles before landing
    """
    last = mission.steps[-1]
    if ends_by_landing or last.to.distance_m(HOME) < at_home_m:
        return mission
    home = Step("home", HOME._replace(height_m=last.to.height_m))
    note = "The mission ends away from home: straight flight home at its last height is added."
    return mission._replace(steps=(*mission.steps, home), notes=(*mission.notes, note))


LEG = re.compile(
    r"(?P<distance>[\d.]+\s*[a-zA-Z]+)\s+(?P<course>[\d.]+)\s*(?:deg|°)?"
    r"(?P<climb>\s+[+-]\s*[\d.]+\s*[a-zA-Z]+)?(?:\s+(?:at|@)\s*(?P<speed>[\d.]+\s*[a-zA-Z]+(?:/[a-zA-Z]+)?))?"
)
DROP = re.compile(r"drop\s+(?P<weight>.+)")


def parse_legs(text: str, height_m: float) -> Mission:
    """Parse legs like "3 km 045, 2 km 135 +50 m at 17 m/s, drop 0.5 kg, 3 km 225", from `height_m` above home.

    Raises InputError that names the leg.
    """
    place, steps = HOME._replace(height_m=height_m), list[Step]()
    for number, part in enumerate(text.split(","), start=1):
        where = f"--legs: leg {number} {part.strip()!r}"
        drop, leg = DROP.fullmatch(part.strip()), LEG.fullmatch(part.strip())
        if drop:
            if not steps:
                raise InputError(f"{where}: drops before the first leg; begin with a leg")
            steps[-1] = steps[-1]._replace(dropped_kg=weight_to_N(drop["weight"], where) / GRAVITY_MPS2)
            continue
        if not leg:
            raise InputError(
                f'{where}: should be distance, course and, if need be, climb and speed: "3 km 045 +50 m at 17 m/s",'
                ' or "drop 0.5 kg"'
            )
        distance_m, course_deg = to_si(leg["distance"], "m", where), _degrees(leg["course"], where)
        if distance_m > pi * EARTH_RADIUS_M:
            raise InputError(f"{where}: no two places are {distance_m / 1000:.3g} km apart; check its length")
        climb_m = to_si(leg["climb"].replace(" ", ""), "m", where) if leg["climb"] else 0.0
        course = radians(course_deg)
        place = Place(
            place.east_m + distance_m * sin(course),
            place.north_m + distance_m * cos(course),
            place.height_m + climb_m,
        )
        check_height(place.height_m, where, "check its climb and --height")
        speed = Speed(to_si(leg["speed"], "m/s", where)) if leg["speed"] else None
        steps.append(Step(f"leg {number}", place, speed))
    return Mission(HOME._replace(height_m=height_m), tuple(steps))


def _degrees(text: str, where: str, what: str = "course") -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value <= 360:
        raise InputError(f"{where}: the {what} {text} should be degrees from 0 to 360")
    return value


WIND = re.compile(r"(?P<speed>.+?)\s+from\s+(?P<direction>[\d.]+)\s*(?:deg|degrees|°)?", re.IGNORECASE)


class Wind(NamedTuple):
    """Mean wind at the height of the flight: the velocity of the air [m/s], and each component's standard deviation."""

    east_mps: float
    north_mps: float
    sd_mps: float

    @property
    def mps(self) -> float:
        return hypot(self.east_mps, self.north_mps)


def parse_wind(text: str, sd_mps: float) -> Wind:
    """Parse a wind such as "5 m/s from 270 deg", or "0" for calm. Raises InputError."""
    calm = re.fullmatch(r"0(?:\.0*)?\s*(?:m/s|kt|km/h)?", text.strip())
    match = WIND.fullmatch(text.strip())
    if calm:
        return Wind(0.0, 0.0, sd_mps)
    if not match:
        raise InputError(f'--wind {text}: should be speed and direction it comes from, such as "5 m/s from 270 deg"')
    speed_mps = Quantity("--wind, its speed", "m/s", '"10 kt"', least=0, most=40).parse(match["speed"])
    direction = _degrees(match["direction"], f"--wind {text}", "direction")
    return Wind(-speed_mps * sin(radians(direction)), -speed_mps * cos(radians(direction)), sd_mps)


def courses_rad(mission: Mission) -> list[float | None]:
    """Return the course of each step over the ground [rad], clockwise from north; None if it covers no distance."""
    places: Sequence[Place] = (mission.start, *(step.to for step in mission.steps))
    return [
        atan2(b.east_m - a.east_m, b.north_m - a.north_m) if a.distance_m(b) > 0 else None for a, b in pairwise(places)
    ]


def course_text(course_rad: float | None) -> str:
    """Return a course such as "045"; empty for None."""
    return "" if course_rad is None else f"{round(degrees(course_rad)) % 360:03d}"
