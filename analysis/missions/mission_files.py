"""Missions from files: QGroundControl's plan, MAVLink's text (QGC WPL 110), a line of KML; told apart by content.

Formats: docs.qgroundcontrol.com, Plan File Format; mavlink.io, Mission Protocol and MAV_CMD; OGC KML 2.3. What an item
does to the energy is taken over; items that do nothing to it (cameras) are named in a note; any other is refused.
"""

import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from analysis.missions.mission import ALLOWED, HOME, Mission, Place, Speed, Step, check_height, with_return
from flight.errors import InputError
from flight.files import read_text
from flight.units import EARTH_RADIUS_M


class Command(IntEnum):
    """MAV_CMD of items that take energy, or change what those after them take."""

    WAYPOINT = 16
    LOITER_UNLIMITED = 17
    LOITER_TURNS = 18
    LOITER_TIME = 19
    RETURN = 20
    LAND = 21
    TAKE_OFF = 22
    LOITER_TO_HEIGHT = 31
    SPLINE = 82
    VERTICAL_TAKE_OFF = 84
    VERTICAL_LANDING = 85
    PLACE_PAYLOAD = 94
    JUMP = 177
    CHANGE_SPEED = 178
    GRIPPER = 211


class Equipment(IntEnum):
    """MAV_CMD of items that take no energy here: cameras, gimbals, marks in the mission, servos, relays."""

    DO_SET_RELAY = 181
    DO_REPEAT_RELAY = 182
    DO_SET_SERVO = 183
    DO_REPEAT_SERVO = 184
    DO_LAND_START = 189
    DO_SET_ROI_LOCATION = 195
    DO_SET_ROI_WPNEXT_OFFSET = 196
    DO_SET_ROI_NONE = 197
    DO_CONTROL_VIDEO = 200
    DO_SET_ROI = 201
    DO_DIGICAM_CONFIGURE = 202
    DO_DIGICAM_CONTROL = 203
    DO_MOUNT_CONFIGURE = 204
    DO_MOUNT_CONTROL = 205
    DO_SET_CAM_TRIGG_DIST = 206
    DO_FENCE_ENABLE = 207
    DO_SET_CAM_TRIGG_INTERVAL = 214
    SET_CAMERA_MODE = 530
    SET_CAMERA_ZOOM = 531
    SET_CAMERA_FOCUS = 532
    DO_GIMBAL_MANAGER_PITCHYAW = 1000
    DO_GIMBAL_MANAGER_CONFIGURE = 1001
    IMAGE_START_CAPTURE = 2000
    IMAGE_STOP_CAPTURE = 2001
    DO_TRIGGER_CONTROL = 2003
    VIDEO_START_CAPTURE = 2500
    VIDEO_STOP_CAPTURE = 2501


class Frame(IntEnum):
    """MAV_FRAME of heights; the second of each pair is for integers."""

    ABOVE_SEA = 0
    ABOVE_SEA_INT = 5
    RELATIVE = 3
    RELATIVE_INT = 6
    TERRAIN = 10
    TERRAIN_INT = 11


class SpeedType(IntEnum):
    """First parameter of a change of speed."""

    AIRSPEED = 0
    GROUND_SPEED = 1


class Gripper(IntEnum):
    """Second parameter of a gripper's item."""

    RELEASE = 0
    GRAB = 1


class Item(NamedTuple):
    """A mission item. params: the first four; NaN where not given     latitude_deg, longitude_deg: None: none"""

    number: int
    command: int
    frame: int
    params: tuple[float, float, float, float]
    latitude_deg: float | None
    longitude_deg: float | None
    height_m: float


class Assumed(NamedTuple):
    """What a file may not say: home [deg], height of a line without heights, payload of one release [kg]."""

    home_deg: tuple[float, float] | None = None
    height_m: float = 100.0
    dropped_kg: float = 0.0


class Start(NamedTuple):
    """Where the mission begins: latitude, longitude [deg], height above sea level; None where the file lacks it."""

    latitude_deg: float
    longitude_deg: float
    above_sea_m: float | None


def load_mission(path: Path, assumed: Assumed = Assumed()) -> Mission:
    """Raises InputError naming the file and the item that is not understood."""
    text, where = read_text(path), str(path)
    begin = text.lstrip()[:20]
    if begin.startswith("{"):
        items, start, notes = _qgroundcontrol(text, where)
    elif begin.startswith("QGC WPL"):
        (items, start), notes = _waypoints(text, where), ()
    elif begin.startswith("<"):
        return _kml(text, where, assumed)
    else:
        raise InputError(
            f"{where}: neither a plan of QGroundControl, nor MAVLink waypoints (QGC WPL 110), nor KML;"
            " save the mission as one of these, or give --legs"
        )
    if assumed.home_deg is not None:
        start = Start(*assumed.home_deg, start.above_sea_m if start else None)
    if start is None:
        raise InputError(f'{where}: has no home position; give --home "48.1,11.5"')
    return _Reader(where, start, assumed, notes).mission(_unrolled(items, where))


