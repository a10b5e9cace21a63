"""A mission for an autopilot: the part of a plan that PX4 or ArduPilot can hold, as QGroundControl's plan file.

Format: docs.qgroundcontrol.com, Plan File Format (version 1, mission version 2). Speeds are changed by
MAV_CMD_DO_CHANGE_SPEED (airspeed), legs end at waypoints, circles are MAV_CMD_NAV_LOITER_TURNS. A run is a leg with a
changed speed: an autopilot moves the throttle as its own speed controller does, not along a ramp. Porpoising is left
out.

The same plan as TOML, for `sim fly --plan`.
"""

import json
from collections.abc import Sequence
from enum import IntEnum
from math import asin, atan2, cos, degrees, pi, radians, sin
from typing import NamedTuple

from analysis.missions.expected_aircraft import ExpectedAircraft
from analysis.missions.information import QUESTION_TITLES
from analysis.missions.pieces import Hold, Land, Maneuver, PieceKind, Porpoise, Run, Stand, TakeOff, Turn, slowest_mps
from analysis.missions.plan_settings import MARGINS, PATH
from analysis.missions.search import FlightPlan, Request
from analysis.missions.time_history import climb_rate_mps
from flight.runs import AIRCRAFT_SIZE
from flight.units import EARTH_RADIUS_M, KNOT_MPS


class Command(IntEnum):
    """MAV_CMD"""

    WAYPOINT = 16
    LOITER_TURNS = 18
    RETURN_TO_LAUNCH = 20
    TAKE_OFF = 22
    CHANGE_SPEED = 178


class Frame(IntEnum):
    """MAV_FRAME"""

    MISSION = 2
    GLOBAL_RELATIVE_ALTITUDE = 3


class Autopilot(IntEnum):
    """MAV_AUTOPILOT"""

    ardupilot = 3
    px4 = 12


class Home(NamedTuple):
    """Where the legs are centered [deg], and the heading of the first one [rad]."""

    latitude_deg: float
    longitude_deg: float
    heading_rad: float


class _Item(NamedTuple):
    command: int
    params: tuple[float, float, float, float | None]
    place: tuple[float, float] | None = None  # latitude, longitude


def qgroundcontrol_plan(plan: FlightPlan, home: Home, firmware: str) -> str:
    """The text of a .plan file. firmware: "px4" or "ardupilot". The fence is the space of the request."""
    height_m = plan.request.space.height_m
    items = []
    for i, item in enumerate(_items(plan, home), start=1):
        latitude, longitude = item.place or (0.0, 0.0)
        located = item.place is not None
        items.append(
            {
                "AMSLAltAboveTerrain": None,
                "Altitude": height_m if located else 0,
                "AltitudeMode": 1,
                "autoContinue": True,
                "command": item.command,
                "doJumpId": i,
                "frame": Frame.GLOBAL_RELATIVE_ALTITUDE if located else Frame.MISSION,
                "params": [*item.params, latitude, longitude, height_m if located else 0],
                "type": "SimpleItem",
            }
        )
    content = {
        "fileType": "Plan",
        "geoFence": {"circles": [], "polygons": [_fence(plan, home)], "version": 2},
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": round(plan.aircraft.cruise_mps, 1),
            "firmwareType": Autopilot[firmware],
            "globalPlanAltitudeMode": 1,
            "hoverSpeed": 5,
            "items": items,
            "plannedHomePosition": [home.latitude_deg, home.longitude_deg, 0],
            "vehicleType": 1,  # MAV_TYPE_FIXED_WING
            "version": 2,
        },
        "rallyPoints": {"points": [], "version": 2},
        "version": 1,
    }
    return json.dumps(content, indent=1) + "\n"


def waypoint_file(plan: FlightPlan, home: Home) -> str:
    """The same mission in the plain-text format (QGC WPL 110), which Mission Planner and MAVProxy load."""
    rows: list[tuple[float, ...]] = [
        (0, 1, 0, Command.WAYPOINT, 0.0, 0.0, 0.0, 0.0, home.latitude_deg, home.longitude_deg, 0.0, 1)
    ]
    for i, item in enumerate(_items(plan, home), start=1):
        latitude, longitude = item.place or (0.0, 0.0)
        located = item.place is not None
        height_m = plan.request.space.height_m if located else 0.0
        frame = Frame.GLOBAL_RELATIVE_ALTITUDE if located else Frame.MISSION
        params = tuple(0.0 if value is None else float(value) for value in item.params)
        rows.append((i, 0, frame, item.command, *params, latitude, longitude, height_m, 1))
    lines = ["\t".join(f"{value:.8f}" if isinstance(value, float) else str(value) for value in row) for row in rows]
    return "\n".join(["QGC WPL 110", *lines]) + "\n"


def left_out(plan: FlightPlan) -> list[str]:
    """Titles of the pieces that the mission does not hold."""
    return [piece.title for piece in dict.fromkeys(plan.pieces) if piece.kind.by_hand]


