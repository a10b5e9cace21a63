"""Plans predict the estimator's standard errors, give files that can be flown, and keep a margin above the stall."""

import json
import re
from dataclasses import fields, replace
from itertools import groupby
from math import pi, tan
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pymavlink import mavutil, mavwp

from flightpower.analysis.missions import card, information, pieces, search
from flightpower.analysis.missions.card import _words
from flightpower.analysis.missions.expected_aircraft import ExpectedAircraft, expected_aircraft
from flightpower.analysis.missions.information import (
    _of_difference,
    expected,
    question,
    sensor_errors,
)
from flightpower.analysis.missions.pieces import Hold, Land, Pilot, Porpoise, Run, Space, Stand, TakeOff, Turn
from flightpower.analysis.missions.plan_mission import Home, left_out, qgroundcontrol_plan, waypoint_file
from flightpower.analysis.missions.plan_settings import PATH, SEARCH
from flightpower.analysis.missions.search import FlightPlan, Request, plan_flight
from flightpower.analysis.missions.simulator_plan import simulator_plan
from flightpower.analysis.missions.speed_unit import SpeedUnit, speed_text
from flightpower.analysis.missions.time_history import TimeHistory, fly, throttle_at
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.priors import SensorPriors
from flightpower.analysis.trajectory.problem import TrajectoryProblem
from flightpower.analysis.trajectory.reconstruction import _solve, reconstruct
from flightpower.analysis.trajectory.settings import PRIORS, SOLVER
from flightpower.analysis.trajectory.updraft import by_waves
from flightpower.flight.aircraft import Uncertainty, load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2
from flightpower.sim.plan import parse_plan

HEIGHT_M = 40.0


@pytest.fixture(scope="module")
def nexstar() -> ExpectedAircraft:
    return expected_aircraft(load_aircraft("nexstar"), HEIGHT_M)


@pytest.fixture(scope="module")
def plan(nexstar: ExpectedAircraft) -> FlightPlan:
    """Return a plan of 9 minutes from a small catalog; a leg is too short for an acceleration and a deceleration."""
    few = pieces.catalog

    def small(*arguments: object) -> list[pieces.Piece]:
        everything = few(*arguments)  # type: ignore[arg-type]
        kinds = ("runs", "circuit", "circles", "porpoise")
        return [next(piece for piece in everything[::-1] if piece.kind == kind) for kind in kinds]

    search.catalog = small  # type: ignore[assignment]
    try:
        return plan_flight(nexstar, Request(9.0, 10.0, Space(500.0, HEIGHT_M), Pilot(autopilot=False, load=0.8)))
    finally:
        search.catalog = few


def test_no_acceleration_is_planned_that_the_analysis_finds_too_gentle(nexstar: ExpectedAircraft):
    """A table that ends at 1.5 times the stall leaves little throttle, so a ramp of 13 s accelerates too gently."""
    request = Request(9.0, 0.0, Space(500.0, HEIGHT_M), Pilot(autopilot=False, load=0.8))
    V = 1.5 * nexstar.stall_mps
    narrow = replace(nexstar, fastest_mps=V / 0.92, acceleration_throttle=throttle_at(nexstar, V) + 0.1)

    def ramps_s(aircraft: ExpectedAircraft) -> list[float]:
        catalog = pieces.catalog(aircraft, request.space, request.pilot, request.wind_kt)
        run_pieces = [
            piece for piece in search._without_gentle_runs(catalog, aircraft, request) if piece.kind == "runs"
        ]
        return [
            next(maneuver.ramp_s for maneuver in piece.maneuvers if isinstance(maneuver, Run)) for piece in run_pieces
        ]

    assert ramps_s(nexstar) == [13.0, 8.0]
    assert ramps_s(narrow) == [8.0]


def test_a_level_turn_turns_by_the_bank_and_keeps_its_height(nexstar: ExpectedAircraft):
    history = fly([Hold(5.0, 18.0), Turn(18.0, 4 * pi, 0.6), Hold(5.0, 18.0)], nexstar, HEIGHT_M, 0.0, airborne=True)
    middle = history.table.loc[12.0:20.0]
    rate = np.hypot(middle["q_radps"], middle["r_radps"])
    assert np.allclose(rate, GRAVITY_MPS2 * tan(0.6) / 18.0, rtol=0.01)
    assert np.allclose(middle["az_mps2"], -GRAVITY_MPS2 / np.cos(0.6), rtol=0.03)
    assert np.ptp(history.table["height_m"]) < 1.0
    assert history.attitude[-1, 2] == pytest.approx(4 * pi, abs=0.1)