class _Reader:
    """Steps from items, one after another."""

    def __init__(self, where: str, start: Start, assumed: Assumed, notes: Sequence[str]):
        self.where, self.start, self.assumed = where, start, assumed
        self.place = HOME
        self.speed: Speed | None = None
        self.steps: list[Step] = []
        self.notes = list(notes)
        self.ignored: Counter[str] = Counter()

    def mission(self, items: Sequence[Item]) -> Mission:
        ended = False
        for item in items:
            if ended and item.command not in set(Equipment):
                raise InputError(f"{self._name(item)} follows a landing or return, after which no energy is known")
            ended = ended or item.command in (Command.RETURN, Command.LAND)
            self._take(item)
        if not self.steps:
            raise InputError(f"{self.where}: has no waypoint")
        if self.ignored:
            kinds = ", ".join(f"{count} {name}" for name, count in sorted(self.ignored.items()))
            self.notes.append(f"Items of cameras and other equipment take no energy here: {kinds}.")
        return with_return(Mission(HOME, tuple(self.steps), tuple(self.notes)), ended)

    def _name(self, item: Item) -> str:
        return f"{self.where}: item {item.number} (command {item.command})"

    def _take(self, item: Item) -> None:
        p1, p2, p3, _ = item.params
        match item.command:
            case Command.WAYPOINT | Command.SPLINE:
                self._go(item, "waypoint", circle_s=_or_zero(p1))
            case Command.TAKE_OFF:
                self._go(item, "take-off", launched=True)
            case Command.LAND:
                self._go(item, "landing")
            case Command.LOITER_TURNS:
                if not p1 > 0:
                    raise InputError(f"{self._name(item)}: circles {p1:g} times; give a number above zero")
                self._go(item, "circles", turns=p1, radius_m=abs(_or_zero(p3)) or None)
            case Command.LOITER_TIME:
                if not p1 > 0:
                    raise InputError(f"{self._name(item)}: circles for {p1:g} s; give a time above zero")
                self._go(item, "circles", circle_s=p1, radius_m=abs(_or_zero(p3)) or None)
            case Command.LOITER_TO_HEIGHT:
                self._go(item, "climb")
            case Command.RETURN:
                self._append(Step(f"{item.number} return", HOME._replace(height_m=self.place.height_m), self.speed))
            case Command.CHANGE_SPEED:
                self._change_speed(item, over_ground=p1 == SpeedType.GROUND_SPEED, mps=p2)
            case Command.PLACE_PAYLOAD:
                self._go(item, "payload")
                self._drop(item)
            case Command.GRIPPER:
                if p2 == Gripper.RELEASE:
                    self._drop(item)
            case command if command in set(Equipment):
                self.ignored[Equipment(command).name] += 1
            case Command.LOITER_UNLIMITED:
                raise InputError(f"{self._name(item)} circles without end; give a time or a number of turns")
            case Command.VERTICAL_TAKE_OFF | Command.VERTICAL_LANDING:
                raise InputError(f"{self._name(item)} flies vertically, of which power is not known; use 22 and 21")
            case _:
                raise InputError(f"{self._name(item)} is not understood; remove it, or replace it by a waypoint")

    def _append(self, step: Step) -> None:
        self.steps.append(step)
        self.place = step.to

    def _go(self, item: Item, kind: str, **more: Any) -> None:
        self._append(Step(f"{item.number} {kind}", self._to(item), self.speed, **more))

    def _to(self, item: Item) -> Place:
        """The item's place; over the place before where it has none."""
        height_m, advice, allowance_m = item.height_m, "check its height", ALLOWED.above_home_m
        if not math.isfinite(height_m):
            raise InputError(f"{self._name(item)} has no height")
        if item.frame in (Frame.ABOVE_SEA, Frame.ABOVE_SEA_INT):
            if self.start.above_sea_m is None:
                raise InputError(
                    f"{self._name(item)}: height above sea level, and home's is not known; use relative ones"
                )
            told_m, height_m = height_m, height_m - self.start.above_sea_m
            advice = (
                f"{told_m:g} m above sea level, and home at {self.start.above_sea_m:g} m: where it is meant above home,"
                " save the mission with relative heights (frame 3)"
            )
            allowance_m = ALLOWED.above_home_m if item.command == Command.LAND else ALLOWED.above_sea_m
        elif item.frame in (Frame.TERRAIN, Frame.TERRAIN_INT):
            note = "Heights above terrain are taken as above home: the ground as flat."
            self.notes += [note] if note not in self.notes else []
        elif item.frame not in (Frame.RELATIVE, Frame.RELATIVE_INT):
            raise InputError(
                f"{self._name(item)}: coordinate frame {item.frame} is not understood; use 3, relative to home"
            )
        allowance_m = 0.0 if item.command == Command.TAKE_OFF else allowance_m
        check_height(height_m, self._name(item), advice, allowance_m)
        if item.latitude_deg is None or item.longitude_deg is None:
            return self.place._replace(height_m=height_m)
        east_m, north_m = local_m(item.latitude_deg, item.longitude_deg, self.start, self._name(item))
        return Place(east_m, north_m, height_m)

    def _change_speed(self, item: Item, *, over_ground: bool, mps: float) -> None:
        if mps == -2:  # MAVLink: back to the default
            self.speed = None
        elif mps > 0:
            self.speed = Speed(mps, over_ground)
        elif mps != -1:  # no change of speed
            raise InputError(f"{self._name(item)}: a speed of {mps:g} m/s; give one above zero")

    def _drop(self, item: Item) -> None:
        if not self.steps:
            raise InputError(f"{self._name(item)} drops a payload before the first waypoint")
        if not self.assumed.dropped_kg:
            raise InputError(f'{self._name(item)} drops a payload; give its mass, --drop "0.5 kg"')
        last = self.steps[-1]
        self.steps[-1] = last._replace(dropped_kg=last.dropped_kg + self.assumed.dropped_kg)


