"""Reads and writes plans of QGroundControl (.plan; also reads its predecessor .mission).

Format: docs.qgroundcontrol.com, Plan File Format (version 1, mission version 2). A survey from before QGroundControl
3.4 has no transects in the file. A landing pattern of version 1 states for each of its heights whether it is above home
or above the sea.
"""

import json
import math
from collections.abc import Iterator, Sequence
from enum import IntEnum
from typing import Any, NamedTuple

from flightpower.analysis.missions.items import Autopilot, Command, Frame, Item, ReadMission, Start, item_of
from flightpower.flight.errors import InputError


def read_plan(text: str, where: str) -> ReadMission:
    """Read a plan. Raises InputError that begins with `where` for other content, or for items without waypoints."""
    try:
        content = json.loads(text)
        mission = content if "items" in content and "mission" not in content else content["mission"]
        if mission.get("complexItems"):
            raise InputError(OLD_SURVEY.format(where=where))
        plain = [item for entry in mission["items"] for item in _simple(entry, where)]
        items = [_item(position, item, where) for position, item in enumerate(plain, start=1)]
        notes = (*_of_vehicle(mission.get("vehicleType")), *_of_speed(mission.get("cruiseSpeed"), items))
        return ReadMission(items, _home(mission.get("plannedHomePosition")), notes)
    except InputError:
        raise
    except KeyError as error:
        raise InputError(f"{where}: not a plan of QGroundControl (lacks {error})") from None
    except (ValueError, TypeError, IndexError, AttributeError, OverflowError, RecursionError) as error:
        raise InputError(f"{where}: not a plan of QGroundControl ({error})") from None


OLD_SURVEY = (
    "{where}: a survey of QGroundControl before 3.4 has no transects in the file; open it in QGroundControl and save it"
    " again, or replace it with waypoints"
)


def _home(place: Any) -> Start | None:
    """Return home from a position, possibly without height; latitude and longitude both zero mean no position."""
    if isinstance(place, dict):  # in a .mission, home is an item
        place = place.get("coordinate")
    if not place or place[0] is None or place[1] is None or (place[0] == 0 and place[1] == 0):
        return None
    above_sea = place[2] if len(place) > 2 else None
    return Start(float(place[0]), float(place[1]), None if above_sea is None else float(above_sea))


def _of_speed(cruise_mps: Any, items: Sequence[Item]) -> tuple[str, ...]:
    """Return a note for a plan that sets no speed: the cruise speed in the file only gives QGroundControl's times."""
    if not cruise_mps or any(item.command == Command.CHANGE_SPEED for item in items):
        return ()
    return (
        f"QGroundControl computes times with {float(cruise_mps):g} m/s, which the plan does not send to the"
        " vehicle: that speed is not flown.",
    )


class Wingless(IntEnum):
    """MAV_TYPE of vehicles without a wing."""

    QUADROTOR = 2
    COAXIAL_HELICOPTER = 3
    HELICOPTER = 4
    ROVER = 10
    BOAT = 11
    SUBMARINE = 12
    HEXAROTOR = 13
    OCTOROTOR = 14
    TRICOPTER = 15


def _of_vehicle(kind: Any) -> tuple[str, ...]:
    """Return the message for a plan whose vehicle has no wings."""
    if kind not in list(Wingless):
        return ()
    name = Wingless(kind).name.lower().replace("_", " ")
    return (
        f"The plan is for a vehicle without wings, {name} (vehicleType {kind}); a fixed wing needs room to turn:"
        " make the plan for one.",
    )


def _simple(entry: dict[str, Any], where: str) -> Iterator[dict[str, Any]]:
    """Yield the simple items of an entry: the transects of a survey, or approach and touchdown of a landing pattern."""
    if entry["type"] in ("SimpleItem", "missionItem"):
        yield entry
        return
    kind = entry.get("complexItemType", entry["type"])
    if "TransectStyleComplexItem" in entry:
        yield from entry["TransectStyleComplexItem"]["Items"]
    elif kind == "fwLandingPattern":
        yield from _landing(entry)
    elif kind == "survey":
        raise InputError(OLD_SURVEY.format(where=where))
    elif kind == "vtolLandingPattern":
        raise InputError(f"{where}: lands vertically, and its power is not known; use a fixed-wing landing, or item 21")
    else:
        raise InputError(f"{where}: an item of kind {kind} is not understood; replace it with waypoints, or remove it")


def _landing(entry: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield approach and touchdown; if the pattern has circles, the approach circles down to its height."""
    relative = entry.get("altitudesAreRelative", True)
    circles = "loiterCoordinate" in entry or entry.get("useLoiterToAlt", False)
    first = Command.LOITER_TO_HEIGHT if circles else Command.WAYPOINT
    approach = entry.get("landingApproachCoordinate") or entry["loiterCoordinate"]
    for command, place, key in (
        (first, approach, "loiterAltitudeRelative"),
        (Command.LAND, entry["landCoordinate"], "landAltitudeRelative"),
    ):
        frame = Frame.RELATIVE if entry.get(key, relative) else Frame.ABOVE_SEA
        yield {"command": command, "frame": frame, "params": [0, 0, 0, None, *place]}


def _item(position: int, item: dict[str, Any], where: str) -> Item:
    """Make an item. Jumps refer to it by its `doJumpId`, or by its place in the list if it has none."""
    parameters = item["params"] if "params" in item else [item[f"param{i}"] for i in range(1, 5)]
    parameters = [*parameters, *item["coordinate"]] if len(parameters) == 4 and "coordinate" in item else parameters
    params = [math.nan if value is None else float(value) for value in parameters]
    if len(params) != 7:
        raise InputError(f"{where}: item {position} has {len(params)} parameters instead of 7")
    return item_of(int(item.get("doJumpId", position)), int(item["command"]), int(item["frame"]), params)


class Vehicle(NamedTuple):
    """The vehicle that flies the plan. cruise_mps: gives QGroundControl's times     fence_deg: corners"""

    firmware: str
    cruise_mps: float
    fence_deg: Sequence[tuple[float, float]]


def plan_text(items: Sequence[Item], home: Start, vehicle: Vehicle) -> str:
    """Return the text of a .plan file. Items without a position have the frame `MISSION`."""
    fence = {"inclusion": True, "polygon": [list(corner) for corner in vehicle.fence_deg], "version": 1}
    content = {
        "fileType": "Plan",
        "geoFence": {"circles": [], "polygons": [fence], "version": 2},
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": round(vehicle.cruise_mps, 1),
            "firmwareType": Autopilot[vehicle.firmware],
            "globalPlanAltitudeMode": 1,
            "hoverSpeed": 5,
            "items": [_written(item) for item in items],
            "plannedHomePosition": [home.latitude_deg, home.longitude_deg, home.above_sea_m],
            "vehicleType": 1,  # MAV_TYPE_FIXED_WING
            "version": 2,
        },
        "rallyPoints": {"points": [], "version": 2},
        "version": 1,
    }
    return json.dumps(content, indent=1) + "\n"


def _written(item: Item) -> dict[str, Any]:
    params = [None if math.isnan(value) else value for value in item.params]
    height_m = item.height_m if item.has_place else 0
    return {
        "AMSLAltAboveTerrain": None,
        "Altitude": height_m,
        "AltitudeMode": 1,
        "autoContinue": True,
        "command": item.command,
        "doJumpId": item.number,
        "frame": item.frame,
        "params": [*params, item.latitude_deg or 0.0, item.longitude_deg or 0.0, height_m],
        "type": "SimpleItem",
    }
