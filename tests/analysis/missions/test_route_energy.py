"""Energy and time of single legs agree with calculations by hand."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from route_data import (
    AREA_M2,
    BATTERY,
    FLOWN_CL,
    RHO,
    WEIGHT_N,
    aerodynamic_results,
    electrical_results,
    flight,
    legs,
    route_of,
)

from flightpower.analysis.curve import Condition, speed_at
from flightpower.analysis.missions.energy import (
    Battery,
    Legs,
    World,
    best_speeds,
    energy_and_time,
    ground_speed,
    speed_limits,
)
from flightpower.analysis.missions.mission import Speed, Wind
from flightpower.analysis.missions.power import SteadyPower, source_of
from flightpower.analysis.missions.prediction import mean_wind_sigma
from flightpower.analysis.performance.level_flight import level_flight
from flightpower.analysis.performance.stored_model import model_of
from flightpower.analysis.trajectory import dryden

AT = Condition(WEIGHT_N, RHO, AREA_M2)
ONE = np.ones((1, 1))


def source(electrical: bool = False):
    results = electrical_results() if electrical else aerodynamic_results()
    return source_of(results, None, 50, np.random.default_rng(1))


def world(power: SteadyPower, east: float = 0.0, north: float = 0.0) -> World:
    return World(power, east * ONE, north * ONE, ONE, ONE)


def straight(distance_m: float, course_deg: float, climb_m: float = 0.0, **changed: np.ndarray) -> Legs:
    zero = np.zeros(1)
    made = Legs(
        np.array([distance_m]), np.radians([course_deg]), np.array([climb_m]), zero, zero, zero, zero, np.array([3.0]),
        Condition(np.array([WEIGHT_N]), np.array([RHO]), AREA_M2), 1.2,
    )  # fmt: skip
    return replace(made, **changed)


def energy_of(legs_: Legs, V: float, in_world: World, battery: Battery = BATTERY) -> tuple[float, float]:
    energy_J, seconds = energy_and_time(legs_, np.array([V]), in_world, battery)
    return float(energy_J[0, 0]), float(seconds[0, 0])


def test_a_level_leg_in_calm_takes_the_power_of_level_flight() -> None:
    model = model_of(aerodynamic_results().use.model)
    battery_W = level_flight(model, AT, np.array([15.0])).battery.value[0]
    energy_J, seconds = energy_of(straight(3000.0, 70.0), 15.0, world(source().nominal))
    assert seconds == pytest.approx(200.0)
    assert energy_J == pytest.approx(200.0 * battery_W, rel=1e-6)


def test_out_against_the_wind_and_back_takes_the_time_of_the_wind_triangle() -> None:
    windy = world(source().nominal, east=5.0)
    out, back = (energy_of(straight(3000.0, course), 15.0, windy)[1] for course in (270.0, 90.0))
    assert out + back == pytest.approx(2 * 3000 * 15 / (15**2 - 5**2))
    across = energy_of(straight(3000.0, 0.0), 15.0, windy)[1]
    assert across == pytest.approx(3000 / np.sqrt(15**2 - 5**2))


@pytest.mark.parametrize("course", [0.0, 90.0])
def test_a_leg_on_which_the_wind_allows_no_progress_never_ends(course: float) -> None:
    """The wind is faster than the airspeed, across the course or against it."""
    energy_J, seconds = energy_of(straight(1000.0, course), 12.0, world(source().nominal, east=-13.0))
    assert np.isinf(energy_J) and np.isinf(seconds)
    assert np.isnan(ground_speed(np.array(12.0), np.radians(course), np.array(-13.0), np.array(0.0)))


def test_a_climb_by_an_electrical_curve_takes_the_rise_over_the_efficiency() -> None:
    result = source(electrical=True)
    level, climb = (energy_of(straight(3000.0, 0.0, h), 15.0, world(result.nominal))[0] for h in (0.0, 80.0))
    assert climb - level == pytest.approx(WEIGHT_N * 80.0 / 0.6, rel=1e-6)


def test_a_steep_climb_ends_on_circles() -> None:
    _, seconds = energy_of(straight(100.0, 0.0, 90.0), 15.0, world(source().nominal))
    assert seconds == pytest.approx(30.0)  # 90 m at 3 m/s


@pytest.mark.parametrize("electrical", [False, True])
def test_in_a_steep_descent_the_idle_power_remains(electrical: bool) -> None:
    result = source(electrical)
    energy_J, seconds = energy_of(straight(300.0, 0.0, -55.0), 15.0, world(result.nominal))
    assert energy_J == pytest.approx((8.0 if electrical else 0.0) * seconds)


@pytest.mark.parametrize("electrical", [False, True])
def test_a_turn_takes_the_power_of_level_flight_at_the_weight_times_the_load_factor(electrical: bool) -> None:
    power = source(electrical).nominal
    V = np.array([16.0])
    heavy = Condition(np.array([1.3 * WEIGHT_N]), np.array([RHO]), AREA_M2)
    light = heavy._replace(weight_N=np.array([WEIGHT_N]))
    turning, heavier = power.battery_W(V, light, 0.0, 1.3), power.battery_W(V, heavy, 0.0, 1.0)
    assert turning == pytest.approx(heavier, rel=1e-9)
    assert float(turning[0, 0]) > 1.1 * float(power.battery_W(V, light, 0.0, 1.0)[0, 0])


def test_circles_take_their_length_at_their_load_factor() -> None:
    power = source().nominal
    circles = straight(0.0, 0.0, turns=np.array([3.0]), radius_m=np.array([50.0]))
    energy_J, seconds = energy_of(circles, 16.0, world(power))
    assert seconds == pytest.approx(3 * 2 * np.pi * 50 / 16)
    load = np.sqrt(1 + (16**2 / (9.80665 * 50)) ** 2)
    condition = Condition(np.array([WEIGHT_N]), np.array([RHO]), AREA_M2)
    assert energy_J == pytest.approx(seconds * float(power.battery_W(np.array([16.0]), condition, 0.0, load)[0, 0]))


def test_thin_air_and_less_weight_change_the_speed_of_an_electrical_curve_by_viw() -> None:
    power = source(electrical=True).nominal
    half = Condition(np.array([WEIGHT_N]), np.array([RHO / 1.21]), AREA_M2)
    condition = Condition(np.array([WEIGHT_N]), np.array([RHO]), AREA_M2)
    thin, dense = (
        power.battery_W(np.array([15.4]), half, 0.0, 1.0),
        power.battery_W(np.array([14.0]), condition, 0.0, 1.0),
    )
    assert thin - 8.0 == pytest.approx((dense - 8.0) * 1.1, rel=1e-6)


def test_the_battery_heats_its_resistance() -> None:
    battery = BATTERY._replace(open_circuit_V=14.8, resistance_ohm=0.05)
    powers_W = battery.drawn_W(np.array([100.0, 2000.0]))
    current_A = powers_W[0] / 14.8
    assert powers_W[0] == pytest.approx(100.0 + 0.05 * current_A**2)
    assert np.isinf(powers_W[1])  # more than V^2/4R


@pytest.mark.parametrize("seed", range(12))
def test_the_best_speed_is_that_of_a_search_through_all_speeds(seed: int) -> None:
    """They agree to 0.1 % in any wind and on any course, climbing, level or descending, at no more than equal cost."""
    rng = np.random.default_rng(seed)
    result = source(electrical=seed % 3 == 0)
    windy = world(result.nominal, *rng.uniform(-6, 6, 2))
    leg = straight(rng.uniform(500, 5000), rng.uniform(0, 360), rng.uniform(-60, 60))
    limits = speed_limits(result, leg.condition, 1.2, 1.2)
    best = best_speeds(leg, limits, windy, BATTERY)
    V = np.linspace(limits.slowest[0], limits.fastest[0], 20001)
    every_J, _ = energy_and_time(leg, V[:, None], windy, BATTERY)
    brute = V[np.argmin(every_J[:, 0])]
    least_J = energy_of(leg, float(best[0]), windy)[0]
    assert least_J <= every_J.min() * (1 + 1e-6)
    assert best[0] == pytest.approx(brute, rel=1e-3)


def test_no_speed_is_slower_than_flown_or_than_the_stall_margin_allows() -> None:
    result = source()
    limits = speed_limits(result, AT, 1.2, 1.0)
    assert limits.slowest == pytest.approx(speed_at(FLOWN_CL[1], AT))
    limits = speed_limits(result, AT, 1.2, 1.2)
    assert limits.slowest == pytest.approx(1.2 * speed_at(1.2, AT))
    assert limits.fastest == pytest.approx(speed_at(FLOWN_CL[0], AT))


@pytest.mark.parametrize("wind_mps", [0.0, 6.0, 12.0])
def test_the_chosen_speeds_keep_the_stall_margin_at_every_weight(wind_mps: float) -> None:
    mission = legs("3 km 045, 2 km 135 +50 m, drop 0.8 kg, 3 km 300, 1 km 90")
    route = route_of(aerodynamic_results(), mission, flight(Wind(wind_mps, 0.0, 1.0)))
    stall_mps = speed_at(1.2, route.legs.condition)
    assert np.all(route.V >= 1.2 * stall_mps * (1 - 1e-9))
    request = route_of(aerodynamic_results(), mission, flight(Wind(wind_mps, 0.0, 1.0), speed=Speed(17.0)))
    assert request.V * np.sqrt(request.legs.condition.rho / 1.225) == pytest.approx(np.full(4, 17.0), rel=1e-4)


def test_the_mean_wind_of_a_leg_scatters_as_in_drydens_turbulence() -> None:
    """The reference is the scatter of means of the first-order process over 60 s, in steps of 0.1 s."""
    V, seconds, height_m = 15.0, 60.0, 80.0
    w20 = 6.0 * dryden.mean_wind_profile(6.1) / dryden.mean_wind_profile(height_m)
    gust = dryden.longitudinal(0.1 * float(w20), height_m, V)
    decay, step_mps = gust.discretize(0.1)
    rng = np.random.default_rng(3)
    u, total = gust.sigma_mps * rng.standard_normal(4000), np.zeros(4000)
    for _ in range(600):
        u = decay * u + step_mps * rng.standard_normal(4000)
        total += u / 600
    computed = mean_wind_sigma(6.0, np.array([height_m]), np.array([V]), np.array([seconds]))
    assert computed[0] == pytest.approx(total.std(), rel=0.05)


def test_a_turn_replaces_straight_flight_by_its_load_factor_for_its_time() -> None:
    """Turn rate is g tan(bank) over V; a load factor of 1.2 is a bank of 33.6 deg."""
    power = source().nominal
    without, turned = (
        energy_of(straight(2000.0, 0.0, turn_rad=np.array([angle])), 16.0, world(power)) for angle in (0.0, 2.0)
    )
    condition = Condition(np.array([WEIGHT_N]), np.array([RHO]), AREA_M2)
    level_W, turn_W = (float(power.battery_W(np.array([16.0]), condition, 0.0, n)[0, 0]) for n in (1.0, 1.2))
    seconds = 2.0 * 16.0 / (9.80665 * np.tan(np.arccos(1 / 1.2)))
    assert turned[0] - without[0] == pytest.approx(seconds * (turn_W - level_W), rel=1e-9)
    assert turned[1] == without[1]


def test_legs_turn_the_short_way() -> None:
    route = route_of(aerodynamic_results(), legs("2 km 350, 2 km 010, 2 km 280, 2 km 170, 2 km 190"), flight())
    assert np.degrees(route.legs.turn_rad) == pytest.approx([0.0, 20.0, 90.0, 110.0, 20.0])


def test_the_draws_are_as_wide_as_wind_turbulence_and_airspeed_are_uncertain() -> None:
    mission, wind = legs("2 km 000, 2 km 090"), Wind(0.0, 8.0, 1.2)
    route = route_of(aerodynamic_results(), mission, flight(wind))
    worlds = route.world_draws
    between = (worlds.wind_east_mps[:, 0] - worlds.wind_east_mps[:, 1]).std() / np.sqrt(2)
    _, seconds = energy_and_time(route.legs, route.V, route.nominal, BATTERY)
    of_leg = mean_wind_sigma(8.0, np.ones(2), route.V, seconds[0])
    assert between == pytest.approx(np.sqrt(np.mean(of_leg**2)), rel=0.1)
    assert worlds.wind_north_mps.mean(axis=1).std() == pytest.approx(1.2, rel=0.15)
    assert worlds.airspeed.std() == pytest.approx(0.0125, rel=0.1)


def test_a_speed_over_the_ground_is_flown_with_the_airspeed_that_makes_it() -> None:
    step = legs("2 km 060").steps[0]._replace(speed=Speed(12.0, over_ground=True))
    route = route_of(aerodynamic_results(), legs("2 km 060")._replace(steps=(step,)), flight(Wind(4.0, -5.0, 1.0)))
    assert ground_speed(route.V, route.legs.course_rad, np.array(4.0), np.array(-5.0)) == pytest.approx([12.0])
    assert route.V == pytest.approx([np.hypot(12 * np.sin(np.pi / 3) - 4.0, 12 * np.cos(np.pi / 3) + 5.0)])


def test_no_climb_is_steeper_than_full_throttle_allows() -> None:
    route = route_of(aerodynamic_results(), legs("100 m 000 +90 m"), flight(climb_mps=50.0))
    best_mps = route.source.nominal.best_climb_mps(route.V, route.legs.condition)[0]
    assert route.legs.rate_mps == pytest.approx(0.92 * best_mps)


def test_the_stall_is_where_the_wing_carried_most_not_where_a_gust_took_the_airspeed() -> None:
    """In gusts, airspeed falls to the speed of level flight at C_L = 1; the wing carried at most 0.9."""
    results = aerodynamic_results()
    assert results.slowest_flown is not None
    slowest = msgspec.structs.replace(results.slowest_flown, largest_lift_coefficient=0.9)
    source = source_of(msgspec.structs.replace(results, slowest_flown=slowest), None, 10, np.random.default_rng(1))
    assert source.largest_CL == 0.9
    assert source_of(aerodynamic_results(slowest_flown=None), None, 10, np.random.default_rng(1)).largest_CL == 1.0