def test_porpoising_swings_the_load_factor_and_not_the_speed(nexstar: ExpectedAircraft):
    history = fly([Hold(4.0, 17.0), Porpoise(20.0, 17.0, 0.8)], nexstar, HEIGHT_M, 0.0, airborne=True)
    middle = history.table.loc[8.0:20.0]
    load = -middle["az_mps2"] / GRAVITY_MPS2
    assert (load.max(), load.min()) == pytest.approx((1.8, 0.2), abs=0.1)
    assert np.ptp(middle["V_mps"]) < 0.1
    assert np.ptp(middle["height_m"]) < 3.0
    pitch_rate = np.gradient(history.attitude[:, 1], PATH.step_s)[200:500]
    assert np.ptp(pitch_rate) > 0.5
    assert np.allclose(history.table["q_radps"].to_numpy()[200:500], pitch_rate, atol=1e-6)


def test_the_information_is_that_of_the_estimator(nexstar: ExpectedAircraft):
    """If the history is analyzed like a flight, the estimator states the same standard errors."""
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
    trajectory = reconstruct(history.table, history.rest, SensorPriors(alpha_scale_sigma=0.01), gust_length=gust_length)
    trajectory = trajectory.with_prior("updraft", by_waves(history.starts_s[-1] - history.starts_s[0]))
    covariance, _ = sensor_errors(history, nexstar, trajectory.gust_mps, alpha_scale_sigma=0.01)
    for name in ("alpha_bias", "alpha_scale", "V_scale", "ax_bias", "updraft"):
        i = SENSOR_ERRORS.index(name)
        assert np.sqrt(covariance[i, i]) == pytest.approx(trajectory.standard_error(name), rel=0.05), name


def without_keys(nexstar: ExpectedAircraft, *keys: str) -> ExpectedAircraft:
    """Return the aircraft as if its file lacked these keys."""
    return replace(nexstar, aircraft=replace(nexstar.aircraft, keys=nexstar.aircraft.keys - set(keys)))


def test_a_probe_elsewhere_pulls_at_the_sensor_errors_as_the_estimator_finds(nexstar: ExpectedAircraft):
    """In porpoising, a probe 0.2 m further ahead looks like another slope of the angle of attack."""
    V, lacking = nexstar.stall_mps, without_keys(nexstar, "probe.position")
    flown = [Stand(20.0), TakeOff(1.6 * V), Porpoise(20.0, 1.7 * V, 0.8), Turn(1.7 * V), Hold(30.0, 2 * V)]
    history = fly([*flown, Land(1.6 * V)], nexstar, HEIGHT_M, 2.0)
    table = history.table
    moved = table.assign(
        alpha_rad=table["alpha_rad"] + 0.2 * table["q_radps"] / table["V_mps"],
        beta_rad=table["beta_rad"] - 0.2 * table["r_radps"] / table["V_mps"],
    )
    gust_mps, slope, ahead = 0.3, SENSOR_ERRORS.index("alpha_scale"), SENSOR_ERRORS.index("probe_ahead")
    solved = []
    for data in (table, moved):
        problem = TrajectoryProblem(data, history.rest, SensorPriors(0.01, probe_ahead_m=PRIORS.probe_ahead_m))
        solved.append(_solve(problem, problem.initial_states, problem.initial_errors, gust_mps).sensor_errors)
    change = solved[1][slope] - solved[0][slope]
    covariance, scores = sensor_errors(history, lacking, gust_mps, alpha_scale_sigma=0.01)
    assert abs(change) > 0.02
    assert (covariance @ scores[0])[slope] == pytest.approx(change, rel=0.2)
    assert 0.1 < np.sqrt(covariance[ahead, ahead]) < PRIORS.probe_ahead_m
    complete = sensor_errors(history, nexstar, gust_mps, alpha_scale_sigma=0.01)
    assert len(complete.scores) == 0 and np.sqrt(complete.covariance[ahead, ahead]) < 1e-5


