"""Plans: information as the estimator states it, files that can be flown, a margin above the stall."""

import json
import re
from dataclasses import fields, replace
from math import pi, tan
from types import SimpleNamespace

import numpy as np
import pytest
from pymavlink import mavutil, mavwp

from analysis.drag.polar import Polar
from analysis.planning import earlier, pieces, search
from analysis.planning.expected_aircraft import ExpectedAircraft, expected_aircraft
from analysis.planning.information import expected, linearized_trajectory, sensor_error_covariance
from analysis.planning.maneuvers import Hold, Land, Porpoise, Run, Stand, TakeOff, Turn
from analysis.planning.mission import Home, left_out, qgroundcontrol_plan, waypoint_file
from analysis.planning.next_flight import next_flight
from analysis.planning.pieces import Pilot, Space
from analysis.planning.questions import condition, question
from analysis.planning.search import FlightPlan, Request, plan_flight
from analysis.planning.simulator_plan import simulator_plan
from analysis.planning.time_history import STEP_S, TimeHistory, fly
from analysis.trajectory.equations import SENSOR_ERRORS
from analysis.trajectory.reconstruction import reconstruct
from flight.aircraft import Uncertainty, load_aircraft
from flight.errors import InputError
from flight.units import GRAVITY_MPS2
from sim.plan import parse_plan

HEIGHT_M = 40.0


@pytest.fixture(scope="module")
def nexstar() -> ExpectedAircraft:
    return expected_aircraft(load_aircraft("nexstar"), HEIGHT_M)


@pytest.fixture(scope="module")
def plan(nexstar: ExpectedAircraft) -> FlightPlan:
    """A plan of 9 minutes from a small catalogue, with a leg too short for an acceleration and a deceleration."""
    few = pieces.catalogue

    def small(*arguments: object) -> list[pieces.Piece]:
        everything = few(*arguments)  # type: ignore[arg-type]
        kinds = ("runs", "circuit", "circles", "porpoise")
        return [next(piece for piece in everything[::-1] if piece.kind == kind) for kind in kinds]

    search.catalogue = small  # type: ignore[assignment]
    try:
        return plan_flight(nexstar, Request(9.0, 10.0, Space(500.0, HEIGHT_M), Pilot(autopilot=False, load=0.8)))
    finally:
        search.catalogue = few


def test_a_level_turn_turns_by_the_bank_and_keeps_its_height(nexstar: ExpectedAircraft):
    history = fly([Hold(5.0, 18.0), Turn(18.0, 4 * pi, 0.6), Hold(5.0, 18.0)], nexstar, HEIGHT_M, 0.0, begins="air")
    middle = history.table.loc[12.0:20.0]
    rate = np.hypot(middle["q_radps"], middle["r_radps"])
    assert np.allclose(rate, GRAVITY_MPS2 * tan(0.6) / 18.0, rtol=0.01)
    assert np.allclose(middle["az_mps2"], -GRAVITY_MPS2 / np.cos(0.6), rtol=0.03)
    assert np.ptp(history.table["height_m"]) < 1.0
    assert history.attitude[-1, 2] == pytest.approx(4 * pi, abs=0.1)


def test_porpoising_swings_the_load_factor_and_not_the_speed(nexstar: ExpectedAircraft):
    history = fly([Hold(4.0, 17.0), Porpoise(20.0, 17.0, 0.8)], nexstar, HEIGHT_M, 0.0, begins="air")
    middle = history.table.loc[8.0:20.0]
    load = -middle["az_mps2"] / GRAVITY_MPS2
    assert (load.max(), load.min()) == pytest.approx((1.8, 0.2), abs=0.1)
    assert np.ptp(middle["V_mps"]) < 0.1
    assert np.ptp(middle["height_m"]) < 3.0
    pitch_rate = np.gradient(history.attitude[:, 1], STEP_S)[200:500]
    assert np.ptp(pitch_rate) > 0.5
    assert np.allclose(history.table["q_radps"].to_numpy()[200:500], pitch_rate, atol=1e-6)


