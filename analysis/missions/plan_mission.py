"""A flight plan as a mission for an autopilot: the part of the plan that PX4 or ArduPilot can express.

Speeds are changed by MAV_CMD_DO_CHANGE_SPEED (airspeed), legs end at waypoints, circles are MAV_CMD_NAV_LOITER_TURNS. A
run is a leg with a new speed: an autopilot moves the throttle by its own speed controller, not along a ramp. Porpoising
is left out.
"""

from math import asin, atan2, cos, degrees, nan, pi, radians, sin
from typing import NamedTuple

from flightpower.analysis.missions.items import Command, Frame, Item, SpeedType, Start
from flightpower.analysis.missions.pieces import Hold, PieceKind, Porpoise, Run, TakeOff, Turn, slowest_mps
from flightpower.analysis.missions.plan_settings import MARGINS
from flightpower.analysis.missions.qgroundcontrol import Vehicle, plan_text
from flightpower.analysis.missions.search import FlightPlan
from flightpower.analysis.missions.waypoints import waypoints_text
from flightpower.flight.units import EARTH_RADIUS_M


class Home(NamedTuple):
    """Center of the legs [deg], and heading of the first leg [rad]."""

    latitude_deg: float
    longitude_deg: float
    heading_rad: float

    @property
    def start(self) -> Start:
        """Position of home. Its height is unknown and set to 0; all heights are relative to it."""
        return Start(self.latitude_deg, self.longitude_deg, 0)


def qgroundcontrol_plan(plan: FlightPlan, home: Home, firmware: str) -> str:
    """Return the text of a .plan file. firmware: "px4" or "ardupilot". The fence is the space of the request."""
    return plan_text(_items(plan, home), home.start, Vehicle(firmware, plan.aircraft.cruise_mps, _fence(plan, home)))


def waypoint_file(plan: FlightPlan, home: Home) -> str:
    """Return the mission as plain text (QGC WPL 110), which Mission Planner and MAVProxy load."""
    return waypoints_text(_items(plan, home), home.start)


def left_out(plan: FlightPlan) -> list[str]:
    """Return titles of the pieces that are not in the mission."""
    return [piece.title for piece in dict.fromkeys(plan.pieces) if piece.kind.manual_only]


def _items(plan: FlightPlan, home: Home) -> list[Item]:
    space = plan.request.space
    far_end, near = _place(home, space.leg_m / 2, 0.0), _place(home, -space.leg_m / 2, 0.0)
    center = _place(home, 0.0, 0.0)
    held_mps = MARGINS.hold * slowest_mps(plan.aircraft, plan.request.wind_kt)
    items, ends, speed_mps = list[Item](), [far_end, near], 0.0

    def add(command: Command, *params: float, place: tuple[float, float] | None = None) -> None:
        frame = Frame.MISSION if place is None else Frame.RELATIVE
        p1, p2, p3, p4 = params
        latitude, longitude = place or (None, None)
        items.append(Item(len(items) + 1, command, frame, (p1, p2, p3, p4), latitude, longitude, space.height_m))

    def change(wanted: float) -> None:
        nonlocal speed_mps
        if abs(wanted - speed_mps) > 0.05:
            keep_throttle = -1
            add(Command.CHANGE_SPEED, SpeedType.AIRSPEED, round(wanted, 2), keep_throttle, 0)
            speed_mps = wanted

    def leg() -> None:
        accepted_m = 30.0
        add(Command.WAYPOINT, 0, accepted_m, 0, nan, place=ends[0])
        ends.reverse()

    pitch_deg = 12.0
    add(Command.TAKE_OFF, pitch_deg, 0, 0, nan, place=_place(home, space.leg_m / 4, 0.0))
    for piece in plan.pieces:
        if piece.kind.manual_only:
            continue
        for maneuver in piece.maneuvers:
            match maneuver:
                case Hold(_, wanted) if piece.kind in (PieceKind.CIRCUIT, PieceKind.CIRCLES):
                    change(wanted)
                    leg()
                case Run():
                    change(max(maneuver.until_mps, held_mps))
                    leg()
                case Turn(wanted, angle_rad) if angle_rad >= 2 * pi:
                    change(wanted)
                    radius_m = maneuver.width_m / 2
                    turns = round(angle_rad / (2 * pi))
                    add(Command.LOITER_TURNS, turns, 0, round(radius_m, 1), 1, place=center)
                case Hold() | Turn() | Porpoise() | TakeOff():
                    pass
    add(Command.RETURN, 0, 0, 0, 0)
    return items


def _place(home: Home, along_m: float, across_m: float) -> tuple[float, float]:
    """Return latitude and longitude [deg] of a point along and to the right of the first leg (great circle)."""
    distance = (along_m**2 + across_m**2) ** 0.5 / EARTH_RADIUS_M
    bearing = home.heading_rad + atan2(across_m, along_m)
    latitude = radians(home.latitude_deg)
    latitude_there = asin(sin(latitude) * cos(distance) + cos(latitude) * sin(distance) * cos(bearing))
    east = atan2(sin(bearing) * sin(distance) * cos(latitude), cos(distance) - sin(latitude) * sin(latitude_there))
    return round(degrees(latitude_there), 7), round(home.longitude_deg + degrees(east), 7)


def _fence(plan: FlightPlan, home: Home) -> list[tuple[float, float]]:
    """Return a box about the legs with the requested room for turns, or what turns at the fastest speed need."""
    widest_m = 1.5 * Turn(plan.aircraft.fastest_mps).width_m
    side = min(plan.request.space.side_m, widest_m)
    half = plan.request.space.leg_m / 2 + side
    return [
        _place(home, along, across) for along, across in ((half, side), (half, -side), (-half, -side), (-half, side))
    ]