def test_keys_that_the_aircraft_file_lacks_widen_a_plans_interval(
    nexstar, acceleration, stated_variance, complete_uncertainty
):
    """Each key adds less than half of the variance, since an error of the assumed value does not change the polar."""
    complete = replace(nexstar, aircraft=replace(nexstar.aircraft, uncertainty=complete_uncertainty))
    for key in ("probe.upwash_per_CL", "probe.position", "imu_position"):
        assert 1.0001 < variance_of_drag(acceleration, without_keys(complete, key)) / stated_variance < 1.5, key


@pytest.fixture(scope="module")
def acceleration(nexstar: ExpectedAircraft) -> TimeHistory:
    """Return a single acceleration; in a deceleration, a lag would have the opposite effect."""
    V = nexstar.stall_mps
    return fly([Hold(8.0, 1.15 * V), Run(1.0, 1.0, 2.2 * V), Hold(4.0, 2.2 * V)], nexstar, HEIGHT_M, 0.0, airborne=True)


def variance_of_drag(history: TimeHistory, aircraft: ExpectedAircraft) -> float:
    powers_of_CL = np.array([1.0, 0.9, 0.81])  # 1, C_L and C_L^2 at C_L = 0.9
    return float(powers_of_CL @ expected(history, aircraft, 0.0125, alpha_scale_sigma=0.01).total @ powers_of_CL)


@pytest.fixture(scope="module")
def complete_uncertainty(nexstar: ExpectedAircraft) -> Uncertainty:
    """Return the uncertainty with a calibrated airspeed, vibration measured in a run-up, and calm air.

    With the default airspeed error of 1.25 %, less certain thrust would take up some of that error in a single
    acceleration, and the interval would be 0.9 % narrower.
    """
    calm = replace(nexstar.aircraft.uncertainty, updraft_mps=0.005)
    return replace(calm, airspeed_scale_fraction=0.002, accelerometer_vibration_mps2=0.002)


@pytest.fixture(scope="module")
def stated_variance(nexstar: ExpectedAircraft, acceleration: TimeHistory, complete_uncertainty: Uncertainty) -> float:
    return variance_of_drag(
        acceleration, replace(nexstar, aircraft=replace(nexstar.aircraft, uncertainty=complete_uncertainty))
    )


# Plans have no hysteresis and calm air no gusts; two errors belong to a stand; a level run has one load factor.
ELSEWHERE = ("gust_length", "hysteresis_fraction", "static_thrust_ratio_fraction", "thrust_curvature_fraction",
             "boom_bending_rad")  # fmt: skip


@pytest.mark.parametrize("key", [field.name for field in fields(Uncertainty) if field.name not in ELSEWHERE])
def test_every_error_that_the_aircraft_file_states_is_in_a_plans_interval(
    nexstar, acceleration, complete_uncertainty, stated_variance, key: str
):
    """An error that is stated five times as large, or as 1 instead of 0, widens the interval."""
    larger = replace(
        nexstar.aircraft,
        uncertainty=replace(complete_uncertainty, **{key: 5 * getattr(complete_uncertainty, key) or 1.0}),
    )
    assert variance_of_drag(acceleration, replace(nexstar, aircraft=larger)) > 1.0001 * stated_variance


def test_thrust_on_a_stand_narrows_a_plans_interval_and_its_errors_widen_it(
    nexstar, acceleration, complete_uncertainty, stated_variance
):
    """The stand does not improve the scale in flight, and one acceleration without turns does not determine the scale
    of the accelerometer, so the interval is narrower by only a tenth of a percent."""

    def variance(**larger: float) -> float:
        aircraft = replace(
            nexstar.aircraft,
            propulsion=replace(nexstar.aircraft.propulsion, static_thrust_ratio=1.0),
            uncertainty=replace(complete_uncertainty, **larger),
        )
        return variance_of_drag(acceleration, replace(nexstar, aircraft=aircraft))

    assert variance() < 0.998 * stated_variance
    for key in ("static_thrust_ratio_fraction", "thrust_curvature_fraction"):
        assert 1.0001 * variance() < variance(**{key: 5 * getattr(complete_uncertainty, key)}) < stated_variance


@pytest.mark.slow
def test_a_plan_uses_its_time_and_keeps_off_the_stall(plan: FlightPlan):
    stall = plan.aircraft.stall_mps
    there_and_back_s = 2 * min(part.seconds / part.times for part in plan.contributions)
    assert 9 * 60 - there_and_back_s < plan.seconds <= 9 * 60
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