def test_the_information_is_that_of_the_estimator(nexstar: ExpectedAircraft):
    """The estimator, given the history as a flight, states the same standard errors."""
    V = nexstar.stall_mps
    flown = [
        Stand(20.0),
        TakeOff(1.6 * V),
        Porpoise(20.0, 1.7 * V, 0.8),
        Turn(1.7 * V),
        Hold(30.0, 2 * V),
        Land(1.6 * V),
    ]
    history = fly(flown, nexstar, HEIGHT_M, 2.0)
    gust_length = nexstar.aircraft.uncertainty.gust_length
    trajectory = reconstruct(history.table, history.rest, alpha_scale_sigma=0.01, gust_length=gust_length)
    covariance = sensor_error_covariance(history, nexstar, trajectory.gust_mps, alpha_scale_sigma=0.01)
    for name in ("alpha_bias", "alpha_scale", "V_scale", "ax_bias"):
        i = SENSOR_ERRORS.index(name)
        assert np.sqrt(covariance[i, i]) == pytest.approx(trajectory.standard_error(name), rel=0.05), name


@pytest.fixture(scope="module")
def pair(nexstar: ExpectedAircraft) -> TimeHistory:
    """One acceleration and one deceleration."""
    V = nexstar.stall_mps
    flown = [Hold(8.0, 1.15 * V), Run(1.0, 1.0, 2.2 * V), Hold(3.0, 2.2 * V), Run(0.3, 1.0, 1.15 * V)]
    return fly([*flown, Hold(4.0, 1.15 * V)], nexstar, HEIGHT_M, 0.0, begins="air")


def variance_of_drag(history: TimeHistory, aircraft: ExpectedAircraft) -> float:
    at = np.array([1.0, 0.9, 0.81])  # one lift coefficient
    return float(at @ expected(history, aircraft, 0.0125, alpha_scale_sigma=0.01).total @ at)


@pytest.fixture(scope="module")
def stated_variance(nexstar: ExpectedAircraft, pair: TimeHistory) -> float:
    return variance_of_drag(pair, nexstar)


@pytest.mark.parametrize("key", [one.name for one in fields(Uncertainty) if not one.name.startswith(("gust", "hyst"))])
def test_every_error_that_the_aircraft_file_states_is_in_a_plans_interval(nexstar, pair, stated_variance, key: str):
    """Stated five times as large, it widens the interval. Plans are without hysteresis, and calm air without gusts."""
    stated = nexstar.aircraft.uncertainty
    larger = replace(nexstar.aircraft, uncertainty=replace(stated, **{key: 5 * getattr(stated, key)}))
    assert variance_of_drag(pair, replace(nexstar, aircraft=larger)) > 1.0001 * stated_variance


def test_a_plan_uses_its_time_and_keeps_off_the_stall(plan: FlightPlan):
    stall = plan.aircraft.stall_mps
    assert 8 * 60 < plan.seconds <= 9 * 60
    slowest = min(piece.until_mps for piece in plan.maneuvers if isinstance(piece, Run))
    assert slowest / stall == pytest.approx(1.08 + 0.002 * 10)
    for maneuver in plan.maneuvers:
        match maneuver:
            case Hold(_, speed_mps):
                assert speed_mps >= 1.12 * stall
            case Turn(speed_mps, _, bank_rad):
                assert speed_mps**2 >= 1.2 * stall**2 / np.cos(bank_rad)
            case Porpoise():
                assert maneuver.speed_mps**2 >= 1.2 * (1 + maneuver.load) * stall**2
    airborne = plan.history.table["flying"].to_numpy()
    assert plan.history.table["V_mps"][airborne & (plan.history.table["height_m"] > 30)].min() > 1.05 * stall
    turns = [maneuver.angle_rad for maneuver in plan.maneuvers if isinstance(maneuver, Turn)]
    assert abs(sum(np.sign(turns))) <= 1


def test_every_piece_of_a_plan_narrows_its_interval(plan: FlightPlan):
    worst = max(plan.half_widths)
    assert plan.contributions
    assert all(part.worst_without > worst for part in plan.contributions)
    assert sum(part.seconds for part in plan.contributions) < plan.seconds


