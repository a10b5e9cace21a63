"""The card warns of problems that cannot be fixed in the field, and has blanks and check boxes to use there."""

import tomllib
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.missions import card
from flightpower.analysis.missions.expected_aircraft import ExpectedAircraft, expected_aircraft
from flightpower.analysis.missions.pieces import Pilot, Run, Space
from flightpower.analysis.missions.plan_settings import PATH
from flightpower.analysis.missions.search import Request
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.propeller import Propeller


@pytest.fixture(scope="module")
def nexstar() -> ExpectedAircraft:
    return expected_aircraft(load_aircraft("nexstar"), 40.0)


def plan(aircraft: ExpectedAircraft, *, minutes: float = 10.0, height_m: float = 40.0) -> Any:
    """Return a level plan at 16 m/s, on a circle of radius 200 m around a point 200 m east of the take-off."""
    n, V = round(minutes * 60 / PATH.step_s), 16.0
    drag_N = float(aircraft.drag_N(V))
    table = pd.DataFrame({
        "height_m": height_m, "V_mps": V, "thrust_N": drag_N,
        "n_revps": aircraft.revps_of_thrust(np.array([V]), np.array([drag_N]))[0],
    }, index=np.arange(n) * PATH.step_s)  # fmt: skip
    angle = np.linspace(0.0, 2 * np.pi, n)
    position = 200 * np.column_stack([np.sin(angle), 1 - np.cos(angle)])
    request = Request(minutes, 8.0, Space(500.0, height_m), Pilot(autopilot=False, load=1.0))
    history = SimpleNamespace(table=table, position_m=position, starts_s=np.array([0.0, n * PATH.step_s]))
    maneuvers, question = (Run(0.5, 1.0, V),), SimpleNamespace(speeds=np.array([V, 2 * V]))
    return SimpleNamespace(history=history, aircraft=aircraft, request=request, maneuvers=maneuvers, question=question)


def test_a_flight_inside_table_battery_and_height_has_no_warning(nexstar: ExpectedAircraft) -> None:
    assert card.warnings(plan(nexstar)) == []


def test_a_table_that_ends_below_the_revolutions_flown_is_warned_of(nexstar: ExpectedAircraft) -> None:
    propeller = nexstar.propeller
    slow = Propeller(propeller.name, propeller.diameter_m, propeller.rows[:1])
    (warning,) = card.warnings(plan(replace(nexstar, propeller=slow)))
    assert f"{propeller.rows[0].rpm:.0f} rpm" in warning


def test_a_battery_that_is_empty_before_the_landing_is_warned_of(nexstar: ExpectedAircraft) -> None:
    """Energy is drag times distance over an efficiency of a half to two thirds, in proportion to the time."""
    needed = [card.energy_Wh(plan(nexstar, minutes=minutes)) for minutes in (10.0, 1.0)]
    work_Wh = float(nexstar.drag_N(16.0)) * 16.0 / 6
    assert 1.4 * work_Wh < needed[0] < 2.2 * work_Wh and needed[1] == pytest.approx(needed[0] / 10, rel=1e-3)
    battery_Wh = nexstar.aircraft.propulsion.battery_energy_Wh
    assert battery_Wh is not None
    minutes = 10 * 0.8 * battery_Wh / needed[0]
    assert card.warnings(plan(nexstar, minutes=0.98 * minutes)) == []
    assert len(card.warnings(plan(nexstar, minutes=1.02 * minutes))) == 1


def test_a_flight_above_the_limit_of_height_is_warned_of(nexstar: ExpectedAircraft) -> None:
    assert card.warnings(plan(nexstar, height_m=120.0)) == [] and len(card.warnings(plan(nexstar, height_m=125.0))) == 1


def test_a_wind_that_the_flight_hardly_advances_against_is_warned_of(nexstar: ExpectedAircraft) -> None:
    slow = replace(nexstar, stall_mps=plan(nexstar).request.wind_mps / 0.72 / 1.6)  # cruise is 1.6 times the stall
    (warning,) = card.warnings(plan(slow))
    assert f"the speed between maneuvers {slow.cruise_mps:.1f} m/s" in warning


def test_without_a_heading_there_is_no_map_and_without_a_direction_no_wind_in_it(nexstar: ExpectedAircraft) -> None:
    def map_of(**changes: float) -> str:
        planned = plan(nexstar)
        planned.request = replace(planned.request, **changes)
        return card._map(planned)

    assert map_of() == "" == map_of(wind_from_deg=270.0)
    assert "N</text>" in map_of(heading_deg=0.0) and "kt" not in map_of(heading_deg=0.0)
    assert "rotate(270)" in map_of(heading_deg=0.0, wind_from_deg=270.0)


@pytest.mark.parametrize(("heading_deg", "axis", "side"), [(0.0, 0, 1), (90.0, 1, 1), (180.0, 0, -1), (270.0, 1, -1)])
def test_the_map_has_north_up(nexstar: ExpectedAircraft, heading_deg: float, axis: int, side: int) -> None:
    """A circle to the right of the first leg lies east of the take-off if that leg points north, and south of it if the
    leg points east. In the map, y points down."""
    flown = plan(nexstar)
    flown.request = replace(flown.request, heading_deg=heading_deg)
    pairs = card._map(flown).split('points="')[1].split('"')[0].split()
    points = np.array([[float(x) for x in pair.split(",")] for pair in pairs])
    assert card.farthest_m(flown) == pytest.approx(400.0, rel=1e-3)
    assert points[0] == pytest.approx([50.0, 50.0]) and points.min() > 0 and points.max() < 100
    reached = side * (points[:, axis] - 50)
    assert reached.max() == pytest.approx(50 / 1.15, abs=0.1) and reached.min() > -0.1


def test_headings_and_wind_are_reported_as_they_were_given(nexstar: ExpectedAircraft) -> None:
    flown = plan(nexstar)
    assert card._headings(flown) == "" and "50° left of the first leg" in card._air(flown)
    flown.request = replace(flown.request, heading_deg=250.0, wind_from_deg=200.0)
    assert card._headings(flown) == " 250 (first) and 070,"
    assert card._air(flown).startswith("Wind 8 kt from 200. ")
    flown.request = replace(flown.request, wind_kt=0.0)
    assert card._air(flown) == "In still air."


def test_there_is_a_box_to_tick_for_each_time() -> None:
    assert card._boxes("3 ×").count("☐") == 3 and card._boxes("") == "☐"


def test_a_run_that_is_planned_twice_is_ticked_off_twice() -> None:
    """The runs go from rest to 20 m/s, down to 12, up again, and down to 12 once more."""
    runs = tuple(Run(0.5, 1.0, until_mps) for until_mps in (20.0, 12.0, 20.0, 12.0))
    listed = tomllib.loads(card.runs_to_tick_off(SimpleNamespace(maneuvers=runs)))["run"]  # type: ignore[arg-type]
    assert [(run["kind"], run["from_mps"], run["to_mps"], run["times"]) for run in listed] == [
        ("acceleration", 0.0, 20.0, 1),
        ("deceleration", 20.0, 12.0, 2),
        ("acceleration", 12.0, 20.0, 1),
    ]