def test_a_knot_is_a_nautical_mile_an_hour(plan: FlightPlan, monkeypatch):
    winds_mps = []

    def watched(maneuvers, aircraft, height_m: float, wind_mps: float, **how: Any) -> TimeHistory:
        winds_mps.append(wind_mps)
        return fly(maneuvers, aircraft, height_m, wind_mps, **how)

    monkeypatch.setattr(search, "fly", watched)
    windy = replace(plan.request, wind_kt=15.0)
    search.predicted(plan.maneuvers, plan.aircraft, windy)
    assert winds_mps == [windy.wind_mps]
    assert replace(windy, space=Space(500.0, 20 * 0.3048)).wind_mps == pytest.approx(15 * 1852 / 3600, rel=1e-5)
    assert windy.wind_mps / replace(windy, space=Space(500.0, 20 * 0.3048)).wind_mps == pytest.approx(
        np.log(HEIGHT_M / (0.15 * 0.3048)) / np.log(20 / 0.15)
    ), "wind over height is logarithmic (MIL-F-8785C)"


def test_every_piece_of_a_plan_narrows_its_interval(plan: FlightPlan):
    worst = max(plan.half_widths)
    assert plan.contributions
    assert all(part.worst_without > worst for part in plan.contributions)
    assert sum(part.seconds for part in plan.contributions) < plan.seconds


def test_more_wind_widens_and_earlier_flights_narrow_the_interval(plan: FlightPlan):
    def worst(request: Request) -> float:
        return float(max(plan.question.half_widths(search.predicted(plan.maneuvers, plan.aircraft, request))))

    assert worst(replace(plan.request, wind_kt=15.0)) > 1.1 * max(plan.half_widths)
    information_of_flight = np.zeros((len(SENSOR_ERRORS),) * 2)
    slope = SENSOR_ERRORS.index("alpha_scale")
    information_of_flight[slope, slope] = 0.005**-2
    narrower = plan.covariances._replace(
        errors=np.linalg.inv(np.linalg.inv(plan.covariances.errors) + information_of_flight)
    )
    assert max(plan.question.half_widths(narrower)) < 0.97 * max(plan.half_widths)


def test_the_difference_of_two_propellers_forgets_the_installation(plan: FlightPlan):
    request = question("propellers", plan.aircraft, 12.0, 20.0)
    worse = plan.covariances.errors.copy()
    slope = SENSOR_ERRORS.index("alpha_scale")
    worse[slope] *= 3.0
    worse[:, slope] *= 3.0
    assert request.cost(plan.covariances._replace(errors=worse)) == pytest.approx(request.cost(plan.covariances))
    curve = question("curve", plan.aircraft, 12.0, 20.0)
    assert curve.cost(plan.covariances._replace(errors=worse)) > 1.2 * curve.cost(plan.covariances)


def test_the_simulator_reads_the_plan(plan: FlightPlan):
    planned = parse_plan(simulator_plan(plan.maneuvers, plan.aircraft, plan.request), "planned")
    kinds = [segment.kind for segment in planned.segments]
    assert kinds.count("run") == sum(isinstance(maneuver, Run) for maneuver in plan.maneuvers)
    assert kinds[:3] == ["stand", "take-off", "climb"] and kinds[-2:] == ["land", "stand"]
    assert planned.air.turbulence_mps == pytest.approx(5.144, abs=0.01)


def test_the_rehearsal_is_turned_with_its_wind_so_that_the_first_leg_points_north(plan: FlightPlan):
    """A leg toward 250 deg in wind from 280 deg becomes a leg toward 0 in wind from 30 deg, also from the right."""
    request = replace(plan.request, heading_deg=250.0, wind_from_deg=280.0)
    planned = parse_plan(simulator_plan(plan.maneuvers, plan.aircraft, request), "planned")
    assert planned.heading_rad == 0.0
    assert np.degrees(planned.air.wind_from_rad) == pytest.approx(30.0)


def test_the_mission_is_what_ground_stations_load(plan: FlightPlan, tmp_path, monkeypatch):
    """It has the fields of QGroundControl's plan format and pymavlink's command numbers; pymavlink reads the text."""
    monkeypatch.delenv("MAVLINK20", raising=False)  # pymavlink reads it again when it loads a mission
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


