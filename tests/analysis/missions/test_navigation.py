"""The path of a plan over the ground stays near the place from which it is watched, in any wind."""

import numpy as np
import pytest

from flightpower.analysis.missions.expected_aircraft import ExpectedAircraft, expected_aircraft
from flightpower.analysis.missions.navigation import kept_in_place
from flightpower.analysis.missions.pieces import Hold, Land, Maneuver, Piece, Pilot, Run, Space, Turn, catalog, sequence
from flightpower.analysis.missions.plan_settings import PATH
from flightpower.analysis.missions.time_history import fly
from flightpower.flight.aircraft import load_aircraft

HEIGHT_M, LEG_M = 40.0, 500.0


@pytest.fixture(scope="module")
def nexstar() -> ExpectedAircraft:
    return expected_aircraft(load_aircraft("nexstar"), HEIGHT_M)


@pytest.fixture(scope="module")
def pieces_flown(nexstar: ExpectedAircraft) -> list[Piece]:
    """Return all pieces of the catalog, in sequence."""
    return catalog(nexstar, Space(LEG_M, HEIGHT_M), Pilot(autopilot=False, load=0.8), 5.0)


def farthest_m(maneuvers: list[Maneuver], aircraft: ExpectedAircraft, wind_mps: float) -> float:
    return float(np.hypot(*fly(maneuvers, aircraft, HEIGHT_M, wind_mps).position_m.T).max())


@pytest.mark.parametrize("wind_mps", [0.0, 4.0, 8.0])
def test_a_flight_stays_in_sight_in_any_wind(nexstar, pieces_flown: list[Piece], wind_mps: float) -> None:
    """It stays within a leg of the take-off; in strong wind within 1.5, since downwind runs cannot be shortened.
    Without the correction, it would go more than 1.5 km away."""
    plan = sequence(pieces_flown, nexstar)
    corrected = kept_in_place(plan, nexstar, Space(LEG_M, HEIGHT_M), wind_mps)
    assert farthest_m(corrected, nexstar, wind_mps) < (1.1 if wind_mps < 5 else 1.5) * LEG_M
    assert farthest_m(plan, nexstar, wind_mps) > 1500.0
    assert [type(maneuver) for maneuver in corrected] == [type(maneuver) for maneuver in plan]


def test_legs_end_at_the_same_two_places_and_take_longer_against_the_wind(nexstar: ExpectedAircraft) -> None:
    turn = Turn(18.0)
    plan = sequence([Piece("", 2 * (Hold(25.0, 18.0), turn), None)] * 4, nexstar)  # type: ignore[arg-type]
    wind_mps = 6.0
    corrected = kept_in_place(plan, nexstar, Space(LEG_M, HEIGHT_M), wind_mps)
    history = fly(corrected, nexstar, HEIGHT_M, wind_mps)
    index = np.rint(history.starts_s / 0.04).astype(int)[:-1]
    x, y = history.position_m.T
    legs = [i for i, maneuver in enumerate(corrected) if isinstance(maneuver, Hold)][
        3:-1
    ]  # without the first ones and the one before landing
    ends = np.array([index[i + 1] for i in legs])
    assert np.ptp(y[ends]) < 60.0, "with crab angles, all must end on one line"
    seconds = {}
    for into_the_wind in (True, False):
        these = [k for k, i in enumerate(legs) if (x[index[i + 1]] > x[index[i]]) == into_the_wind]
        assert np.ptp(x[ends[these]]) < 60.0
        seconds[into_the_wind] = [corrected[legs[k]].duration_s for k in these]
    assert min(seconds[True]) > 1.5 * max(seconds[False])


@pytest.mark.parametrize("pairs", [2, 3])
def test_the_landing_is_into_the_wind(nexstar: ExpectedAircraft, pieces_flown: list[Piece], pairs: int) -> None:
    """This also holds after turns that would end downwind: the last turn then becomes a circle."""
    plan = sequence([*pieces_flown[:1] * 2, *pieces_flown[-1:] * pairs], nexstar)
    corrected = kept_in_place(plan, nexstar, Space(LEG_M, HEIGHT_M), 4.0)
    history = fly(corrected, nexstar, HEIGHT_M, 4.0)
    touching = int(history.starts_s[-2] / 0.04) - 25
    assert np.cos(history.attitude[touching, 2] - np.radians(PATH.wind_from_deg)) > 0.3


@pytest.mark.parametrize("wind_from_deg", [20.0, 80.0, -80.0])
def test_a_wind_from_elsewhere_keeps_the_flight_in_sight(
    nexstar, pieces_flown: list[Piece], wind_from_deg: float
) -> None:
    """If the wind is not from the direction that was assumed, the flight drifts more than two legs away."""
    plan = sequence(pieces_flown, nexstar, wind_from_deg)
    corrected = kept_in_place(plan, nexstar, Space(LEG_M, HEIGHT_M), 4.0, wind_from_deg)

    def reached_m(from_deg: float) -> float:
        position_m = fly(corrected, nexstar, HEIGHT_M, 4.0, wind_from_deg=from_deg).position_m
        return float(np.hypot(*position_m.T).max())

    assert reached_m(wind_from_deg) < 1.15 * LEG_M
    assert reached_m(wind_from_deg + 120) > 2 * LEG_M


def test_without_a_turn_nothing_changes_and_no_wind_makes_a_plan_endless(nexstar: ExpectedAircraft) -> None:
    straight: list[Maneuver] = [Hold(10.0, 15.0), Run(0.87, 8.0, 20.0), Land(16.0)]
    assert kept_in_place(straight, nexstar, Space(LEG_M, HEIGHT_M), 8.0) == straight
    plan = sequence([Piece("", (Hold(20.0, 12.0), Turn(15.0)), None)] * 6, nexstar)  # type: ignore[arg-type]
    corrected = kept_in_place(plan, nexstar, Space(LEG_M, HEIGHT_M), 20.0)
    assert max(maneuver.duration_s for maneuver in corrected if isinstance(maneuver, Hold)) <= 20.0 + 120.0