def test_more_wind_widens_and_earlier_flights_narrow_the_interval(plan: FlightPlan):
    def worst(request: Request) -> float:
        return float(max(plan.question.half_widths(search.predicted(plan.maneuvers, plan.aircraft, request))))

    assert worst(replace(plan.request, wind_kt=15.0)) > 1.1 * max(plan.half_widths)
    known = np.zeros((len(SENSOR_ERRORS),) * 2)
    slope = SENSOR_ERRORS.index("alpha_scale")
    known[slope, slope] = 0.005**-2
    narrower = plan.covariances._replace(errors=np.linalg.inv(np.linalg.inv(plan.covariances.errors) + known))
    assert max(plan.question.half_widths(narrower)) < 0.97 * max(plan.half_widths)


def test_the_difference_of_two_propellers_forgets_the_installation(plan: FlightPlan):
    asked = question("propellers", plan.aircraft, 12.0, 20.0)
    worse = plan.covariances.errors.copy()
    slope = SENSOR_ERRORS.index("alpha_scale")
    worse[slope] *= 3.0
    worse[:, slope] *= 3.0
    assert asked.cost(plan.covariances._replace(errors=worse)) == pytest.approx(asked.cost(plan.covariances))
    curve = question("curve", plan.aircraft, 12.0, 20.0)
    assert curve.cost(plan.covariances._replace(errors=worse)) > 1.2 * curve.cost(plan.covariances)


def test_the_simulator_reads_the_plan(plan: FlightPlan):
    found = parse_plan(simulator_plan(plan.maneuvers, plan.aircraft, plan.request), "planned")
    kinds = [segment.kind for segment in found.segments]
    assert kinds.count("run") == sum(isinstance(maneuver, Run) for maneuver in plan.maneuvers)
    assert kinds[:3] == ["stand", "take-off", "climb"] and kinds[-2:] == ["land", "stand"]
    assert found.air.turbulence_mps == pytest.approx(5.144, abs=0.01)


def test_the_mission_is_what_ground_stations_load(plan: FlightPlan, tmp_path, monkeypatch):
    """Fields of QGroundControl's plan format; commands as pymavlink numbers them; the text as pymavlink reads it."""
    monkeypatch.delenv("MAVLINK20", raising=False)  # pymavlink looks at it again where it loads a mission
    home = Home(48.1, 11.5, 0.0)
    content = json.loads(qgroundcontrol_plan(plan, home, "ardupilot"))
    assert (content["fileType"], content["version"], content["mission"]["version"]) == ("Plan", 1, 2)
    items = content["mission"]["items"]
    assert [item["doJumpId"] for item in items] == list(range(1, len(items) + 1))
    assert all(len(item["params"]) == 7 and item["type"] == "SimpleItem" for item in items)
    mav = mavutil.mavlink
    assert items[0]["command"] == mav.MAV_CMD_NAV_TAKEOFF and items[-1]["command"] == mav.MAV_CMD_NAV_RETURN_TO_LAUNCH
    speeds = [item["params"][1] for item in items if item["command"] == mav.MAV_CMD_DO_CHANGE_SPEED]
    assert min(speeds) >= 1.12 * plan.aircraft.stall_mps and max(speeds) <= plan.aircraft.fastest_mps
    far = [item["params"][4] for item in items if item["command"] == mav.MAV_CMD_NAV_WAYPOINT]
    assert np.radians(max(far) - min(far)) * 6371e3 == pytest.approx(plan.request.space.leg_m, rel=0.01)
    assert content["mission"]["firmwareType"] == mav.MAV_AUTOPILOT_ARDUPILOTMEGA
    assert bool(left_out(plan)) == any(piece.kind == "porpoise" for piece in plan.pieces)

    (tmp_path / "mission.waypoints").write_text(waypoint_file(plan, home))
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(tmp_path / "mission.waypoints")) == len(items) + 1
    assert [loader.wp(i + 1).command for i in range(len(items))] == [item["command"] for item in items]


