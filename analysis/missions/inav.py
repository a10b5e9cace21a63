"""Reads missions of INAV as mwp and the Configurator save them: XML with `missionitem`.

Source: INAV's docs/Navigation.md. Positions are in degrees. Heights are in meters above home, or above the sea if bit 0
of the third parameter is set. A jump refers to an item by its number in the file. Speeds of legs apply to multicopters
only.
"""

import math
from enum import StrEnum
from xml.etree.ElementTree import Element

from flightpower.analysis.missions.items import Command, Equipment, Frame, Item, ReadMission, Start, item_of
from flightpower.flight.errors import InputError

ITEM = "missionitem"


class Action(StrEnum):
    """The effect of an INAV item."""

    WAYPOINT = "WAYPOINT"
    HOLD = "POSHOLD_UNLIM"
    HOLD_FOR_TIME = "POSHOLD_TIME"
    RETURN = "RTH"
    POINT_OF_INTEREST = "SET_POI"
    JUMP = "JUMP"
    HEADING = "SET_HEAD"
    LAND = "LAND"


COMMANDS = {
    Action.WAYPOINT: Command.WAYPOINT,
    Action.HOLD: Command.LOITER_UNLIMITED,
    Action.HOLD_FOR_TIME: Command.LOITER_TIME,
    Action.RETURN: Command.RETURN,
    Action.POINT_OF_INTEREST: Equipment.DO_SET_ROI_LOCATION,
    Action.JUMP: Command.JUMP,
    Action.HEADING: Equipment.CONDITION_YAW,
    Action.LAND: Command.LAND,
}


def read_inav(root: Element, where: str) -> ReadMission:
    """Read a mission of INAV. Raises InputError with a message that begins with `where` and names the item."""
    elements = [element for element in root.iter() if _name(element) == ITEM]
    items = [_item(element, where) for element in elements]
    if len({item.number for item in items}) < len(items):
        raise InputError(f"{where}: has several missions of INAV; save only the one that is to be flown")
    try:
        map_view = next(
            (element for element in root.iter() if _name(element) in ("mwp", "meta") and "home-x" in element.attrib),
            None,
        )
        home = None if map_view is None else (float(map_view.get("home-y", "")), float(map_view.get("home-x", "")))
    except ValueError as error:
        raise InputError(f"{where}: home is not a latitude and longitude ({error})") from None
    return ReadMission(items, Start(*home, None) if home and any(home) else None)


def _item(element: Element, where: str) -> Item:
    number = element.get("no", "without a number")
    try:
        action = Action(element.get("action", "").upper())
        latitude, longitude, height_m = (float(element.get(key, "0")) for key in ("lat", "lon", "alt"))
        first, second, third = (float(element.get(f"parameter{i}", "0")) for i in (1, 2, 3))
        above_sea = bool(int(third) & 1)
        position = int(number)
    except (ValueError, OverflowError) as error:
        raise InputError(f"{where}: item {number} of INAV is not understood ({error})") from None
    frame = Frame.ABOVE_SEA if above_sea else Frame.RELATIVE
    parameters = {Action.HOLD_FOR_TIME: (first, 0), Action.JUMP: (first, second)}.get(action, (0, 0))
    return item_of(position, COMMANDS[action], frame, [*parameters, 0.0, math.nan, latitude, longitude, height_m])


def _name(element: Element) -> str:
    return element.tag.rpartition("}")[2].lower()