def test_too_little_time_is_refused(nexstar: ExpectedAircraft):
    """Standing takes two minutes; the take-off, two pairs of runs and the landing take at least one and a half more."""
    with pytest.raises(InputError, match=r"3 minutes are too short: .* landing take [4-6]\.\d$"):
        plan_flight(nexstar, Request(3.0, 0.0, Space(1300.0, HEIGHT_M), Pilot(autopilot=False, load=1.0)))


def test_a_flight_without_a_run_has_no_interval(nexstar: ExpectedAircraft) -> None:
    """An aircraft too close to its stall to accelerate gets a one-line message, not a singular matrix."""
    V = nexstar.cruise_mps
    history = fly([Stand(30.0), TakeOff(V), Hold(60.0, V), Land(V), Stand(30.0)], nexstar, HEIGHT_M, 3.0)
    with pytest.raises(InputError, match=r"^nexstar: no acceleration or deceleration is clear enough .* [0-9.]+ m/s"):
        expected(history, nexstar, 0.2, alpha_scale_sigma=0.02)


@pytest.mark.thorough
def test_a_slow_aircraft_in_wind_uses_its_time_and_stays_in_sight() -> None:
    """In 9 m/s of wind, at airspeeds of 7 to 13 m/s, each piece takes twice the time that it takes alone. The card
    warns of the wind."""
    light = expected_aircraft(load_aircraft("light-1kg"), HEIGHT_M)
    plan = plan_flight(light, Request(15.0, 12.0, Space(500.0, HEIGHT_M), Pilot(autopilot=False, load=1.0)))
    assert 0.9 * 900 < plan.seconds <= 900
    before_landing = int(plan.history.starts_s[-3] / PATH.step_s)
    assert np.hypot(*plan.history.position_m[:before_landing].T).max() < 600.0
    assert any(f"{plan.request.wind_mps:.1f} m/s, the speed between" in line for line in card.warnings(plan))


def test_without_a_motor_the_highest_speed_is_assumed():
    aircraft = load_aircraft("nexstar")
    propulsion = replace(aircraft.propulsion, motor_kv_rpm_per_volt=None)
    bare = replace(aircraft, propulsion=propulsion, keys=aircraft.keys - {"propulsion.motor_kv_rpm_per_volt"})
    result = expected_aircraft(bare, HEIGHT_M)
    assert result.fastest_mps == pytest.approx(2.4 * result.stall_mps, rel=0.02)
    with pytest.raises(InputError, match=r"propulsion\.propeller"):
        expected_aircraft(replace(aircraft, propulsion=replace(propulsion, propeller=None)), HEIGHT_M)


def test_a_run_follows_drag_and_thrust(nexstar: ExpectedAircraft):
    """At the end of a long run at constant throttle, thrust equals drag."""
    flown = [Hold(4.0, 15.0), Run(0.7, 1.0, 40.0, longest_s=60.0)]
    history = fly(flown, nexstar, HEIGHT_M, 0.0, airborne=True)
    V = float(history.table["V_mps"].iloc[-1])
    assert nexstar.thrust_N(0.7, V) == pytest.approx(float(nexstar.drag_N(V)), rel=0.02)
    assert len(history.table) == pytest.approx(64.0 / PATH.step_s, abs=2)


def test_earlier_flights_are_known_by_what_they_added_to_the_prior():
    """The information is in the units of the equations, and only for errors that stay with the installation."""

    def error(name: str, sigma: float, prior: float) -> SimpleNamespace:
        return SimpleNamespace(name=name, standard_error=sigma, assumed_sigma=prior)

    errors = [error("alpha_scale", 1.0, 3.0), error("alpha_bias", 0.1, 1.0), error("ax_bias", 0.01, 0.19)]
    flight = SimpleNamespace(path=SimpleNamespace(sensor_errors=errors), log="one")
    added = information.information([flight, flight])  # type: ignore[list-item]
    assert added is not None
    diagonal = dict(zip(SENSOR_ERRORS, np.diag(added), strict=True))
    assert diagonal["alpha_scale"] == pytest.approx(2 * (0.01**-2 - 0.03**-2))
    assert diagonal["alpha_bias"] == pytest.approx(2 * (np.radians(0.1) ** -2 - np.radians(1.0) ** -2))
    assert diagonal["ax_bias"] == 0.0
    assert information.information([]) is None
    with pytest.raises(InputError, match="no sensor errors"):
        information.information([SimpleNamespace(path=None, log="two")])  # type: ignore[list-item]


