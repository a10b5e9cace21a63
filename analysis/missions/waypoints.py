"""Reads and writes the text of waypoints that Mission Planner, MAVProxy and QGroundControl exchange (QGC WPL 110).

Format: mavlink.io, File Formats, Plain-Text. The first item is home; a line that begins with # is a comment. QGC WPL
120 has the same columns but no home.
"""

import math
from collections.abc import Sequence

from flightpower.analysis.missions.items import ABOVE_SEA, Command, Frame, Item, ReadMission, Start, item_of
from flightpower.flight.errors import InputError

HEAD = "QGC WPL"


def read_waypoints(text: str, where: str) -> ReadMission:
    """Read waypoints. Raises InputError that begins with `where` and names the line."""
    head, *lines = text.strip().splitlines()
    if head.split() not in (["QGC", "WPL", "110"], ["QGC", "WPL", "120"]):
        raise InputError(f"{where}: format {head.strip()!r} is not known; save the mission as QGC WPL 110")
    items = []
    for number, line in enumerate(lines, start=2):
        if line.strip() and not line.startswith("#"):
            items.append(_item(line.split(), f"{where}: line {number}"))
    if not items:
        raise InputError(f"{where}: has no mission item")
    if head.split()[-1] == "120":
        return ReadMission(items, None)
    return _without_home(items)


def _item(fields: Sequence[str], where: str) -> Item:
    try:
        if len(fields) != 12:
            raise ValueError(f"{len(fields)} columns instead of 12")
        return item_of(int(fields[0]), int(fields[3]), int(fields[2]), [float(x) for x in fields[4:11]])
    except ValueError as error:
        raise InputError(f"{where}: not a mission item ({error})") from None


def _without_home(items: list[Item]) -> ReadMission:
    """Take home from the first item: a waypoint, or a zero of Mission Planner; use its height if above sea level."""
    home = items[0]
    if home.command not in (0, Command.WAYPOINT):
        note = (
            f"Item {home.number} (command {home.command}) is not the home position that the format has first:"
            " it is flown."
        )
        return ReadMission(items, None, (note,))
    if home.latitude_deg is None or home.longitude_deg is None:
        return ReadMission(items[1:], None)
    height_given = home.frame in ABOVE_SEA and math.isfinite(home.height_m)
    return ReadMission(items[1:], Start(home.latitude_deg, home.longitude_deg, home.height_m if height_given else None))


def waypoints_text(items: Sequence[Item], home: Start) -> str:
    """Return the text of a .waypoints file, home first."""
    first = Item(
        0,
        Command.WAYPOINT,
        Frame.ABOVE_SEA,
        (0, 0, 0, 0),
        home.latitude_deg,
        home.longitude_deg,
        home.above_sea_m or 0.0,
    )
    lines = []
    for item in (first, *items):
        current = int(item is first)
        params = [0.0 if math.isnan(value) else float(value) for value in item.params]
        height_m = item.height_m if item.has_place else 0.0
        row = (item.number, current, item.frame, item.command, *params, item.latitude_deg or 0.0,
               item.longitude_deg or 0.0, height_m, 1)  # fmt: skip
        lines.append("\t".join(f"{value:.8f}" if isinstance(value, float) else str(int(value)) for value in row))
    return "\n".join([f"{HEAD} 110", *lines]) + "\n"