def _items(plan: FlightPlan, home: Home) -> list[_Item]:
    space = plan.request.space
    far, near = _place(home, space.leg_m / 2, 0.0), _place(home, -space.leg_m / 2, 0.0)
    center = _place(home, 0.0, 0.0)
    held_mps = MARGINS.held * slowest_mps(plan.aircraft, plan.request.wind_kt)
    items, ends, speed_mps = [], [far, near], 0.0

    def change(wanted: float) -> None:
        nonlocal speed_mps
        if abs(wanted - speed_mps) > 0.05:
            airspeed, keep_throttle = 0, -1
            items.append(_Item(Command.CHANGE_SPEED, (airspeed, round(wanted, 2), keep_throttle, 0)))
            speed_mps = wanted

    def leg() -> None:
        accepted_m = 30.0
        items.append(_Item(Command.WAYPOINT, (0, accepted_m, 0, None), ends[0]))
        ends.reverse()

    for piece in plan.pieces:
        if piece.kind.by_hand:
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
                    items.append(_Item(Command.LOITER_TURNS, (turns, 0, round(radius_m, 1), 1), center))
                case Hold() | Turn() | Porpoise() | TakeOff():
                    pass
    pitch_deg = 12.0
    first = _Item(Command.TAKE_OFF, (pitch_deg, 0, 0, None), _place(home, space.leg_m / 4, 0.0))
    return [first, *items, _Item(Command.RETURN_TO_LAUNCH, (0, 0, 0, 0))]


def _place(home: Home, along_m: float, across_m: float) -> tuple[float, float]:
    """Latitude and longitude [deg] of a point along and to the right of the first leg (great circle)."""
    distance = (along_m**2 + across_m**2) ** 0.5 / EARTH_RADIUS_M
    bearing = home.heading_rad + atan2(across_m, along_m)
    latitude = radians(home.latitude_deg)
    there = asin(sin(latitude) * cos(distance) + cos(latitude) * sin(distance) * cos(bearing))
    east = atan2(sin(bearing) * sin(distance) * cos(latitude), cos(distance) - sin(latitude) * sin(there))
    return round(degrees(there), 7), round(home.longitude_deg + degrees(east), 7)


def _fence(plan: FlightPlan, home: Home) -> dict[str, object]:
    """A box about the legs, with room for the turns: what the request leaves, else for turns at the fastest speed."""
    widest_m = 1.5 * Turn(plan.aircraft.fastest_mps).width_m
    side = min(plan.request.space.side_m, widest_m)
    half = plan.request.space.leg_m / 2 + side
    corners = [
        _place(home, along, across) for along, across in ((half, side), (half, -side), (-half, -side), (-half, side))
    ]
    return {"inclusion": True, "polygon": [list(corner) for corner in corners], "version": 1}


def simulator_plan(maneuvers: Sequence[Maneuver], aircraft: ExpectedAircraft, request: Request) -> str:
    """The text of the file, in the wind and the turbulence that the plan was made for."""
    kt = request.wind_kt
    lines = [
        f'title = "Planned for {QUESTION_TITLES[request.question]}, {request.minutes:g} min"',
        "",
        "[air]",
        f'wind = "{kt * KNOT_MPS:.2f} m/s"',
        f'wind_from = "{PATH.wind_from_deg % 360:.0f} deg"',
        f'turbulence = "{kt * KNOT_MPS:.3f} m/s"',
    ]
    for maneuver in maneuvers:
        for segment in _segments(maneuver, aircraft, request.space.height_m):
            lines += ["", "[[segment]]", *(f"{key} = {_value(value)}" for key, value in segment.items())]
    return "\n".join(lines) + "\n"


def _value(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)


def _segments(maneuver: Maneuver, aircraft: ExpectedAircraft, height_m: float) -> list[dict[str, object]]:
    rate_mps = climb_rate_mps(aircraft)

    def climb(to_m: float, speed_mps: float) -> dict[str, object]:
        return {
            "kind": "climb",
            "height": f"{to_m:g} m",
            "climb": f"{rate_mps:.2f} m/s",
            "speed": f"{speed_mps:.2f} m/s",
        }

    match maneuver:
        case Stand(duration_s):
            return [{"kind": "stand", "duration": f"{duration_s:g} s"}]
        case TakeOff(speed_mps):
            return [{"kind": "take-off"}, climb(height_m, speed_mps)]
        case Hold(duration_s, speed_mps):
            return [{"kind": "hold", "duration": f"{duration_s:.1f} s", "speed": f"{speed_mps:.2f} m/s"}]
        case Turn(speed_mps, angle_rad, bank_rad):
            return [
                {
                    "kind": "turn",
                    "angle": f"{degrees(angle_rad):.1f} deg",
                    "bank": f"{degrees(bank_rad):.0f} deg",
                    "speed": f"{speed_mps:.2f} m/s",
                }
            ]
        case Run():
            return [
                {
                    "kind": "run",
                    "throttle": maneuver.throttle,
                    "ramp": f"{maneuver.ramp_s:g} s",
                    "longest": f"{maneuver.longest_s:g} s",
                    "speed": f"{maneuver.until_mps:.2f} m/s",
                }
            ]
        case Porpoise():
            return [
                {
                    "kind": "porpoise",
                    "duration": f"{maneuver.duration_s:.1f} s",
                    "speed": f"{maneuver.speed_mps:.2f} m/s",
                    "elevator": "8 deg",  # at first; the simulator's pilot adapts to the load asked
                    "load": round(maneuver.load, 3),
                    "first_period": f"{maneuver.first_period_s:g} s",
                    "last_period": f"{maneuver.last_period_s:g} s",
                }
            ]
        case Land(speed_mps):
            return [climb(min(AIRCRAFT_SIZE.least_height_m, height_m), speed_mps), {"kind": "land"}]
    raise AssertionError(maneuver)
