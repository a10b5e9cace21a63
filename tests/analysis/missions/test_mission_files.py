"""Missions of QGroundControl, Mission Planner, INAV and maps are read as the path that the aircraft flies."""

import json
from math import cos, radians
from pathlib import Path
from typing import Any

import pytest

from flightpower.analysis.missions.mission import HOME, Assumed, Mission, Speed, parse_legs, parse_wind, with_return
from flightpower.analysis.missions.mission_files import load_mission
from flightpower.flight.errors import InputError

HOME_DEG = (48.1, 11.5)
NORTH_DEG = 1000.0 / (6_371_000.0 * radians(1.0))  # of one kilometer
EAST_DEG = NORTH_DEG / cos(radians(HOME_DEG[0]))


def item(
    command: int,
    *params: float,
    east_km: float | None = None,
    north_km: float = 0.0,
    height_m: float = 80.0,
    frame: int = 3,
) -> dict[str, Any]:
    """Return a simple item of a plan, at a place relative to home or without a place."""
    four = [*params, *[0.0] * (4 - len(params))]
    place = [0, 0] if east_km is None else [HOME_DEG[0] + north_km * NORTH_DEG, HOME_DEG[1] + east_km * EAST_DEG]
    return {"type": "SimpleItem", "command": command, "frame": frame, "params": [*four, *place, height_m]}


def plan_text(*items: dict[str, Any], **changed: Any) -> str:
    mission = {"items": items, "plannedHomePosition": [*HOME_DEG, 500.0], "cruiseSpeed": 15} | changed
    return json.dumps({"fileType": "Plan", "mission": mission})


def waypoints_text(*items: dict[str, Any], home: bool = True) -> str:
    rows: list[list[Any]] = [[0, 1, 0, 16, 0, 0, 0, 0, *(HOME_DEG if home else (0, 0)), 500, 1]]
    for number, item in enumerate(items, start=1):
        params = [0.0 if value is None else value for value in item["params"]]
        rows.append([number, 0, item["frame"], item["command"], *params, 1])
    return "\n".join(["QGC WPL 110", *("\t".join(str(x) for x in row) for row in rows)])


def read(tmp_path: Path, text: str, assumed: Assumed = Assumed()) -> Mission:
    path = tmp_path / "mission"
    path.write_text(text, "utf-8")
    return load_mission(path, assumed)


SQUARE = [
    item(22, 15, east_km=0.2),
    item(16, east_km=1.0),
    item(178, 0, 18, -1),
    item(16, east_km=1.0, north_km=1.0),
    item(206, 20),
    item(20),
    item(2501),
]


@pytest.mark.parametrize("write", [plan_text, waypoints_text])
def test_plan_and_waypoints_of_one_mission_are_the_same(tmp_path: Path, write: Any) -> None:
    mission = read(tmp_path, write(*SQUARE))
    takeoff, first, second, home = mission.steps
    assert takeoff.launched and takeoff.to.height_m == 80
    assert first.to == pytest.approx((1000, 0, 80), abs=0.5)
    assert second.to == pytest.approx((1000, 1000, 80), abs=0.5)
    assert home.to == HOME._replace(height_m=80)
    assert first.speed is None
    assert second.speed == home.speed == Speed(18.0)
    assert len(mission.notes) == 1  # on both camera commands


def test_circles_holds_drops_and_climbs_are_taken_over(tmp_path: Path) -> None:
    mission = read(
        tmp_path,
        plan_text(
            item(16, 12, east_km=1.0),
            item(18, 3, 0, -60, east_km=1.0),
            item(19, 90, 0, 0, east_km=1.0),
            item(31, height_m=150.0, east_km=1.0),
            item(94, height_m=150.0, east_km=1.5),
            item(178, 1, 12, -1),
            item(21, height_m=0.0, east_km=0.0),
        ),
        Assumed(dropped_kg=0.4),
    )
    hold, turns, time, climb, drop, land = mission.steps
    assert (hold.circle_s, turns.turns, turns.radius_m, time.circle_s, time.radius_m) == (12, 3, 60, 90, None)
    assert climb.to.height_m == 150 and drop.dropped_kg == 0.4
    assert land.speed == Speed(12.0, over_ground=True)
    assert land.to.height_m == 0


