"""Energy left and probabilities agree with flights in random worlds that are simulated in small time steps."""

import msgspec
import numpy as np
import pytest
from route_data import (
    AREA_M2,
    BATTERY,
    CALM,
    WEIGHT_N,
    aerodynamic_results,
    electrical_results,
    flight,
    legs,
    parameters,
    route_of,
)

from flightpower.analysis.curve import Condition
from flightpower.analysis.missions.energy import energy_and_time
from flightpower.analysis.missions.mission import Speed, Wind
from flightpower.analysis.missions.power import AerodynamicPower, _overall_efficiency
from flightpower.analysis.missions.prediction import NoReturn, Objective, Route, predict
from flightpower.analysis.missions.route_text import _no_return
from flightpower.analysis.performance.stored_model import model_of
from flightpower.analysis.records.flight import PowerPoint
from flightpower.analysis.trajectory import dryden
from flightpower.flight.errors import InputError

TRIANGLE = "2 km 045, 1.5 km 135 +40 m, 2.5 km 270 -40 m"
WIND = Wind(4.0, -2.0, 1.0)


def flown(route: Route, rng: np.random.Generator, worlds: int, power_sigma: float = 0.03) -> np.ndarray:
    """Return the energy [J] of the route (worlds,) in random worlds, in steps of two seconds.

    Polar, train and losses are drawn from their covariance. The wind's mean is wrong, and turbulence is added to it as
    a process in time. Power is wrong by `power_sigma`; half of its variance is common to all legs, half is per leg.
    """
    model_parameters, step_s = parameters(), 2.0
    values = rng.multivariate_normal(model_parameters.values, model_parameters.covariance, worlds)
    columns = {name: values[:, i : i + 1] for i, name in enumerate(model_parameters.names)}
    power = AerodynamicPower(columns, model_of(aerodynamic_results().use.model), 0.0)
    wind = route.flight.wind
    mean = np.array([[wind.east_mps], [wind.north_mps]]) + wind.sd_mps * rng.standard_normal((2, worlds))
    airspeed = 1 + 0.0125 * rng.standard_normal((worlds, 1))
    common = rng.standard_normal(worlds)
    gust = dryden.longitudinal(
        0.1 * wind.mps * float(dryden.mean_wind_profile(6.1) / dryden.mean_wind_profile(80.0)), 80.0, 15.0
    )
    decay, increment = gust.discretize(step_s)
    u, total_J = gust.sigma_mps * rng.standard_normal((2, worlds)), np.zeros(worlds)
    L = route.legs
    for i in range(len(L)):
        V = route.V[i] * airspeed
        condition = Condition(np.array([WEIGHT_N]), L.condition.rho[i : i + 1], AREA_M2)
        course = L.course_rad[i]
        blown = np.hypot(*wind[:2]) * np.cos(np.arctan2(wind.east_mps, wind.north_mps) - course)
        sine = np.full_like(V, L.climb_m[i] / (L.distance_m[i] / (route.V[i] + blown)) / route.V[i])
        level_W = power.battery_W(V, condition, sine, 1.0)[:, 0]
        turn_W = power.battery_W(V, condition, 0.0, L.turn_load)[:, 0]
        turn_s = L.turn_rad[i] * V[:, 0] / (9.80665 * np.sqrt(L.turn_load**2 - 1))
        off = 1 + power_sigma / np.sqrt(2) * (common + rng.standard_normal(worlds))
        covered, seconds = np.zeros(worlds), np.zeros(worlds)
        for _ in range(600):
            air = mean + u
            along = air[0] * np.sin(course) + air[1] * np.cos(course)
            across = air[0] * np.cos(course) - air[1] * np.sin(course)
            speed = np.sqrt(V[:, 0] ** 2 - across**2) + along
            seconds += np.clip((L.distance_m[i] - covered) / speed, 0.0, step_s)
            covered += speed * step_s
            u = decay * u + increment * rng.standard_normal((2, worlds))
            if (covered > L.distance_m[i]).all():
                break
        total_J += off * (level_W * (seconds - turn_s) + turn_W * turn_s)
    return total_J