def test_the_catalog_of_an_aircraft_has_pieces_of_every_kind_within_the_leg(nexstar: ExpectedAircraft):
    leg_m = 500.0
    catalog = pieces.catalog(nexstar, Space(leg_m, HEIGHT_M), Pilot(autopilot=False, load=0.8), 10.0)
    by_kind = {kind: [piece for piece in catalog if piece.kind == kind] for kind in pieces.PieceKind}
    assert [len(by_kind[kind]) for kind in ("runs", "circuit", "circles")] == [2, 6, 6] and by_kind["porpoise"]
    for piece in by_kind["circuit"] + by_kind["porpoise"]:
        straight = [maneuver for maneuver in piece.maneuvers[:2] if not isinstance(maneuver, Turn)]
        assert sum(maneuver.duration_s * maneuver.speed_mps for maneuver in straight) == pytest.approx(leg_m)


def test_the_rows_of_the_card_are_the_flight_in_order(plan: FlightPlan):
    rows = card.rows(plan)
    assert sum(row.seconds for row in rows) == pytest.approx(plan.seconds)
    assert rows[0].seconds == pytest.approx(plan.history.starts_s[4])
    assert [row.title for row in rows[1:-1]] == [title for title, _ in groupby(piece.title for piece in plan.pieces)]
    assert sum(int(row.times.split()[0]) for row in rows[1:-1]) == len(plan.pieces)
    seconds, i = [], 4
    for piece in plan.pieces:
        seconds.append(plan.history.starts_s[i + len(piece.maneuvers)] - plan.history.starts_s[i])
        i += len(piece.maneuvers)
    assert sum(row.seconds for row in rows[1:-1]) == pytest.approx(sum(seconds))


def test_a_maneuver_has_one_duration_in_the_rows_and_in_what_it_contributes(plan: FlightPlan):
    rows = {row.title: round(row.seconds) for row in card.rows(plan)}
    messages = {part.title: round(part.seconds) for part in plan.contributions}
    assert messages and messages == {title: rows[title] for title in messages}
    assert any(f"({seconds} s): if you skip" in line for seconds in messages.values() for line in card.losses(plan))


def test_the_card_says_what_each_maneuver_is():
    steps = card._steps(
        [Turn(18.0, 4 * pi, 0.6), Turn(18.0, pi, 0.8), Run(0.87, 13.0, 25.0), Stand(90.0)], SpeedUnit.MPS
    )
    assert steps == (
        "2 circles at 18.0 m/s, bank 34° → turn back at 18.0 m/s, bank 46° → throttle to 87 % over 13 s until"
        " 25.0 m/s (at most 20 s) → stand still 90 s, motor off"
    )
    assert card._steps([Porpoise(20.0, 17.0, 0.8)], SpeedUnit.MPS).endswith("load factor 0.2 to 1.8")


@pytest.mark.parametrize(
    ("unit", "text"), [("m/s", "20.0 m/s"), ("kt", "20.0 m/s (38.9 kt)"), ("mph", "20.0 m/s (44.7 mph)"),
                       ("km/h", "20.0 m/s (72.0 km/h)")],
)  # fmt: skip
def test_a_speed_is_reported_in_the_unit_of_the_pilot_s_display(plan: FlightPlan, unit: str, text: str):
    assert speed_text(20.0, SpeedUnit(unit)) == text
    page = card.card(plan, "mine", SpeedUnit(unit))
    shown = {other for other in SpeedUnit if re.search(rf"\d m/s \([\d.]+ {other}\)", page)}
    assert shown == {SpeedUnit(unit)} - {SpeedUnit.MPS}