def test_a_speed_goes_back_to_the_default_and_stays_without_change(tmp_path: Path) -> None:
    changes = [item(178, 0, speed, -1) for speed in (18.0, -1.0, -2.0)]
    mission = read(tmp_path, plan_text(*(entry for change in changes for entry in (change, item(16, east_km=1.0)))))
    assert [step.speed for step in mission.steps[:3]] == [Speed(18.0), Speed(18.0), None]


def test_a_cruise_speed_of_qgroundcontrol_is_not_flown(tmp_path: Path) -> None:
    """QGroundControl writes one into every plan for its own time estimates, and never sends it to the vehicle."""
    fast = read(tmp_path, plan_text(item(16, east_km=1.0), cruiseSpeed=22))
    assert {step.speed for step in fast.steps} == {None} and "with 22 m/s, which the plan does not send" in fast.notes[
        0
    ]
    bare = read(tmp_path, plan_text(item(16, east_km=1.0), cruiseSpeed=0))
    assert bare.steps == fast.steps and len(bare.notes) == len(fast.notes) - 1


def test_a_plan_for_a_multicopter_is_named(tmp_path: Path) -> None:
    """Six of thirteen public plans are for one, with legs of a few meters. Fixed wings and VTOLs give no note."""
    for kind, expected in ((2, "quadrotor (vehicleType 2)"), (11, "boat"), (1, ""), (20, ""), (None, "")):
        notes = read(tmp_path, plan_text(item(16, east_km=1.0), cruiseSpeed=0, vehicleType=kind)).notes
        message = [note for note in notes if "vehicleType" in note]
        assert len(message) == bool(expected) and all(expected in note for note in message)


@pytest.mark.parametrize("command", [16, 22])
def test_heights_above_home_in_the_frame_of_the_sea_are_refused(command: int, tmp_path: Path) -> None:
    """100 m in frame 0 with home at 500 m is 400 m under the ground. 60 m below home can be a valley if it is given
    relative to home, or for a landing."""
    with pytest.raises(InputError, match=r"item 1 .*: 400 m below home; 100 m above sea level, and home at 500 m"):
        read(tmp_path, plan_text(item(command, frame=0, height_m=100.0, east_km=1.0)))
    with pytest.raises(InputError, match=r"60 m below home; 440 m"):
        read(tmp_path, plan_text(item(command, frame=5, height_m=440.0, east_km=1.0)))
    assert read(tmp_path, plan_text(item(16, height_m=-60.0, east_km=1.0))).steps[0].to.height_m == -60
    assert read(tmp_path, plan_text(item(21, frame=0, height_m=440.0, east_km=1.0))).steps[0].to.height_m == -60


@pytest.mark.parametrize(
    "text",
    [
        plan_text(item(22, height_m=-1.0, east_km=1.0)),
        plan_text(item(16, height_m=-301.0, east_km=1.0)),
        plan_text(item(21, frame=10, height_m=-301.0, east_km=1.0)),
    ],
)
def test_heights_where_no_ground_is_are_refused(text: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="m below home; check its height"):
        read(tmp_path, text)


def test_lines_and_legs_end_above_the_ground_too(tmp_path: Path) -> None:
    down = KML.format("<altitudeMode>absolute</altitudeMode>", 585, HOME_DEG[0] + NORTH_DEG, 100)
    with pytest.raises(InputError, match="385 m below home; check the heights of the line"):
        read(tmp_path, down)
    with pytest.raises(InputError, match=r"leg 2 .*: 301 m below home"):
        parse_legs("3 km 090, 3 km 270 -401 m", 100.0)


def test_heights_above_the_sea_are_less_homes(tmp_path: Path) -> None:
    assert read(tmp_path, plan_text(item(16, frame=0, height_m=600.0, east_km=0.01))).steps[0].to.height_m == 100