def test_the_next_flight_is_for_what_is_least_known(plan: FlightPlan):
    """Porpoising and fast flight in gusts, runs where their noise dominates, none where the interval is narrow."""
    trajectory = linearized_trajectory(plan.history, plan.aircraft, plan.request.gust_mps, alpha_scale_sigma=0.01)
    at, CL = condition(plan.aircraft), plan.aircraft.lift_coefficient(np.array([23.0, 12.0]))

    def found(noise_factor: float, factor: float = 1.0) -> list[str]:
        noise = np.zeros((5, 5))
        noise[:3, :3] = noise_factor * plan.covariances.noise
        covariance = factor * (plan.covariances.polar + noise[:3, :3])
        estimate = SimpleNamespace(polar=Polar(plan.aircraft.A, covariance), noise=factor * noise)
        return next_flight(trajectory, estimate, at, (CL[0], CL[1]))  # type: ignore[arg-type]

    assert "angle of attack" in found(0.01)[0] or "airspeed" in found(0.01)[0]
    assert "calmer day" in found(0.01)[1]
    assert "noise of the runs" in found(300.0)[0]
    widths = [float(width) for width in re.findall(r"±([\d.]+) %", found(0.01, factor=0.1)[0])]
    assert widths[1] >= widths[0] / 2 - 0.05  # one error known twice as well cannot do more
    assert found(0.01, factor=1e-3) == []


def test_too_little_time_is_refused(nexstar: ExpectedAircraft):
    with pytest.raises(InputError, match="minutes are too short"):
        plan_flight(nexstar, Request(3.0, 0.0, Space(1300.0, HEIGHT_M)))


def test_without_a_motor_the_highest_speed_is_assumed():
    aircraft = load_aircraft("nexstar")
    propulsion = replace(aircraft.propulsion, motor_kv_rpm_per_volt=None)
    bare = replace(aircraft, propulsion=propulsion, keys=aircraft.keys - {"propulsion.motor_kv_rpm_per_volt"})
    found = expected_aircraft(bare, HEIGHT_M)
    assert found.fastest_mps == pytest.approx(2.4 * found.stall_mps, rel=0.02)
    with pytest.raises(InputError, match=r"propulsion\.propeller"):
        expected_aircraft(replace(aircraft, propulsion=replace(propulsion, propeller=None)), HEIGHT_M)


def test_a_run_follows_drag_and_thrust(nexstar: ExpectedAircraft):
    """At the end of a long run at a constant throttle thrust equals drag."""
    flown = [Hold(4.0, 15.0), Run(0.7, 1.0, 40.0, longest_s=60.0)]
    history = fly(flown, nexstar, HEIGHT_M, 0.0, begins="air")
    V = float(history.table["V_mps"].iloc[-1])
    assert nexstar.thrust_N(0.7, V) == pytest.approx(float(nexstar.drag_N(V)), rel=0.02)
    assert len(history.table) == pytest.approx(64.0 / STEP_S, abs=2)


def test_earlier_flights_are_known_by_what_they_added_to_the_prior():
    """In the units of the equations; only errors that stay with the installation."""

    def error(name: str, sigma: float, prior: float) -> SimpleNamespace:
        return SimpleNamespace(name=name, standard_error=sigma, assumed_sigma=prior)

    errors = [error("alpha_scale", 1.0, 3.0), error("alpha_bias", 0.1, 1.0), error("ax_bias", 0.01, 0.19)]
    flight = SimpleNamespace(path=SimpleNamespace(sensor_errors=errors), log="one")
    known = earlier.information([flight, flight])  # type: ignore[list-item]
    assert known is not None
    diagonal = dict(zip(SENSOR_ERRORS, np.diag(known), strict=True))
    assert diagonal["alpha_scale"] == pytest.approx(2 * (0.01**-2 - 0.03**-2))
    assert diagonal["alpha_bias"] == pytest.approx(2 * (np.radians(0.1) ** -2 - np.radians(1.0) ** -2))
    assert diagonal["ax_bias"] == 0.0
    assert earlier.information([]) is None
    with pytest.raises(InputError, match="no sensor errors"):
        earlier.information([SimpleNamespace(path=None, log="two")])  # type: ignore[list-item]
