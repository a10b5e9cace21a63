"""Converts the items of a mission to the steps that the aircraft flies, one after another, with jumps carried out.

Items that affect the energy become steps or change them. Items that do not (cameras) are named in a note. Any other
item is rejected with a message that says what to do instead.
"""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

from flightpower.analysis.missions.items import (
    ABOVE_HOME,
    ABOVE_SEA,
    ABOVE_TERRAIN,
    EQUIPMENT,
    Command,
    Equipment,
    Gripper,
    Item,
    ReadMission,
    SpeedType,
    Start,
)
from flightpower.analysis.missions.mission import (
    ALLOWED,
    HOME,
    Assumed,
    Mission,
    Place,
    Speed,
    Step,
    check_height,
    local_m,
    with_return,
)
from flightpower.flight.errors import InputError

# What to do about an item that is not understood, mostly two choices; which one is right depends on the mission.
VERTICAL = "flies vertically, and its power is not known; use 22 and 21 for take-off and landing, or remove it"
INSTEAD: dict[int, str] = {
    Command.LOITER_UNLIMITED: "circles without end; give a time (19) or a number of turns (18)",
    Command.VERTICAL_TAKE_OFF: VERTICAL,
    Command.VERTICAL_LANDING: VERTICAL,
    Command.VERTICAL_TRANSITION: VERTICAL,
    Command.CHANGE_HEIGHT: "ends at a height, not at a place; give a waypoint (16) or circles (31) at that height",
    Command.DELAY: "waits; circle for a time (19), or remove it",
    Command.GUIDED: "leaves the mission; end it there, or give the waypoints that are flown (16)",
    Command.SET_MODE: "leaves the mission; end it there, or give the waypoints that are flown (16)",
    Command.SET_HOME: "moves home, which heights and the return are measured from; save two missions, or remove it",
    Command.PARACHUTE: "ends the flight; end the mission before it, or by a landing (21)",
}
ENDS = (Command.RETURN, Command.LAND)
PLACE = "is a path whose energy is not known; replace it with waypoints (16), or remove it"
ACTION = "is not understood; remove it if it moves nothing, otherwise use circles (18) or a speed (178)"


def flown(read: ReadMission, where: str, assumed: Assumed) -> Mission:
    """Return the mission. Raises InputError that begins with `where` and names the item that is not understood."""
    start = read.start
    if assumed.home_deg is not None:
        start = Start(*assumed.home_deg, start.above_sea_m if start else None)
    if start is None:
        notes = "".join(f" {note}" for note in read.notes)
        raise InputError(f'{where}: has no home position; give --home "48.1,11.5"{"." if notes else ""}{notes}')
    latitude, longitude, above_sea_m = start
    if not (abs(latitude) <= 90 and abs(longitude) <= 360 and (above_sea_m is None or math.isfinite(above_sea_m))):
        raise InputError(
            f"{where}: home at {latitude:g}, {longitude:g}, {above_sea_m} m is not a place on Earth; give --home"
            ' "48.1,11.5"'
        )
    if not start.above_sea_m and assumed.elevation_m is not None:
        start = start._replace(above_sea_m=assumed.elevation_m)
    steps = _Steps(where, start, assumed, read.notes)
    items = unrolled(read.items, where)
    if items and items[-1].command in ENDS:
        steps.note_left_out(read.items[read.items.index(items[-1]) + 1 :])
    return steps.mission(items)