def test_a_jump_repeats_what_lies_between(tmp_path: Path) -> None:
    names = [
        step.name
        for step in read(
            tmp_path, plan_text(item(16, east_km=1.0), item(16, east_km=2.0), item(177, 1, 2), item(20))
        ).steps
    ]
    assert names == ["1 waypoint", "2 waypoint"] * 3 + ["4 return"]


@pytest.mark.parametrize("write", [plan_text, waypoints_text])
def test_a_jump_names_an_item_by_the_number_it_has(write: Any, tmp_path: Path) -> None:
    """QGroundControl also counts the items inside a survey, so its numbers have gaps; they may repeat as well."""
    items = [
        item(22, east_km=0.2) | {"doJumpId": 10},
        item(16, east_km=1.0) | {"doJumpId": 20},
        item(16, east_km=2.0) | {"doJumpId": 30},
        item(177, 20, 2) | {"doJumpId": 40},
        item(21, height_m=0.0, east_km=0.0) | {"doJumpId": 20},
    ]
    text = write(*items)
    if write is waypoints_text:
        text = "\n".join(line if line[0] in "Q0" else line[0] + "0" + line[1:] for line in text.split("\n"))
        text = text.replace("\n50\t", "\n20\t")
    flown = [step.to.east_m for step in read(tmp_path, text).steps]
    assert flown == pytest.approx([200, *[1000, 2000] * 3, 0], abs=0.5)


def test_a_jump_counts_over_the_whole_mission(tmp_path: Path) -> None:
    """An outer jump does not restart an inner one: neither ArduPilot nor PX4 resets its count."""
    flown = read(tmp_path, plan_text(item(16, east_km=1.0), item(16, east_km=2.0), item(177, 2, 2), item(177, 1, 1)))
    assert [step.name[0] for step in flown.steps[:-1]] == ["1", "2", "2", "2", "1", "2"]


def test_a_jump_to_a_tag_repeats_what_follows_the_tag(tmp_path: Path) -> None:
    """JUMP_TAG and DO_JUMP_TAG are commands of ArduPlane 4.4; a tag is a mark without a place, and costs no energy."""
    tagged = [
        item(22, 15, east_km=0.2, height_m=40.0),
        item(600, 7, frame=0, height_m=0.0),
        item(16, east_km=1.0),
        item(16, east_km=2.0),
        item(601, 7, 1, frame=0, height_m=0.0),
        item(21, height_m=0.0, east_km=0.0),
    ]
    mission = read(tmp_path, waypoints_text(*tagged))
    assert [step.name for step in mission.steps] == [
        "1 take-off", *["3 waypoint", "4 waypoint"] * 2, "6 landing",
    ]  # fmt: skip
    assert not mission.notes
    with pytest.raises(InputError, match="jumps to tag 8, which is not in the file; give one that is, or remove"):
        read(tmp_path, waypoints_text(*tagged).replace("601\t7", "601\t8"))
    with pytest.raises(InputError, match="jumps to tag 7 -1 times, which has no end; give a number up to 1000, or"):
        read(tmp_path, waypoints_text(*tagged[:4], item(601, 7, -1)))


LANDED = [item(22, 15, east_km=0.2), item(16, east_km=1.0), item(21, height_m=0.0, east_km=0.0)]
GO_AROUND = [item(16, east_km=-0.5), item(16, east_km=1.0), item(177, 2, -1)]
AGAIN = [item(22, 15, east_km=0.2), item(16, east_km=3.0), item(20)]


@pytest.mark.parametrize(
    ("after", "note"),
    [
        ([], None),
        ([item(206, 0), item(2501)], None),
        ([item(16, east_km=1.0)], "Item 4 follows the first landing or return: not flown here."),
        (GO_AROUND, "3 items follow the first landing or return, from 4 on: not flown here."),
        (
            AGAIN,
            "from 4 on: not flown here; for the flight after the second take-off save them as a mission of its own.",
        ),
    ],
)
def test_a_mission_is_flown_up_to_its_landing(tmp_path: Path, after: list[dict[str, Any]], note: str | None) -> None:
    """The items after it are for an aborted approach, whose jump back has no end, or for another flight."""
    mission = read(tmp_path, waypoints_text(*LANDED, *after))
    assert [step.name for step in mission.steps] == ["1 take-off", "2 waypoint", "3 landing"]
    assert len(mission.notes) == (note is not None) and all(message.endswith(note or "") for message in mission.notes)


