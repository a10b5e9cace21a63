"""Mission items agree with a second reader, pymavlink: the numbers of commands, and files of any writing style."""

import random
from math import nan
from pathlib import Path

import pytest
from pymavlink import mavutil, mavwp
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flightpower.analysis.missions.items import (
    ABOVE_HOME,
    ABOVE_SEA,
    ABOVE_TERRAIN,
    Autopilot,
    Command,
    Equipment,
    Frame,
    Gripper,
    Item,
    SpeedType,
    Start,
)
from flightpower.analysis.missions.qgroundcontrol import Vehicle, plan_text, read_plan
from flightpower.analysis.missions.waypoints import read_waypoints, waypoints_text

NAMES = {
    Command.LOITER_UNLIMITED: "NAV_LOITER_UNLIM",
    Command.RETURN: "NAV_RETURN_TO_LAUNCH",
    Command.TAKE_OFF: "NAV_TAKEOFF",
    Command.CHANGE_HEIGHT: "NAV_CONTINUE_AND_CHANGE_ALT",
    Command.LOITER_TO_HEIGHT: "NAV_LOITER_TO_ALT",
    Command.SPLINE: "NAV_SPLINE_WAYPOINT",
    Command.VERTICAL_TAKE_OFF: "NAV_VTOL_TAKEOFF",
    Command.VERTICAL_LANDING: "NAV_VTOL_LAND",
    Command.GUIDED: "NAV_GUIDED_ENABLE",
    Command.PLACE_PAYLOAD: "NAV_PAYLOAD_PLACE",
    Command.LAST_PATH: "NAV_LAST",
    Command.JUMP_TAG: "JUMP_TAG",
    Command.JUMP_TO_TAG: "DO_JUMP_TAG",
    Command.VERTICAL_TRANSITION: "DO_VTOL_TRANSITION",
}


@pytest.mark.parametrize("command", Command)
def test_commands_are_numbered_as_by_mavlink(command: Command) -> None:
    own = {command.name, f"NAV_{command.name}", f"DO_{command.name}"}
    assert mavlink.enums["MAV_CMD"][command].name.removeprefix("MAV_CMD_") in {NAMES.get(command)} | own


@pytest.mark.parametrize("command", Equipment)
def test_equipment_is_numbered_and_named_as_by_mavlink(command: Equipment) -> None:
    assert mavlink.enums["MAV_CMD"][command].name == f"MAV_CMD_{command.name}"


def test_frames_and_kinds_are_numbered_as_by_mavlink() -> None:
    assert {mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT} == ABOVE_SEA
    assert {mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT} == ABOVE_HOME
    assert {mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT, mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT} == ABOVE_TERRAIN
    assert mavlink.MAV_FRAME_MISSION == Frame.MISSION
    assert (mavlink.SPEED_TYPE_AIRSPEED, mavlink.SPEED_TYPE_GROUNDSPEED) == tuple(SpeedType)
    assert (mavlink.GRIPPER_ACTION_RELEASE, mavlink.GRIPPER_ACTION_GRAB) == tuple(Gripper)
    assert (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_PX4) == tuple(Autopilot)


def random_items(seed: int) -> list[Item]:
    """Return items with and without positions, in all frames, and with gaps in their numbers."""
    rng = random.Random(seed)
    number, items = 0, []
    for _ in range(rng.randrange(1, 12)):
        number += rng.randrange(1, 4)
        placed = rng.random() < 0.7
        place = (rng.uniform(-60, 60), rng.uniform(-170, 170)) if placed else (None, None)
        params = (rng.choice([0.0, 2.0, 12.5]), rng.uniform(-90, 90), 0.0, rng.choice([0.0, 1.0]))
        command = rng.choice([*Command, *Equipment])
        items.append(
            Item(number, command, rng.choice(list(Frame)), params, *place, rng.uniform(5, 400) if placed else 0.0)
        )
    return items


def habits(text: str, seed: int) -> str:
    """Return the file as other programs write it: spaces for tabs, comments, empty lines, line ends of Windows."""
    rng = random.Random(seed)
    head, *rows = text.strip().split("\n")
    lines = [head]
    for row in rows:
        lines += rng.choice([[], ["# a note"], ["#"], [""], ["# 16 0 3"]])
        lines.append(rng.choice([row, row.replace("\t", " "), row.replace("\t", "  "), row + "  "]))
    return rng.choice(["\n", "\r\n"]).join(lines) + rng.choice(["", "\n", "\n\n"])


@pytest.mark.parametrize("seed", range(40))
def test_waypoints_are_read_as_pymavlink_reads_them(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MAVLINK20", raising=False)
    home = Start(48.1, 11.5, 500.0)
    written = random_items(seed)
    path = tmp_path / "mission.waypoints"
    path.write_bytes(habits(waypoints_text(written, home), seed).encode())
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(path)) == len(written) + 1
    read = read_waypoints(path.read_text("utf-8"), "here")
    first = loader.wp(0)
    assert read.start == (first.x, first.y, first.z) == home
    numbers = [int(line.split()[0]) for line in path.read_text("utf-8").splitlines()[1:] if line[:1].isdigit()]
    assert [item.number for item in read.items] == numbers[1:], "numbers in the file, where pymavlink renumbers"
    for i, item in enumerate(read.items, start=1):
        other = loader.wp(i)
        assert (item.command, item.frame) == (other.command, other.frame)
        assert item.params == (other.param1, other.param2, other.param3, other.param4)
        assert (item.latitude_deg or 0.0, item.longitude_deg or 0.0, item.height_m) == (other.x, other.y, other.z)


@pytest.mark.parametrize("seed", range(40))
def test_both_formats_hold_the_same_items(seed: int) -> None:
    """Both read back what was written; waypoint files have eight digits, and zero stands for a missing number."""
    home, written = Start(48.1, 11.5, 500.0), random_items(seed)
    plan = read_plan(plan_text(written, home, Vehicle("px4", 15.0, [(48.0, 11.0)])), "here")
    text = read_waypoints(waypoints_text(written, home), "here")
    assert plan.items == written and plan.start == text.start == home
    for item, other in zip(plan.items, text.items, strict=True):
        assert item[:3] == other[:3] and item.has_place == other.has_place
        messages = [*item.params, item.latitude_deg or 0.0, item.longitude_deg or 0.0, item.height_m]
        again = [*other.params, other.latitude_deg or 0.0, other.longitude_deg or 0.0, other.height_m]
        assert messages == pytest.approx(again, abs=1e-8)


def test_a_parameter_that_is_not_given_is_null_in_a_plan_and_zero_in_waypoints() -> None:
    items = [Item(1, Command.WAYPOINT, Frame.RELATIVE, (0.0, 30.0, 0.0, nan), 48.2, 11.5, 80.0)]
    home = Start(48.1, 11.5, 0.0)
    assert "null" in plan_text(items, home, Vehicle("ardupilot", 15.0, [])).split('"params"')[1].split("]")[0]
    assert read_waypoints(waypoints_text(items, home), "here").items[0].params[3] == 0
    assert mavutil.mavlink.MAV_CMD_NAV_WAYPOINT == items[0].command