@pytest.fixture(scope="module", params=["aerodynamic, wind", "aerodynamic, calm"])
def route_and_worlds(request) -> tuple[Route, np.ndarray]:
    wind = CALM._replace(sd_mps=1.0) if request.param.endswith("calm") else WIND
    route = route_of(aerodynamic_results(), legs(TRIANGLE), flight(wind))
    return route, flown(route, np.random.default_rng(2001), 1200)


def test_the_interval_of_the_energy_holds_what_it_promises(route_and_worlds) -> None:
    """It contains 92 to 98 % of the worlds; the median is right to 2 %, and each end misses less than 5 %."""
    route, truth_J = route_and_worlds
    drawn_J = route.left()[0].sum(axis=1)
    low, median, high = np.quantile(drawn_J, [0.025, 0.5, 0.975])
    assert 0.92 <= np.mean((truth_J > low) & (truth_J < high)) <= 0.98
    assert median == pytest.approx(np.median(truth_J), rel=0.02)
    assert np.mean(truth_J > high) < 0.05 and np.mean(truth_J < low) < 0.05


@pytest.mark.parametrize("expected", [0.5, 0.8, 0.9, 0.95, 0.99])
def test_a_probability_of_return_is_the_share_that_returns(route_and_worlds, expected: float) -> None:
    """With a battery for which a probability is predicted, that share returns, to 3 % and the worlds' scatter."""
    route, truth_J = route_and_worlds
    drawn_J = route.left()[0].sum(axis=1)
    assert np.mean(truth_J <= np.quantile(drawn_J, expected)) == pytest.approx(
        expected, abs=0.03 + 0.03 * (1 - expected)
    )


def test_probability_and_interval_of_the_result_are_those_of_the_draws() -> None:
    """The battery's own uncertainty counts: a capacity known to 20 % makes the charge left far less certain."""
    more = predict(aerodynamic_results(), legs(TRIANGLE), flight(WIND))
    battery = BATTERY._replace(energy_J=3600 * more.energy_Wh.value / 0.79)
    sure = predict(aerodynamic_results(), legs(TRIANGLE), flight(WIND, battery=battery))
    aged = predict(aerodynamic_results(), legs(TRIANGLE), flight(WIND, battery=battery._replace(health_sd=0.2)))
    assert 0.02 < sure.probability < 0.98
    assert aged.charge_left.hi - aged.charge_left.lo > 2 * (sure.charge_left.hi - sure.charge_left.lo)
    assert more.probability > sure.probability
    assert more.charge_left.value == pytest.approx(1 - more.energy_Wh.value / 74, abs=0.005)


def test_a_curve_known_better_and_a_wind_known_better_narrow_the_interval() -> None:
    def width(wind: Wind, shrink: float) -> float:
        results = aerodynamic_results()
        assert results.use is not None and results.use.model is not None
        covariance = shrink * np.array(results.use.model.covariance)
        model = msgspec.structs.replace(results.use.model, covariance=covariance.tolist())
        use = msgspec.structs.replace(results.use, model=model)
        prediction = predict(aerodynamic_results(use=use), legs(TRIANGLE), flight(wind))
        return (prediction.energy_Wh.hi - prediction.energy_Wh.lo) / prediction.energy_Wh.value

    assert width(WIND._replace(sd_mps=0.0), 0.01) < width(WIND._replace(sd_mps=0.0), 1.0) < width(WIND, 1.0)


def test_beyond_the_point_of_no_return_the_energy_for_the_way_home_is_missing() -> None:
    """Straight out in calm air, at the same speed both ways, it is where half of the usable energy is used."""
    results = electrical_results()
    prediction = predict(results, legs("30 km 000"), flight(CALM, battery=BATTERY._replace(energy_J=40 * 3600.0)))
    usable_Wh, per_m = 0.8 * 40, prediction.legs[0].energy_Wh.value / 30_000
    assert prediction.no_return is not None
    assert prediction.no_return.route_m == pytest.approx(prediction.no_return.from_home_m)
    # In the median, half the usable energy is used on the way out; the safe point is nearer, to the step of the search.
    assert (
        prediction.no_return.from_home_m < usable_Wh / (2 * per_m) < prediction.no_return.from_home_m + 30_000 / 8 * 1.5
    )
    assert predict(results, legs("2 km 000, 2 km 180"), flight(CALM)).no_return is None
    to_the_end = flight(CALM, battery=BATTERY._replace(energy_J=40 * 3600.0, reserve=0.0))
    farther = predict(results, legs("30 km 000"), to_the_end).no_return
    assert farther is not None and farther.from_home_m > prediction.no_return.from_home_m