def test_the_card_tells_margin_room_and_what_a_piece_is_worth(plan: FlightPlan):
    stall = plan.aircraft.stall_mps
    margin = card.margin(plan)
    assert f"end at {speed_text(1.1 * stall, SpeedUnit.KNOT)}, 10 % above the stall" in margin
    assert f"to hold is {speed_text(1.04 * 1.1 * stall, SpeedUnit.KNOT)}, 14 % above it" in margin
    widest = max(m.speed_mps**2 / tan(m.bank_rad) for m in plan.maneuvers if isinstance(m, Turn))
    assert card.side_m(plan) == pytest.approx(2 * widest / GRAVITY_MPS2)
    worst = max(plan.half_widths)
    assert [line.endswith(f"instead of ±{worst:.1f} %") for line in card.losses(plan)] == [True] * len(
        plan.contributions
    )
    loss = card.losses(replace(plan, worst_with_porpoising=0.5))[-1]
    assert loss.endswith(f"±0.5 % instead of ±{worst:.1f} %.")
    lacking = replace(plan, worst_with_keys=0.5, aircraft=without_keys(plan.aircraft, "imu_position"))
    assert card.losses(lacking)[0].startswith(
        f"The aircraft file lacks imu_position: with it ±0.5 % instead of ±{worst:.1f} %."
    )


def test_points_of_the_mission_lie_where_the_legs_are(plan: FlightPlan):
    """Distances are on a sphere with a radius of 6371 km; the fence leaves three radii of the fastest turn."""
    home = Home(48.1, 11.5, 0.7)

    def from_home(place: tuple[float, float]) -> tuple[float, float]:
        north = np.radians(place[0] - home.latitude_deg) * 6371e3
        east = np.radians(place[1] - home.longitude_deg) * 6371e3 * np.cos(np.radians(home.latitude_deg))
        along, across = (
            north * np.cos(0.7) + east * np.sin(0.7),
            east * np.cos(0.7) - north * np.sin(0.7),
        )
        return float(along), float(across)

    content = json.loads(qgroundcontrol_plan(plan, home, "px4"))
    items = content["mission"]["items"]
    places = [from_home((i["params"][4], i["params"][5])) for i in items if i["command"] == 16]
    assert {round(along) for along, _ in places} == {250, -250} and max(abs(y) for _, y in places) < 0.2
    assert from_home(tuple(items[0]["params"][4:6])) == pytest.approx((125.0, 0.0), abs=0.1)
    corners = [from_home(tuple(corner)) for corner in content["geoFence"]["polygons"][0]["polygon"]]
    radius_m = plan.aircraft.fastest_mps**2 / (GRAVITY_MPS2 * tan(0.6))
    assert [abs(x) for x, _ in corners] == pytest.approx([250 + 3 * radius_m] * 4, rel=1e-3)
    assert [y for _, y in corners] == pytest.approx(
        [3 * radius_m, -3 * radius_m, -3 * radius_m, 3 * radius_m], rel=1e-3
    )
    assert content["mission"]["cruiseSpeed"] == round(1.6 * plan.aircraft.stall_mps, 1)
    circles = [(i["params"][0], i["params"][2]) for i in items if i["command"] == 18]
    flown = [m for p in plan.pieces if p.kind == "circles" for m in p.maneuvers if isinstance(m, Turn)]
    assert circles == [(2, round(m.speed_mps**2 / (GRAVITY_MPS2 * tan(m.bank_rad)), 1)) for m in flown]


def test_turns_keep_within_the_room_beside_the_legs(nexstar: ExpectedAircraft):
    """Every turn's diameter fits and keeps the lift margin of turns; only circles may be left out altogether."""
    for side_m in (60.0, 100.0, 200.0):
        catalog = pieces.catalog(nexstar, Space(1300.0, HEIGHT_M, side_m), Pilot(autopilot=False, load=1.0), 3.0)
        turns = [m for piece in catalog for m in piece.maneuvers if isinstance(m, Turn)]
        assert max(2 * m.speed_mps**2 / (GRAVITY_MPS2 * tan(m.bank_rad)) for m in turns) <= side_m
        stalls_mps = [1.086 * nexstar.stall_mps / np.sqrt(np.cos(m.bank_rad)) for m in turns]
        assert all(m.speed_mps > stall for m, stall in zip(turns, stalls_mps, strict=True))
        assert {"runs", "circuit", "porpoise"} <= {piece.kind for piece in catalog}
    everything = pieces.catalog(nexstar, Space(1300.0, HEIGHT_M), Pilot(autopilot=False, load=1.0), 3.0)
    assert catalog == everything, "200 m must be enough for all pieces"
    with pytest.raises(InputError, match=r"--side 40: too narrow for a turn of nexstar; .* needs 50 m"):
        pieces.catalog(nexstar, Space(1300.0, HEIGHT_M, 40.0), Pilot(autopilot=False, load=1.0), 3.0)


