"""Items of a mission with the numbers that autopilots use: commands (MAV_CMD), frames of heights, and home.

Source: mavlink.io, Mission Protocol and the message set `common`; tests compare the numbers with pymavlink's.
"""

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple


class Command(IntEnum):
    """MAV_CMD of items that use energy, or change the energy that later items use."""

    WAYPOINT = 16
    LOITER_UNLIMITED = 17
    LOITER_TURNS = 18
    LOITER_TIME = 19
    RETURN = 20
    LAND = 21
    TAKE_OFF = 22
    CHANGE_HEIGHT = 30
    LOITER_TO_HEIGHT = 31
    SPLINE = 82
    VERTICAL_TAKE_OFF = 84
    VERTICAL_LANDING = 85
    GUIDED = 92
    DELAY = 93
    PLACE_PAYLOAD = 94
    LAST_PATH = 95  # commands up to this number fly to a place
    SET_MODE = 176
    JUMP = 177
    CHANGE_SPEED = 178
    SET_HOME = 179
    PARACHUTE = 208
    GRIPPER = 211
    JUMP_TAG = 600
    JUMP_TO_TAG = 601
    VERTICAL_TRANSITION = 3000


class Equipment(IntEnum):
    """MAV_CMD of items that are assumed to use no energy: cameras, gimbals, marks in the mission, servos, relays."""

    CONDITION_DELAY = 112
    CONDITION_DISTANCE = 114
    CONDITION_YAW = 115
    DO_SET_RELAY = 181
    DO_REPEAT_RELAY = 182
    DO_SET_SERVO = 183
    DO_REPEAT_SERVO = 184
    DO_RETURN_PATH_START = 188
    DO_LAND_START = 189
    DO_SET_ROI_LOCATION = 195
    DO_SET_ROI_WPNEXT_OFFSET = 196
    DO_SET_ROI_NONE = 197
    DO_SET_ROI_SYSID = 198
    DO_CONTROL_VIDEO = 200
    DO_SET_ROI = 201
    DO_DIGICAM_CONFIGURE = 202
    DO_DIGICAM_CONTROL = 203
    DO_MOUNT_CONFIGURE = 204
    DO_MOUNT_CONTROL = 205
    DO_SET_CAM_TRIGG_DIST = 206
    DO_FENCE_ENABLE = 207
    DO_AUTOTUNE_ENABLE = 212
    DO_SET_CAM_TRIGG_INTERVAL = 214
    DO_SET_RESUME_REPEAT_DIST = 215
    DO_SPRAYER = 216
    DO_SEND_SCRIPT_MESSAGE = 217
    DO_AUX_FUNCTION = 218
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


EQUIPMENT = frozenset(Equipment)


class Frame(IntEnum):
    """MAV_FRAME of heights; the second of a pair is for integer degrees. MISSION: frame of items without a position."""

    ABOVE_SEA = 0
    MISSION = 2
    RELATIVE = 3
    ABOVE_SEA_INT = 5
    RELATIVE_INT = 6
    TERRAIN = 10
    TERRAIN_INT = 11


ABOVE_SEA = frozenset((Frame.ABOVE_SEA, Frame.ABOVE_SEA_INT))
ABOVE_HOME = frozenset((Frame.RELATIVE, Frame.RELATIVE_INT))
ABOVE_TERRAIN = frozenset((Frame.TERRAIN, Frame.TERRAIN_INT))


class SpeedType(IntEnum):
    """Values of the first parameter of a change of speed."""

    AIRSPEED = 0
    GROUND_SPEED = 1


class Gripper(IntEnum):
    """Values of the second parameter of a gripper's item."""

    RELEASE = 0
    GRAB = 1


class Autopilot(IntEnum):
    """MAV_AUTOPILOT"""

    ardupilot = 3
    px4 = 12


class Item(NamedTuple):
    """A mission item. number: the target number that jumps use     params: the first four; NaN if not given

    latitude_deg, longitude_deg : None if the item has no position     height_m : in its frame; NaN if not given
    """

    number: int
    command: int
    frame: int
    params: tuple[float, float, float, float]
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    height_m: float = 0.0

    @property
    def has_place(self) -> bool:
        return self.latitude_deg is not None and self.longitude_deg is not None


class Start(NamedTuple):
    """Where the mission begins: latitude, longitude [deg], height above sea level [m] or None if not in the file."""

    latitude_deg: float
    longitude_deg: float
    above_sea_m: float | None


class ReadMission(NamedTuple):
    """The content of a file: items, home, and notes."""

    items: list[Item]
    start: Start | None
    notes: tuple[str, ...] = ()


def item_of(number: int, command: int, frame: int, params: Sequence[float]) -> Item:
    """Make an item. params: seven, the last three its position; latitude and longitude 0 or missing mean none."""
    first = (params[0], params[1], params[2], params[3])
    placed = math.isfinite(params[4]) and math.isfinite(params[5]) and (params[4] != 0 or params[5] != 0)
    return Item(number, command, frame, first, params[4] if placed else None, params[5] if placed else None, params[6])