def test_a_leg_that_cannot_be_flown_in_some_draws_is_safe_in_none_of_these() -> None:
    """Its energy is infinite in them, without a warning; if they are many, the last safe point lies before the leg."""
    route = route_of(electrical_results(), legs("2 km 000, 2 km 180"), flight(CALM))
    energy_J, _, _ = route.left()
    with np.errstate(all="raise"):
        assert route._no_return(energy_J) is None
        energy_J[: len(energy_J) // 100, 1] = np.inf
        assert route._no_return(energy_J) is None  # 1 % lost, of 5 % allowed
        energy_J[: len(energy_J) // 10, 1] = np.inf
        no_return = route._no_return(energy_J)
    assert no_return is not None and no_return.route_m == pytest.approx(2000.0)


def test_a_leg_against_a_wind_that_wins_is_named_with_wind_and_airspeed() -> None:
    """In a wind that is 1.1 m/s weaker it can be flown, and so can a leg with the wind."""
    mission, results = legs("2 km 090, 2 km 270"), electrical_results()
    fastest = route_of(results, mission, flight(CALM)).limits.fastest[0]
    with pytest.raises(
        InputError, match=rf"^leg 2 cannot be flown: {fastest:.0f} m/s of head wind, {fastest:.0f} m/s of"
    ):
        predict(results, mission, flight(Wind(fastest, 0.0, 0.0)))
    prediction = predict(results, mission, flight(Wind(fastest - 1.1, 0.0, 0.0)))
    assert all(np.isfinite(leg.time_s.value) for leg in prediction.legs)
    with pytest.raises(
        InputError, match=r"^leg 1 cannot be flown: \d+ m/s across, \d+ m/s of airspeed; wait for less wind"
    ):
        predict(results, mission, flight(Wind(0.0, fastest + 1, 0.0)))
    predict(results, legs("2 km 090"), flight(Wind(fastest, 0.0, 0.0)))


def test_how_far_out_and_back_is_what_the_battery_gives_both_ways() -> None:
    results = electrical_results()
    calm = predict(results, legs("2 km 000"), flight(CALM))
    per_m = calm.headwind_Wh_per_km.value / 1000
    radii = np.array([direction.radius_m for direction in calm.directions])
    np.testing.assert_allclose(radii, 0.8 * 74 / (2 * per_m), rtol=0.01)
    windy = predict(results, legs("2 km 000"), flight(WIND))
    assert all(direction.safe_radius_m < direction.radius_m for direction in windy.directions)
    for there, back in zip(windy.directions, windy.directions[18:], strict=False):
        assert there.radius_m == pytest.approx(back.radius_m, rel=1e-6)  # the same two legs, in the other order
    assert max(direction.radius_m for direction in windy.directions) < radii.min()  # wind always costs energy
    assert windy.headwind_Wh_per_km.value > calm.headwind_Wh_per_km.value


def test_a_dropped_payload_saves_energy_after_it() -> None:
    text = "3 km 000{}, 3 km 180"
    carried, dropped = (
        predict(aerodynamic_results(), legs(text.format(d)), flight(CALM)).legs for d in ("", ", drop 1 kg")
    )
    assert dropped[0].energy_Wh.value == pytest.approx(carried[0].energy_Wh.value, rel=1e-3)
    assert dropped[1].energy_Wh.value < 0.85 * carried[1].energy_Wh.value
    light = predict(aerodynamic_results(), legs("3 km 180"), flight(CALM, weight_N=WEIGHT_N - 9.80665)).legs
    assert dropped[1].airspeed_mps == pytest.approx(light[0].airspeed_mps, rel=1e-3)


def test_the_fastest_route_is_the_fastest_that_full_throttle_holds() -> None:
    mission = legs("4 km 000, 4 km 180")
    slow, fast = (
        predict(aerodynamic_results(), mission, flight(WIND, speed=s)) for s in (Objective.ENERGY, Objective.TIME)
    )
    assert fast.time_s.value < 0.9 * slow.time_s.value
    assert fast.energy_Wh.value > slow.energy_Wh.value
    route = route_of(aerodynamic_results(), mission, flight(WIND, speed=Objective.TIME))
    climb = route.source.nominal.best_climb_mps(route.V, route.legs.condition)
    assert np.all(climb > 0) and np.all(route.V <= route.limits.fastest * (1 + 1e-9))


def test_a_launch_takes_the_kinetic_energy() -> None:
    results, mission = electrical_results(), legs("3 km 000")
    launched = mission._replace(steps=(mission.steps[0]._replace(launched=True),))
    energies = [route_of(results, item, flight(CALM)) for item in (mission, launched)]
    V = energies[0].V[0]
    difference_J = np.subtract(
        *(energy_and_time(r.legs, energies[0].V, r.nominal, BATTERY)[0][0, 0] for r in reversed(energies))
    )
    assert difference_J == pytest.approx(WEIGHT_N / 9.80665 * V**2 / 2 / 0.6, rel=1e-3)


def test_a_faster_leg_takes_the_gain_of_kinetic_energy_and_a_slower_one_gives_it_back() -> None:
    """From 15 to 19 m/s, the gain is m (19^2 - 15^2) / 2; it takes the efficiency of a climb."""
    steps = legs("3 km 000, 3 km 000").steps
    speeds = [Speed(mps, over_ground=False) for mps in (15.0, 19.0)]
    mission = legs("3 km 000, 3 km 000")

    def energy_J(first: Speed, second: Speed) -> np.ndarray:
        flown = mission._replace(steps=(steps[0]._replace(speed=first), steps[1]._replace(speed=second)))
        route = route_of(electrical_results(), flown, flight(CALM))
        return energy_and_time(route.legs, route.V, route.nominal, BATTERY)[0][0]

    slow, fast = (energy_J(speed, speed)[1] for speed in speeds)
    route = route_of(electrical_results(), mission, flight(CALM))
    to_true = 1 / np.sqrt(route.legs.condition.rho[1] / 1.225)
    gain_J = WEIGHT_N / 9.80665 * (19.0**2 - 15.0**2) * to_true**2 / 2 / 0.6
    assert energy_J(speeds[0], speeds[1])[1] - fast == pytest.approx(gain_J, rel=2e-3)
    assert slow - energy_J(speeds[1], speeds[0])[1] == pytest.approx(gain_J, rel=2e-3)


def test_the_same_mission_gives_the_same_result() -> None:
    first, second = (predict(aerodynamic_results(), legs(TRIANGLE), flight(WIND)) for _ in range(2))
    assert first == second


def test_the_point_of_no_return_is_reported_in_kilometers() -> None:
    no_return = _no_return(NoReturn(leg="leg 3", route_m=12_340.0, from_home_m=5_670.0), 0.95)
    assert "12.34 km along the route, on leg 3, 5.67 km from home" in no_return and "less than 95 % sure" in no_return
    assert "at least 95 %" in _no_return(None, 0.95)


@pytest.mark.parametrize(("of_battery", "result"), [(0.05, 0.1), (0.15, 0.15), (0.5, 0.5), (0.95, 0.9)])
def test_the_efficiency_is_power_required_over_that_of_the_motor_within_a_tenth_and_nine(
    of_battery: float, result: float
) -> None:
    """The battery also feeds an idle load of 5 W, and its points have other speeds than those of power required."""
    required = [PowerPoint(speed_mps=v, power_W=6 * v, power_lo_W=5 * v, power_hi_W=7 * v) for v in (12.0, 14.0)]
    battery = [
        PowerPoint(speed_mps=v, power_W=6 * v / of_battery + 5, power_lo_W=0, power_hi_W=0) for v in (10.0, 13.0, 16.0)
    ]
    assert _overall_efficiency(required, battery, 5.0) == pytest.approx(result)