def _or_zero(value: float) -> float:
    return value if math.isfinite(value) else 0.0


def local_m(latitude_deg: float, longitude_deg: float, start: Start, where: str) -> tuple[float, float]:
    """Meters east and north of the start, on a plane that touches the earth there.

    Raises InputError beginning with `where` for what is no place, or so far away that the earth is not flat.
    """
    farthest_m = 500_000.0
    if not (abs(latitude_deg) <= 90 and abs(longitude_deg) <= 360):
        raise InputError(f"{where}: {latitude_deg:g}, {longitude_deg:g} is no latitude and longitude")
    middle = math.radians((latitude_deg + start.latitude_deg) / 2)
    east = math.radians((longitude_deg - start.longitude_deg + 180) % 360 - 180) * math.cos(middle)
    north = math.radians(latitude_deg - start.latitude_deg)
    if math.hypot(east, north) * EARTH_RADIUS_M > farthest_m:
        raise InputError(f"{where}: {math.hypot(east, north) * EARTH_RADIUS_M / 1000:.0f} km from home; check both")
    return EARTH_RADIUS_M * east, EARTH_RADIUS_M * north


def _unrolled(items: Sequence[Item], where: str) -> list[Item]:
    """The items in the order in which they are flown, with jumps carried out. Raises InputError for an endless one."""
    index = {item.number: i for i, item in enumerate(items)}
    left: dict[int, int] = {}
    flown, at = list[Item](), 0
    while at < len(items):
        item = items[at]
        at += 1
        if item.command != Command.JUMP:
            flown.append(item)
            continue
        target, times = item.params[0], item.params[1]
        if not 0 <= times <= 1000 or target not in index:
            raise InputError(
                f"{where}: item {item.number} jumps to item {target:g} {times:g} times; no such end is known"
            )
        if left.setdefault(item.number, int(times)) > 0:
            left[item.number] -= 1
            at = index[int(target)]
        else:
            del left[item.number]
        if len(flown) > 100_000:
            raise InputError(f"{where}: item {item.number} makes the mission endless")
    return flown


def _qgroundcontrol(text: str, where: str) -> tuple[list[Item], Start | None, Sequence[str]]:
    try:
        mission = json.loads(text)["mission"]
        plain = [item for entry in mission["items"] for item in _simple(entry, where)]
        items = [_from_json(number, item, where) for number, item in enumerate(plain, start=1)]
        home = mission.get("plannedHomePosition")
        start = Start(float(home[0]), float(home[1]), float(home[2])) if home else None
        return items, start, _of_speed(mission.get("cruiseSpeed"), items)
    except InputError:
        raise
    except KeyError as error:
        raise InputError(f"{where}: not a plan of QGroundControl (lacks {error})") from None
    except (ValueError, TypeError, IndexError, AttributeError, RecursionError) as error:
        raise InputError(f"{where}: not a plan of QGroundControl ({error})") from None


def _of_speed(cruise_mps: Any, items: Sequence[Item]) -> tuple[str, ...]:
    """What to say of the speed of a plan that asks for none: that it is for QGroundControl's times, which it shows."""
    if not cruise_mps or any(item.command == Command.CHANGE_SPEED for item in items):
        return ()
    return (
        f"QGroundControl computes times with {float(cruise_mps):g} m/s, which no vehicle gets: not taken as asked.",
    )


