"""Lines of maps (OGC KML 2.3, `LineString`) as missions: from Google Earth, or a flight path of QGroundControl."""

import math
from xml.etree.ElementTree import Element

from flightpower.analysis.missions.items import Start
from flightpower.analysis.missions.mission import Assumed, Mission, Place, Step, check_height, local_m, with_return
from flightpower.flight.errors import InputError

GROUND_STATION = "Flight Path"  # QGroundControl's name for its line, which begins at home on the ground


def read_line(root: Element, where: str, assumed: Assumed) -> Mission:
    """Read a line as a route that starts at its first point, which is home unless another home is given.

    Raises InputError that begins with `where`.
    """
    lines = [element for element in root.iter() if _name(element) == "LineString"]
    if len(lines) != 1:
        raise InputError(
            f"{where}: has {len(lines)} lines (LineString); save only the one that is to be flown, or the mission as"
            " .plan, .waypoints, or INAV's XML"
        )
    texts = {_name(child): (child.text or "").strip() for child in lines[0]}
    points = _points(texts.get("coordinates", ""), where)
    with_heights = texts.get("altitudeMode", "clampToGround") != "clampToGround" and all(
        len(element) == 3 for element in points
    )
    absolute = with_heights and texts["altitudeMode"] == "absolute"
    planned = absolute and any(
        _name(element) == "name" and element.text == GROUND_STATION for mark in root.iter("*") for element in mark
    )
    start = Start(*(assumed.home_deg or (points[0][1], points[0][0])), None)
    base_m, notes = 0.0, []
    if not with_heights:
        notes.append(f"The line has no heights: flown {assumed.height_m:g} m above home (--height).")
    elif planned:
        base_m = points[0][2]
    elif absolute and assumed.elevation_m is not None:
        base_m = assumed.elevation_m
    elif absolute:
        base_m = points[0][2] - assumed.height_m
        notes.append(
            f"The line is above the sea: its first point is taken {assumed.height_m:g} m above home (--height)"
            "; give --elevation of home to be exact."
        )
    places = []
    for point in points:
        height_m = point[2] - base_m if with_heights else assumed.height_m
        check_height(height_m, where, "check the heights of the line")
        places.append(Place(*local_m(point[1], point[0], start, where), height_m))
    steps = tuple(
        Step(f"point {number}", place, launched=planned and number == 2)
        for number, place in enumerate(places[1:], start=2)
    )
    return with_return(Mission(places[0], steps, tuple(notes)), ends_by_landing=False)


def _points(text: str, where: str) -> list[tuple[float, ...]]:
    try:
        points = [tuple(float(x) for x in point.split(",")) for point in text.split()]
        if len(points) < 2 or any(len(point) not in (2, 3) for point in points):
            raise ValueError("fewer than two points")
        if not all(math.isfinite(x) for point in points for x in point):
            raise ValueError("not a number")
    except ValueError as error:
        raise InputError(f"{where}: coordinates of the line are not longitude,latitude,height ({error})") from None
    return points


def _name(element: Element) -> str:
    return element.tag.rpartition("}")[2]
