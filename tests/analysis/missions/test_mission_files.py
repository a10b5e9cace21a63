"""Missions of QGroundControl, Mission Planner and maps, read as what they make an aircraft fly."""

import json
from math import cos, radians
from pathlib import Path
from typing import Any

import pytest

from analysis.missions.mission import HOME, Mission, Speed, parse_legs, parse_wind, with_return
from analysis.missions.mission_files import Assumed, load_mission
from flight.errors import InputError

HOME_DEG = (48.1, 11.5)
NORTH_DEG = 1000.0 / (6_371_000.0 * radians(1.0))  # a kilometer
EAST_DEG = NORTH_DEG / cos(radians(HOME_DEG[0]))


def item(
    command: int,
    *params: float,
    east_km: float | None = None,
    north_km: float = 0.0,
    height_m: float = 80.0,
    frame: int = 3,
) -> dict[str, Any]:
    """A simple item of a plan, at a place from home or without one."""
    four = [*params, *[0.0] * (4 - len(params))]
    place = [0, 0] if east_km is None else [HOME_DEG[0] + north_km * NORTH_DEG, HOME_DEG[1] + east_km * EAST_DEG]
    return {"type": "SimpleItem", "command": command, "frame": frame, "params": [*four, *place, height_m]}


def plan_text(*items: dict[str, Any], **changed: Any) -> str:
    mission = {"items": items, "plannedHomePosition": [*HOME_DEG, 500.0], "cruiseSpeed": 15} | changed
    return json.dumps({"fileType": "Plan", "mission": mission})


def waypoints_text(*items: dict[str, Any], home: bool = True) -> str:
    rows: list[list[Any]] = [[0, 1, 0, 16, 0, 0, 0, 0, *(HOME_DEG if home else (0, 0)), 500, 1]]
    for number, one in enumerate(items, start=1):
        params = [0.0 if value is None else value for value in one["params"]]
        rows.append([number, 0, one["frame"], one["command"], *params, 1])
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
    assert len(mission.notes) == 1  # the camera's trigger, and the end of its video after landing


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
    mission = read(tmp_path, plan_text(*(one for change in changes for one in (change, item(16, east_km=1.0)))))
    assert [step.speed for step in mission.steps[:3]] == [Speed(18.0), Speed(18.0), None]


def test_a_cruise_speed_of_qgroundcontrol_is_not_flown(tmp_path: Path) -> None:
    """It writes one into every plan for times of its own; the vehicle never gets it."""
    fast = read(tmp_path, plan_text(item(16, east_km=1.0), cruiseSpeed=22))
    assert {step.speed for step in fast.steps} == {None} and "with 22 m/s, which no vehicle gets" in fast.notes[0]
    bare = read(tmp_path, plan_text(item(16, east_km=1.0), cruiseSpeed=0))
    assert bare.steps == fast.steps and len(bare.notes) == len(fast.notes) - 1


@pytest.mark.parametrize("command", [16, 22])
def test_heights_above_home_in_the_frame_of_the_sea_are_refused(command: int, tmp_path: Path) -> None:
    """100 m in frame 0 at a home 500 m high lie 400 m under the ground; 60 m below home a valley may be, if told so."""
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


def test_only_a_mission_that_ends_away_from_home_is_continued() -> None:
    away = with_return(parse_legs("3 km 090", 100.0), ends_by_landing=False)
    assert len(away.steps) == 2 and len(away.notes) == 1
    assert len(with_return(parse_legs("3 km 090", 100.0), ends_by_landing=True).steps) == 1
    assert len(with_return(parse_legs("3 km 090, 3 km 270", 100.0), ends_by_landing=False).steps) == 2