def _simple(entry: dict[str, Any], where: str) -> Iterator[dict[str, Any]]:
    """The simple items of an entry: of a survey those of its transects, of a landing pattern approach and touchdown."""
    if entry["type"] == "SimpleItem":
        yield entry
        return
    kind = entry.get("complexItemType")
    if "TransectStyleComplexItem" in entry:
        yield from entry["TransectStyleComplexItem"]["Items"]
    elif kind == "fwLandingPattern":
        approach = entry.get("landingApproachCoordinate") or entry["loiterCoordinate"]
        frame = Frame.RELATIVE if entry.get("altitudesAreRelative", True) else Frame.ABOVE_SEA
        for command, place in ((Command.WAYPOINT, approach), (Command.LAND, entry["landCoordinate"])):
            yield {"command": command, "frame": frame, "params": [0, 0, 0, None, *place]}
    else:
        raise InputError(
            f"{where}: an item of kind {kind or entry['type']} is not understood; use waypoints or a survey"
        )


def _from_json(number: int, item: dict[str, Any], where: str) -> Item:
    params = [math.nan if value is None else float(value) for value in item["params"]]
    if len(params) != 7:
        raise InputError(f"{where}: item {number} has {len(params)} parameters instead of 7")
    return _item(number, int(item["command"]), int(item["frame"]), params)


def _item(number: int, command: int, frame: int, params: Sequence[float]) -> Item:
    """params: seven. Latitude and longitude of zero, or none, mean the place where the aircraft is."""
    first = (params[0], params[1], params[2], params[3])
    placed = math.isfinite(params[4]) and math.isfinite(params[5]) and (params[4] != 0 or params[5] != 0)
    return Item(number, command, frame, first, params[4] if placed else None, params[5] if placed else None, params[6])


def _waypoints(text: str, where: str) -> tuple[list[Item], Start | None]:
    head, *lines = text.strip().splitlines()
    if head.split() != ["QGC", "WPL", "110"]:
        raise InputError(f"{where}: format {head.strip()!r} is not known; save the mission as QGC WPL 110")
    items = []
    for number, line in enumerate(lines, start=2):
        if not line.strip():
            continue
        fields = line.split()
        try:
            if len(fields) != 12:
                raise ValueError(f"{len(fields)} columns instead of 12")
            items.append(_item(int(fields[0]), int(fields[3]), int(fields[2]), [float(x) for x in fields[4:11]]))
        except ValueError as error:
            raise InputError(f"{where}: line {number}: not a mission item ({error})") from None
    if not items:
        raise InputError(f"{where}: has no mission item")
    home = items[0]  # by the format, the first item is home
    if home.latitude_deg is None or home.longitude_deg is None:
        return items[1:], None
    return items[1:], Start(home.latitude_deg, home.longitude_deg, home.height_m)


def _kml(text: str, where: str, assumed: Assumed) -> Mission:
    """A line as a route from its first point on, which is home unless another is given."""
    try:
        lines = [one for one in ElementTree.fromstring(text).iter() if one.tag.rpartition("}")[2] == "LineString"]
    except ElementTree.ParseError as error:
        raise InputError(f"{where}: not KML ({error})") from None
    if len(lines) != 1:
        raise InputError(f"{where}: has {len(lines)} lines (LineString); save the one that is to be flown alone")
    found = {child.tag.rpartition("}")[2]: (child.text or "").strip() for child in lines[0]}
    mode = found.get("altitudeMode", "clampToGround")
    try:
        points = [tuple(float(x) for x in point.split(",")) for point in found.get("coordinates", "").split()]
        if len(points) < 2 or any(len(point) not in (2, 3) for point in points):
            raise ValueError("fewer than two points")
    except ValueError as error:
        raise InputError(f"{where}: coordinates of the line are not longitude,latitude,height ({error})") from None
    with_heights = mode != "clampToGround" and all(len(point) == 3 for point in points)
    start = Start(*(assumed.home_deg or (points[0][1], points[0][0])), None)
    base_m = points[0][2] - assumed.height_m if with_heights and mode == "absolute" else 0.0
    places = []
    for point in points:
        east_m, north_m = local_m(point[1], point[0], start, where)
        check_height(point[2] - base_m if with_heights else 0.0, where, "check the heights of the line")
        places.append(Place(east_m, north_m, point[2] - base_m if with_heights else assumed.height_m))
    steps = tuple(Step(f"point {number}", place) for number, place in enumerate(places[1:], start=2))
    note = "" if with_heights else f"The line has no heights: flown {assumed.height_m:g} m above home (--height)."
    return with_return(Mission(places[0], steps, (note,) if note else ()), ends_by_landing=False)