@pytest.mark.parametrize("write", [plan_text, waypoints_text])
def test_zeros_are_here(write: Any, tmp_path: Path) -> None:
    """0, 0, 0 is the aircraft's own place and height; 0, 0 and a height is its place at that height."""
    mission = read(
        tmp_path,
        write(item(16, east_km=1.0, height_m=90.0), item(18, 2, height_m=0.0), item(19, 60, height_m=120.0),
              item(21, height_m=0.0)),
    )  # fmt: skip
    there, turns, hold, landing = (step.to for step in mission.steps)
    assert turns == there and hold == there._replace(height_m=120) and landing == there._replace(height_m=0)


def test_no_numbers_are_here_too(tmp_path: Path) -> None:
    nowhere: dict[str, Any] = {"params": [30, 0, 0, None, None, None, None]}
    there, hold, _ = read(tmp_path, plan_text(item(16, east_km=1.0, height_m=90.0), item(19) | nowhere)).steps
    assert hold.to == there.to and hold.circle_s == 30


def test_lines_of_waypoints_may_be_comments(tmp_path: Path) -> None:
    text = waypoints_text(*SQUARE)
    commented = "\n".join(f"{line}\n# of {number}\n" for number, line in enumerate(text.split("\n")))
    assert read(tmp_path, commented) == read(tmp_path, text)


def test_a_first_item_that_is_no_waypoint_is_no_home(tmp_path: Path) -> None:
    """Otherwise its height would count as home's height above the sea, and its take-off would be lost."""
    rows = waypoints_text(*SQUARE).split("\n")
    without = "\n".join([rows[0], *rows[2:]])
    with pytest.raises(InputError, match=r'give --home "48.1,11.5". Item 1 \(command 22\) is not the home'):
        read(tmp_path, without)
    mission = read(tmp_path, without, Assumed(home_deg=HOME_DEG))
    assert mission.steps == read(tmp_path, "\n".join(rows)).steps and "it is flown" in mission.notes[0]


def test_waypoints_without_home_by_their_format_are_all_flown(tmp_path: Path) -> None:
    rows = waypoints_text(*SQUARE).split("\n")
    old = "\n".join(["QGC WPL 120", *rows[2:]])
    assert read(tmp_path, old, Assumed(home_deg=HOME_DEG)) == read(tmp_path, "\n".join(rows))
    with pytest.raises(InputError, match="has no home position; give --home"):
        read(tmp_path, old)


def test_home_of_mission_planner_may_be_a_zero_and_one_in_another_frame_has_no_known_height(tmp_path: Path) -> None:
    text = waypoints_text(item(16, frame=0, height_m=600.0, east_km=1.0))
    assert read(tmp_path, text.replace("\t0\t16\t", "\t0\t0\t", 1)).steps[0].to.height_m == 100
    with pytest.raises(InputError, match="home's is not known; give --elevation of home, or save"):
        read(tmp_path, text.replace("\t0\t16\t", "\t3\t16\t", 1))


def test_home_may_have_no_known_height_and_no_known_place(tmp_path: Path) -> None:
    """Home's height is needed only for heights above the sea. --elevation gives it; a 0 in the file is doubted."""
    unknown = {"plannedHomePosition": [*HOME_DEG, None]}
    assert read(tmp_path, plan_text(item(16, east_km=1.0), **unknown)).steps[0].to.height_m == 80
    high = item(16, frame=0, height_m=600.0, east_km=1.0)
    with pytest.raises(InputError, match="home's is not known; give --elevation"):
        read(tmp_path, plan_text(high, **unknown))
    assumed = Assumed(elevation_m=450.0)
    assert read(tmp_path, plan_text(high, **unknown), assumed).steps[0].to.height_m == 150
    zero = {"plannedHomePosition": [*HOME_DEG, 0]}
    assert read(tmp_path, plan_text(high, **zero), assumed).steps[0].to.height_m == 150
    assert any("home at 0 m" in note for note in read(tmp_path, plan_text(high, **zero)).notes)
    assert read(tmp_path, plan_text(high), assumed).steps[0].to.height_m == 100, "the file's own height counts"
    for nowhere in ([None, None, None], [0, 0, 0], []):
        with pytest.raises(InputError, match="has no home position"):
            read(tmp_path, plan_text(high, plannedHomePosition=nowhere))


