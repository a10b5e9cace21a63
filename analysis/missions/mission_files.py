"""Reads missions from files, recognized by content: plans, waypoints, missions of INAV, lines of maps."""

from pathlib import Path
from xml.etree import ElementTree

from flightpower.analysis.missions.flown import flown
from flightpower.analysis.missions.inav import ITEM, read_inav
from flightpower.analysis.missions.items import ReadMission
from flightpower.analysis.missions.lines import read_line
from flightpower.analysis.missions.mission import Assumed, Mission
from flightpower.analysis.missions.qgroundcontrol import read_plan
from flightpower.analysis.missions.waypoints import HEAD, read_waypoints
from flightpower.flight.errors import InputError
from flightpower.flight.files import read_text

FORMATS = "a plan of QGroundControl, MAVLink waypoints (QGC WPL 110), a mission of INAV (XML), or a line of a map (KML)"


def load_mission(path: Path, assumed: Assumed = Assumed()) -> Mission:
    """Read a mission. Raises InputError that names the file and the item that is not understood."""
    text, where = read_text(path), str(path)
    if not text.lstrip().startswith("<"):
        return flown(_items(text, where), where, assumed)
    try:
        root = ElementTree.fromstring(text.strip())
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{where}: not XML of INAV, and no KML ({error})") from None
    if any(element.tag.lower().endswith(ITEM) for element in root.iter()):
        return flown(read_inav(root, where), where, assumed)
    return read_line(root, where, assumed)


def _items(text: str, where: str) -> ReadMission:
    begin = text.lstrip()[:20]
    if begin.startswith("{"):
        return read_plan(text, where)
    if begin.startswith(HEAD):
        return read_waypoints(text, where)
    raise InputError(f"{where}: is not {FORMATS}; save the mission as one of these, or give --legs")