class _Steps:
    """Makes steps from items, one after another."""

    def __init__(self, where: str, start: Start, assumed: Assumed, notes: Sequence[str]):
        self.where, self.start, self.assumed = where, start, assumed
        self.place = HOME
        self.speed: Speed | None = None
        self.steps: list[Step] = []
        self.notes = dict.fromkeys(notes)  # in order, without duplicates
        self.ignored: Counter[str] = Counter()

    def mission(self, items: Sequence[Item]) -> Mission:
        for item in items:
            self._take(item)
        if not self.steps:
            raise InputError(f"{self.where}: has no waypoint")
        if self.ignored:
            kinds = ", ".join(f"{count} {name}" for name, count in sorted(self.ignored.items()))
            self._note(f"Items of cameras and other equipment take no energy here: {kinds}.")
        return with_return(
            Mission(HOME, tuple(self.steps), tuple(self.notes)), ends_by_landing=items[-1].command in ENDS
        )

    def note_left_out(self, items: Sequence[Item]) -> None:
        """Note the items after a landing or return: waypoints of an aborted approach, or of another flight."""
        items = [item for item in items if item.command not in EQUIPMENT]
        if not items:
            return
        named = f"Item {items[0].number} follows" if len(items) == 1 else f"{len(items)} items follow"
        begin = "" if len(items) == 1 else f", from {items[0].number} on"
        again = any(item.command == Command.TAKE_OFF for item in items)
        what = "; for the flight after the second take-off save them as a mission of its own" if again else ""
        self._note(f"{named} the first landing or return{begin}: not flown here{what}.")

    def _note(self, text: str) -> None:
        self.notes[text] = None

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
                if not 0 < p1 < math.inf:
                    raise InputError(f"{self._name(item)}: circles {p1:g} times; give a number above zero")
                self._go(item, "circles", turns=p1, radius_m=abs(_or_zero(p3)) or None)
            case Command.LOITER_TIME:
                if not 0 < p1 < math.inf:
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
            case command if command in EQUIPMENT:
                self.ignored[Equipment(command).name] += 1
            case command:
                general = PLACE if command <= Command.LAST_PATH or item.has_place else ACTION
                raise InputError(f"{self._name(item)}{_title(command)} {INSTEAD.get(command, general)}")

    def _append(self, step: Step) -> None:
        self.steps.append(step)
        self.place = step.to

    def _go(self, item: Item, kind: str, **more: Any) -> None:
        self._append(Step(f"{item.number} {kind}", self._to(item), self.speed, **more))

    def _to(self, item: Item) -> Place:
        """Return the item's place. Without a position: the previous place, and its height if the item has none."""
        in_place = not item.has_place and item.command != Command.LAND
        if in_place and (item.height_m == 0 or math.isnan(item.height_m)):
            return self.place
        height_m = self._height_m(item)
        if item.latitude_deg is None or item.longitude_deg is None:
            return self.place._replace(height_m=height_m)
        return Place(*local_m(item.latitude_deg, item.longitude_deg, self.start, self._name(item)), height_m)

    def _height_m(self, item: Item) -> float:
        """Return an item's height above home [m]. Raises InputError if it is unknown, or too far below home."""
        height_m, advice, allowed_m = item.height_m, "check its height", ALLOWED.above_home_m
        if not math.isfinite(height_m):
            raise InputError(f"{self._name(item)} has no height")
        if item.frame in ABOVE_SEA:
            home_m = self.start.above_sea_m
            if home_m is None:
                raise InputError(
                    f"{self._name(item)}: height above sea level, and home's is not known; give --elevation of home,"
                    " or save the mission with relative heights (frame 3)"
                )
            if home_m == 0 and self.assumed.elevation_m is None:
                self._note("The file has home at 0 m above the sea: if it lies higher, give --elevation.")
            advice = (
                f"{height_m:g} m above sea level, and home at {home_m:g} m: where it is meant above home,"
                " save the mission with relative heights (frame 3)"
            )
            height_m -= home_m
            allowed_m = ALLOWED.above_home_m if item.command == Command.LAND else ALLOWED.above_sea_m
        elif item.frame in ABOVE_TERRAIN:
            self._note("Heights above terrain are treated as heights above home, as over flat ground.")
        elif item.frame not in ABOVE_HOME:
            raise InputError(
                f"{self._name(item)}: coordinate frame {item.frame} is not understood; use 3, relative to home"
            )
        check_height(height_m, self._name(item), advice, 0.0 if item.command == Command.TAKE_OFF else allowed_m)
        return height_m

    def _change_speed(self, item: Item, *, over_ground: bool, mps: float) -> None:
        if mps == -2:  # MAVLink: back to the default
            self.speed = None
        elif 0 < mps < math.inf:
            self.speed = Speed(mps, over_ground)
        elif mps != -1:  # no change of speed
            raise InputError(f"{self._name(item)}: a speed of {mps:g} m/s; give a speed above zero")

    def _drop(self, item: Item) -> None:
        if not self.steps:
            raise InputError(f"{self._name(item)} drops a payload before the first waypoint")
        if not self.assumed.dropped_kg:
            raise InputError(f'{self._name(item)} drops a payload; give its mass, --drop "0.5 kg"')
        last = self.steps[-1]
        self.steps[-1] = last._replace(dropped_kg=last.dropped_kg + self.assumed.dropped_kg)


def _title(command: int) -> str:
    """Return the command's name in MAVLink, for a message; pymavlink is imported only then."""
    from pymavlink.dialects.v20 import ardupilotmega

    command_entry = ardupilotmega.enums["MAV_CMD"].get(command)
    return f", {command_entry.name.replace('MAV_CMD_', '')}," if command_entry else ""


def _or_zero(value: float) -> float:
    return value if math.isfinite(value) else 0.0


def unrolled(items: Sequence[Item], where: str) -> list[Item]:
    """Return the items up to the first landing or return in the order flown, with jumps to items or tags carried out.

    A jump's repetitions count over the whole mission, as in ArduPilot and PX4: an outer jump does not restart an inner
    one. Raises InputError for a jump that is endless, or whose target is not in the file.
    """
    index: dict[float, int] = {}
    tags: dict[float, int] = {}
    for i, item in enumerate(items):
        index.setdefault(item.number, i)
        if item.command == Command.JUMP_TAG:
            tags.setdefault(item.params[0], i)
    left: dict[int, int] = {}
    ordered, offset = list[Item](), 0
    while offset < len(items):
        item = items[offset]
        offset += 1
        if item.command not in (Command.JUMP, Command.JUMP_TO_TAG):
            ordered += [item] if item.command != Command.JUMP_TAG else []
            if item.command in ENDS:
                break
            continue
        ends, kind = (index, "item") if item.command == Command.JUMP else (tags, "tag")
        target, times = item.params[0], item.params[1]
        jump = f"{where}: item {item.number} jumps to {kind} {target:g}"
        if target not in ends:
            raise InputError(f"{jump}, which is not in the file; give one that is, or remove the jump")
        if not 0 <= times <= 1000:
            raise InputError(f"{jump} {times:g} times, which has no end; give a number up to 1000, or remove the jump")
        if left.setdefault(offset, int(times)) > 0:
            left[offset] -= 1
            offset = ends[target]
        if len(ordered) > 100_000:
            raise InputError(f"{where}: item {item.number} makes the mission endless")
    return ordered