@pytest.mark.parametrize("home", [[1e999, 11.5, 500.0], [48.1, 1e999, 500.0], [48.1, 11.5, 1e999], [91.0, 11.5, 0.0]])
def test_home_at_no_place_is_refused(home: list[float], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not a place on Earth; give --home"):
        read(tmp_path, plan_text(item(16, east_km=1.0), plannedHomePosition=home))


def test_a_survey_without_transects_is_refused_with_what_to_do(tmp_path: Path) -> None:
    old = {"type": "ComplexItem", "complexItemType": "survey", "version": 3, "grid": {"altitude": 50}}
    for entry in (old, {"type": "survey", "version": 1}):
        with pytest.raises(InputError, match=r"before 3.4 has no transects in the file; open it in QGroundControl"):
            read(tmp_path, plan_text(item(22, east_km=0.2), entry))


def test_an_old_landing_says_of_each_height_what_it_is_above(tmp_path: Path) -> None:
    landing = {
        "type": "ComplexItem",
        "complexItemType": "fwLandingPattern",
        "version": 1,
        "loiterCoordinate": [HOME_DEG[0], HOME_DEG[1] + 0.4 * EAST_DEG, 540.0],
        "loiterAltitudeRelative": False,
        "landCoordinate": [*HOME_DEG, 5.0],
        "landAltitudeRelative": True,
    }
    circles, land = read(tmp_path, plan_text(landing)).steps
    assert (circles.to.height_m, land.to.height_m) == (40, 5) and circles.name.endswith("climb")


def test_a_mission_file_before_plans_is_read(tmp_path: Path) -> None:
    """Version 1 of QGroundControl has four parameters in an item, and a separate key for the place."""
    plan = plan_text(item(22, 15, east_km=0.2), item(18, 3, 0, -60, east_km=1.0), item(20))
    items = [
        {"type": "missionItem", "command": item["command"], "frame": item["frame"], "coordinate": item["params"][4:]}
        | {f"param{i}": value for i, value in enumerate(item["params"][:4], start=1)}
        for item in json.loads(plan)["mission"]["items"]
    ]
    home = {"type": "missionItem", "command": 16, "coordinate": [*HOME_DEG, 500.0]}
    old = json.dumps({"MAV_AUTOPILOT": 3, "items": items, "complexItems": [], "plannedHomePosition": home})
    assert read(tmp_path, old).steps == read(tmp_path, plan).steps
    assert len(read(tmp_path, old).steps) == 3


def inav_text(*items: str, home: str = f'home-x="{HOME_DEG[1]}" home-y="{HOME_DEG[0]}"') -> str:
    """Return a mission of INAV; an item is its action, latitude, longitude, height and parameters."""
    rows = []
    for number, item in enumerate(items, start=1):
        action, latitude, longitude, height_m, *params = item.split()
        message = " ".join(f'parameter{i}="{value}"' for i, value in enumerate(params, start=1))
        place = f'lat="{latitude}" lon="{longitude}" alt="{height_m}"'
        rows.append(f'<missionitem no="{number}" action="{action}" {place} {message} flag="0"/>')
    return f'<?xml version="1.0" encoding="utf-8"?>\n<mission><mwp zoom="14" {home}/>{"".join(rows)}</mission>'


EAST = f"{HOME_DEG[0]} {HOME_DEG[1] + EAST_DEG}"
FAR = f"{HOME_DEG[0]} {HOME_DEG[1] + 2 * EAST_DEG}"


def test_a_mission_of_inav_is_what_the_same_of_mavlink_is(tmp_path: Path) -> None:
    """Leg speeds are for multicopters and ignored; a jump names a number; a flag marks a height above the sea."""
    inav = read(
        tmp_path,
        inav_text(f"WAYPOINT {EAST} 80 1500 0 0", f"POSHOLD_TIME {FAR} 90 45 0 0", "JUMP 0 0 0 1 2 0",
                  "SET_HEAD 0 0 0 90 0 0", "RTH 0 0 0 1 0 0"),
    )  # fmt: skip
    mavlink = read(
        tmp_path,
        plan_text(item(16, east_km=1.0), item(19, 45, east_km=2.0, height_m=90.0), item(177, 1, 2), item(115, 90),
                  item(20), cruiseSpeed=0),
    )  # fmt: skip
    assert inav.notes == mavlink.notes and [step.name for step in inav.steps] == [step.name for step in mavlink.steps]
    for step, other in zip(inav.steps, mavlink.steps, strict=True):
        assert step.to == pytest.approx(other.to, abs=0.01) and step.circle_s == other.circle_s and step.speed is None
    high = inav_text(f"WAYPOINT {EAST} 600 0 0 1")
    assert read(tmp_path, high, Assumed(elevation_m=500.0)).steps[0].to.height_m == 100


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (inav_text(f"POSHOLD_UNLIM {EAST} 80"), "circles without end; give a time"),
        (inav_text(f"HOVER {EAST} 80"), "item 1 of INAV is not understood"),
        (inav_text(f"WAYPOINT {EAST} x"), "item 1 of INAV is not understood"),
        (inav_text(f"WAYPOINT {EAST} 600 0 0 1"), "give --elevation of home"),
        (inav_text(f"WAYPOINT {EAST} 80", home=""), "has no home position; give --home"),
        (inav_text(f"WAYPOINT {EAST} 80", home='home-x="0" home-y="0"'), "has no home position; give --home"),
        (
            inav_text("RTH 0 0 0").replace("</mission>", '<missionitem no="1" action="RTH"/></mission>'),
            "several",
        ),
    ],
)
def test_a_mission_of_inav_that_is_wrong_is_one_line(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message) as refused:
        read(tmp_path, text)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("command", "ways"),
    [
        (17, "LOITER_UNLIM, circles without end; give a time .19. or a number of turns .18."),
        (30, "CONTINUE_AND_CHANGE_ALT, ends at a height, not at a place; give a waypoint .16. or circles .31."),
        (32, "DO_FOLLOW, is a path whose energy is not known; replace it with waypoints .16., or remove it"),
        (84, "VTOL_TAKEOFF, flies vertically, and its power is not known; use 22 and 21 .*, or remove it"),
        (179, "DO_SET_HOME, moves home, .*; save two missions, or remove it"),
        (208, "DO_PARACHUTE, ends the flight; end the mission before it, or by a landing"),
        (210, "DO_INVERTED_FLIGHT, is not understood; remove it if it moves nothing, otherwise use"),
        (4711, r"command 4711\) is not understood"),
    ],
)
def test_an_item_that_is_not_understood_is_named_with_two_ways_on(command: int, ways: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=ways):
        read(tmp_path, plan_text(item(16, east_km=1.0), item(command)))