def test_a_fence_is_as_wide_as_the_room(plan: FlightPlan):
    narrow = replace(plan, request=replace(plan.request, space=Space(500.0, HEIGHT_M, 80.0)))
    (box,) = json.loads(qgroundcontrol_plan(narrow, Home(0.0, 0.0, 0.0), "px4"))["geoFence"]["polygons"]
    meters = np.radians(np.abs(box["polygon"])) * 6371e3
    assert meters == pytest.approx(np.array([[250 + 80, 80]] * 4), rel=1e-3)


def test_half_widths_and_questions_are_those_of_the_power_curve(plan: FlightPlan):
    """Half widths are 1.96 standard errors. Endurance is asked near the speed of least power, range near least drag."""
    aircraft = plan.aircraft
    endurance, far = (question(name, aircraft, 8.0, 30.0).speeds for name in ("endurance", "range"))
    V = np.linspace(9.0, 29.0, 4001)
    assert endurance == pytest.approx(V[np.argmin(aircraft.drag_N(V) * V)] * np.array([0.95, 1, 1.05]), rel=1e-3)
    assert far == pytest.approx(V[np.argmin(aircraft.drag_N(V))] * np.array([0.95, 1, 1.05]), rel=1e-3)
    CL = aircraft.lift_coefficient(plan.question.speeds)
    terms = np.vander(CL, 3, increasing=True)
    sigma = np.sqrt(np.einsum("ij,jk,ik->i", terms, plan.covariances.polar, terms))
    assert plan.half_widths == pytest.approx(196 * sigma / (terms @ aircraft.A), rel=1e-3)
    assert plan.question.cost(plan.covariances) == pytest.approx(
        max(plan.half_widths) + 0.1 * np.mean(plan.half_widths)
    )
    errors = np.zeros((len(SENSOR_ERRORS),) * 2)
    for name, sigma in (("alpha_bias", np.radians(0.1)), ("alpha_scale", 0.01), ("V_scale", 0.01)):
        errors[SENSOR_ERRORS.index(name), SENSOR_ERRORS.index(name)] = sigma**2
    probe = question("probe", aircraft, 12.0, 20.0)
    for size in (1.0, 2.0):
        cost = probe.cost(plan.covariances._replace(errors=size**2 * errors))
        assert cost == pytest.approx(1.96 * size, rel=1e-3)


def test_the_difference_of_two_flights_has_the_errors_of_both_but_not_those_they_share(plan: FlightPlan):
    covariances = plan.covariances
    both = _of_difference(covariances)
    assert both.noise == pytest.approx(2 * covariances.noise) and not both.fixed.any()
    own, shared = SENSOR_ERRORS.index("az_bias"), SENSOR_ERRORS.index("alpha_bias")
    assert both.errors[own, own] == pytest.approx(2 * covariances.errors[own, own])
    assert both.errors[shared, shared] == 0 < covariances.errors[shared, shared]


def test_information_of_pieces_adds_and_is_taken_away_again():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(3, 3))
    before = np.linalg.inv(root @ root.T + np.eye(3))
    added = np.diag([0.5, 0.2, 0.1])
    after = np.linalg.inv(np.linalg.inv(before) + added)
    assert search._gain(after, before) == pytest.approx(added, abs=1e-9)
    assert search._gain(before, after) == pytest.approx(np.zeros((3, 3)), abs=1e-9)
    assert search._without_information(after, added) == pytest.approx(before)
    assert np.linalg.eigvalsh(search._without_information(before, 10 * np.linalg.inv(before))) == pytest.approx(
        np.linalg.eigvalsh(before) / SEARCH.least_left
    )
    assert Request(9.0, 10.0, Space(500.0, 40.0), Pilot(False, 1.0)).gust_mps == pytest.approx(0.1 * 5.14444)
    assert Request(9.0, 0.0, Space(500.0, 40.0), Pilot(False, 1.0)).gust_mps == SOLVER.least_gust_mps


def test_a_turn_of_half_a_circle_turns_back_and_more_are_circles() -> None:
    messages = [_words(Turn(17.0, angle, 0.6)).partition(" at ")[0] for angle in (pi, -pi, 2 * pi, -6 * pi)]
    assert messages == ["turn back", "turn back", "a circle", "3 circles"]