def test_a_survey_is_its_transects_and_a_landing_pattern_its_approach(tmp_path: Path) -> None:
    survey = {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "TransectStyleComplexItem": {
            "Items": [item(16, east_km=1.0), item(206, 25), item(16, east_km=1.0, north_km=1.0)]
        },
    }
    landing = {
        "type": "ComplexItem",
        "complexItemType": "fwLandingPattern",
        "landingApproachCoordinate": [HOME_DEG[0], HOME_DEG[1] + 0.4 * EAST_DEG, 40.0],
        "landCoordinate": [*HOME_DEG, 0.0],
    }
    steps = read(tmp_path, plan_text(survey, landing)).steps
    assert [step.to.height_m for step in steps] == [80, 80, 40, 0]
    assert steps[2].to.east_m == pytest.approx(400, abs=0.5)


KML = """<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><LineString>{}
<coordinates>11.5,48.1,{} 11.5,{},{} </coordinates></LineString></Placemark></Document></kml>"""


def test_a_line_of_a_map_ends_at_home(tmp_path: Path) -> None:
    north = HOME_DEG[0] + 2 * NORTH_DEG
    there, back = read(tmp_path, KML.format("", 0, north, 0)).steps
    assert there.to == pytest.approx((0, 2000, 100), abs=0.5)
    assert back.to.distance_m(HOME) == 0
    relative = KML.format("<altitudeMode>relativeToGround</altitudeMode>", 60, north, 90)
    assert [step.to.height_m for step in read(tmp_path, relative).steps] == [90, 90]
    absolute = KML.format("<altitudeMode>absolute</altitudeMode>", 560, north, 590)
    assert [step.to.height_m for step in read(tmp_path, absolute, Assumed(height_m=50)).steps] == [80, 80]


def test_a_line_above_the_sea_begins_where_home_is_told_to_be(tmp_path: Path) -> None:
    north = HOME_DEG[0] + 2 * NORTH_DEG
    absolute = KML.format("<altitudeMode>absolute</altitudeMode>", 560, north, 590)
    guessed, message = read(tmp_path, absolute), read(tmp_path, absolute, Assumed(elevation_m=500.0))
    assert guessed.steps[0].to.height_m == 130 and "first point is taken 100 m above home" in guessed.notes[0]
    assert message.steps[0].to.height_m == 90 and len(message.notes) == len(guessed.notes) - 1


def test_the_flight_path_of_qgroundcontrol_begins_at_home_on_the_ground(tmp_path: Path) -> None:
    """Its heights are above the sea, and its first point is home, from which the aircraft takes off."""
    line = KML.format("<altitudeMode>absolute</altitudeMode>", 500, HOME_DEG[0] + 2 * NORTH_DEG, 580)
    path = line.replace("<Placemark>", "<Placemark><name>Flight Path</name>")
    mission = read(tmp_path, path)
    assert mission.start.height_m == 0 and mission.steps[0].to.height_m == 80 and mission.steps[0].launched
    assert not read(tmp_path, line).steps[0].launched


def test_another_home_moves_the_mission(tmp_path: Path) -> None:
    moved = Assumed(home_deg=(HOME_DEG[0], HOME_DEG[1] + EAST_DEG))
    assert read(tmp_path, plan_text(item(16, east_km=3.0)), moved).steps[0].to.east_m == pytest.approx(2000, abs=0.5)


def test_legs_and_wind_are_what_their_texts_say() -> None:
    first, second = parse_legs("3 km 090 at 17 m/s, 2000 m 180 +50 m, drop 500 g", 100.0).steps
    assert first.to == pytest.approx((3000, 0, 100)) and first.speed == Speed(17.0)
    assert second.to == pytest.approx((3000, -2000, 150)) and second.dropped_kg == pytest.approx(0.5)
    wind = parse_wind("10 kt from 270 deg", 1.0)
    assert (wind.east_mps, wind.north_mps) == pytest.approx((10 * 1852 / 3600, 0.0), abs=1e-9)
    assert parse_wind("0 m/s", 1.0).mps == 0


def test_a_leg_in_another_unit_of_length_is_refused() -> None:
    assert len(parse_legs("20000 km 045", 100.0).steps) == 1
    with pytest.raises(InputError, match=r"no two places are 9\.26e\+13 km apart; check its length"):
        parse_legs("3 parsec 045", 100.0)


def test_only_a_mission_that_ends_away_from_home_is_continued() -> None:
    away = with_return(parse_legs("3 km 090", 100.0), ends_by_landing=False)
    assert len(away.steps) == 2 and len(away.notes) == 1
    assert len(with_return(parse_legs("3 km 090", 100.0), ends_by_landing=True).steps) == 1
    assert len(with_return(parse_legs("3 km 090, 3 km 270", 100.0), ends_by_landing=False).steps) == 2
