"""Inputs of the sensors: each against its physics, and the noise against its specification.

More than 350 lines: all tests share one set of constructed flights.
"""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.flight.aircraft import PneumaticLine
from flightpower.flight.atmosphere import GRAVITY_MPS2 as g
from flightpower.flight.errors import InputError
from flightpower.flight.motion import velocity_of
from flightpower.sim.sensors import FlightSensorTruth, draw, load_budget
from flightpower.sim.sensors.budget import ErrorBudget, Noise, Systematic
from flightpower.sim.sensors.noise import gauss_markov, white
from flightpower.sim.sensors.probe import flow_at_probe, port_pressures
from flightpower.sim.sensors.tray import (
    HOME_LATITUDE_DEG,
    HOME_LONGITUDE_DEG,
    PART_S,
    WARM_UP_K,
    WARM_UP_S,
    with_hysteresis,
)
from flightpower.sim.sensors.tubing import first_order_lag, time_constant_s

FOOT, INCH = 0.3048, 0.0254


def felt_with(flight, noise=None, systematic=None, seed=0) -> FlightSensorTruth:
    budget = ErrorBudget(noise=Noise(**(noise or {})), systematic=Systematic(**(systematic or {})))
    return FlightSensorTruth(flight, draw(budget, seed))


@pytest.fixture(scope="module")
def perfect(flight):
    return FlightSensorTruth(flight, draw(load_budget("none"), 0))


@pytest.fixture(scope="module")
def flown(flight):
    """Times in free flight away from the corners of commands, and the truth there."""
    rows = flight.truth[flight.truth["phase"] == "flight"].iloc[50:-50:7]
    return rows["time_s"].to_numpy(), rows


# Noise


def test_noise_is_a_pure_function_of_seed_channel_and_time():
    t = np.arange(0, 7.3, 0.005)
    noise = white(3, "a", t)
    assert np.array_equal(noise[700:900], white(3, "a", t[700:900]))
    assert np.array_equal(noise[::-1], white(3, "a", t[::-1]))
    assert not np.array_equal(noise, white(4, "a", t)) and not np.array_equal(noise, white(3, "b", t))


@pytest.mark.parametrize("rate_Hz", [25, 200])
def test_noise_is_white_and_of_unit_variance(rate_Hz):
    n = 20000
    x = white(1, "x", np.arange(n) / rate_Hz)
    assert abs(np.mean(x)) < 4 / np.sqrt(n)
    assert abs(np.std(x) - 1) < 4 / np.sqrt(2 * n)
    for lag in (1, 2, 8):
        assert abs(np.mean(x[lag:] * x[:-lag])) < 4 / np.sqrt(n)


def test_colored_noise_forgets_in_its_correlation_time():
    dt, tau, n = 0.1, 5.0, 200_000
    x = gauss_markov(2, "x", n, dt, tau)
    independent = n * dt / (2 * tau)
    assert abs(np.var(x) - 1) < 4 * np.sqrt(2 / independent)
    correlation = np.mean(x[50:] * x[:-50]) / np.var(x)
    assert correlation == pytest.approx(np.exp(-1), abs=4 / np.sqrt(independent))


# Temperature


def test_a_part_within_the_aircraft_follows_the_temperature_of_the_air_slowly(perfect, flight):
    """T_air = T + PART_S dT/dt, apart from the warming by the electronics: in a climb of 3 m/s, 1 K takes 50 s."""
    t = flight.truth["time_s"].to_numpy()
    part_K = perfect.transducer_temperature_K("static", t) - WARM_UP_K * (1 - np.exp(-t / WARM_UP_S))
    air_K = flight.truth["temperature_K"].to_numpy()
    assert np.ptp(air_K) > 0.1
    assert np.max(np.abs(part_K + PART_S * np.gradient(part_K, t) - air_K)[1:-1]) < 0.01 * np.ptp(air_K)


# Probe


def test_pair_difference_of_the_hemisphere():
    """A sphere with ports at 45 deg: dp_alpha / qbar = (9/4) sin 2 alpha (cos^2 beta besides, from the geometry)."""
    alpha, beta = np.deg2rad(np.array([-20, -5, 0, 3, 12])), np.deg2rad(np.array([4, -10, 7, 0, 0]))
    ports = port_pressures(200.0, alpha, beta)
    assert np.allclose(ports.lower_minus_upper, 200 * 9 / 4 * np.sin(2 * alpha) * np.cos(beta) ** 2)
    assert np.allclose(ports.right_minus_left[alpha == 0], 200 * 9 / 4 * np.sin(2 * beta[alpha == 0]))
    aligned = port_pressures(200.0, 0.0, 0.0)
    assert (aligned.center, aligned.lower_minus_upper, aligned.static) == pytest.approx((200, 0, 0))


def test_wind_from_the_right_presses_on_the_right_port():
    assert port_pressures(100.0, 0.0, 0.1).right_minus_left > 0
    assert port_pressures(100.0, 0.1, 0.0).lower_minus_upper > 0


def test_a_probe_on_a_boom_sees_the_rotation():
    """alpha_cg = alpha_probe - upwash + q x/V, beta_cg = beta_probe - r x/V."""
    V, alpha, beta = flow_at_probe(velocity_of(20.0, 0.05, 0.0), (0.0, 0.3, 0.2), (0.5, 0.0, 0.0), upwash_rad=0.01)
    assert alpha == pytest.approx(0.05 + 0.01 - 0.3 * 0.5 / 20, rel=0.01)
    assert beta == pytest.approx(0.2 * 0.5 / 20, rel=0.01)
    assert V == pytest.approx(20.0, rel=1e-3)


# Tubing


def test_lag_of_real_tubing():
    """The lag is 0.5 ms for 2 ft of 1/16 in and 20 ms for 3 ft of 0.02 in, at sea level with a small cavity."""
    wide = PneumaticLine(length_m=2 * FOOT, diameter_m=INCH / 16, cavity_m3=100e-9)
    narrow = PneumaticLine(length_m=3 * FOOT, diameter_m=0.02 * INCH, cavity_m3=100e-9)
    assert 0.3e-3 < time_constant_s(wide, 101325, 288) < 0.8e-3
    assert 15e-3 < time_constant_s(narrow, 101325, 288) < 30e-3


def test_a_first_order_lag_follows_a_ramp_late_by_its_time_constant():
    dt, tau = 0.005, 0.02
    t = np.arange(0, 1, dt)
    y = first_order_lag(3 * t, dt, tau)
    assert np.allclose(y, 3 * (t - tau * (1 - np.exp(-t / tau))), atol=1e-12)  # exact for a ramp, at any step
    fast = first_order_lag(3 * t, dt, 1e-4)
    assert np.allclose(fast[5:], 3 * (t[5:] - 1e-4), atol=1e-12)
    assert np.array_equal(first_order_lag(np.full(9, 7.0), dt, tau), np.full(9, 7.0))


def test_hysteresis_is_a_loop_of_the_stated_width():
    x = np.concatenate([np.linspace(0, 1, 200), np.linspace(1, 0, 200)])
    y = with_hysteresis(x, 0.02)
    assert y[:200].max() - y[200:].min() <= 1
    assert np.interp(0.5, y[:200], x[:200]) - np.interp(0.5, y[:199:-1], x[:199:-1]) == pytest.approx(0.02, abs=1e-6)


# The tray without errors


def test_standing_still_there_is_gravity_and_nothing_else(perfect):
    t = np.arange(0.1, 3.5, 0.01)
    force, rates = perfect.imu(t)
    assert np.allclose(force, [0, 0, -g], atol=1e-9) and np.allclose(rates, 0, atol=1e-9)
    for which in ("alpha", "beta", "airspeed"):
        assert np.allclose(perfect.differential_pressure_Pa(which, t), 0, atol=1e-6)
    solution = perfect.gps(t)
    assert np.allclose(solution.velocity_ned_mps, 0, atol=1e-9)
    assert np.allclose(solution.latitude_deg, HOME_LATITUDE_DEG) and np.allclose(
        solution.longitude_deg, HOME_LONGITUDE_DEG
    )
    assert np.all(perfect.motor_speed_revps(t) == 0)
    assert np.allclose(perfect.servo_pulses_us(t)[:, [0, 1, 3]], 1500)
    assert np.allclose(perfect.servo_pulses_us(t)[:, 2], 1000)


def test_air_data_contain_the_true_airspeed_and_angles(perfect, flight, flown):
    """The test inverts the closed form of the hemisphere, unlike the analysis."""
    t, truth = flown
    q_truth = truth["dynamic_pressure_Pa"].to_numpy()
    dp_alpha = perfect.differential_pressure_Pa("alpha", t)
    x, q_rate, V = flight.aircraft.probe.position_m[0], truth["q_radps"].to_numpy(), truth["V_mps"].to_numpy()
    at_probe = np.arcsin(dp_alpha / q_truth * 4 / 9) / 2
    alpha = at_probe - truth["upwash_rad"] + q_rate * x / V
    # A lag of half a millisecond, the speed at the probe, and beta give hundredths of a degree.
    assert np.max(np.abs(alpha - truth["alpha_rad"])) < np.deg2rad(0.05)
    q_c = perfect.differential_pressure_Pa("airspeed", t)
    sine2 = np.sin(at_probe) ** 2 + np.sin(truth["beta_rad"]) ** 2
    assert np.max(np.abs(q_c / (1 - 9 / 4 * sine2 + 0.2 * sine2) / q_truth - 1)) < 0.003


def test_the_static_line_and_the_barometer_show_the_height(perfect, flown):
    t, truth = flown
    assert np.allclose(perfect.absolute_pressure_Pa("baro", t), truth["static_pressure_Pa"], atol=0.01)
    crossflow = 0.2 * truth["dynamic_pressure_Pa"] * np.sin(truth["alpha_rad"] + truth["upwash_rad"]) ** 2
    assert np.allclose(perfect.absolute_pressure_Pa("static", t), truth["static_pressure_Pa"] - crossflow, atol=0.5)


def test_the_imu_is_off_the_center(flight, flown):
    """Moving the IMU forward by one meter shows the pitch acceleration and the centripetal force there."""
    t, truth = flown
    q, r = truth["q_radps"].to_numpy(), truth["r_radps"].to_numpy()
    forces = []
    for x in (0.0, 1.0):
        moved = replace(flight, aircraft=replace(flight.aircraft, imu_position_m=(x, 0.0, 0.0)))
        forces.append(FlightSensorTruth(moved, draw(load_budget("none"), 0)).imu(t)[0])
    difference = forces[1] - forces[0]
    assert np.allclose(difference[:, 0], -(q**2 + r**2), atol=1e-6)
    p = truth["p_radps"].to_numpy()
    assert np.allclose(difference[:, 2], -truth["qdot_radps2"] + p * r, atol=1e-6)


def test_the_magnetometer_shows_the_heading(perfect, flown):
    t, truth = flown
    field = perfect.magnetic_field_T(t)
    assert np.allclose(np.linalg.norm(field, axis=1), 48.5e-6)
    phi, theta = truth["roll_rad"].to_numpy(), truth["pitch_rad"].to_numpy()
    level_x = field[:, 0] * np.cos(theta) + np.sin(theta) * (field[:, 1] * np.sin(phi) + field[:, 2] * np.cos(phi))
    level_y = field[:, 1] * np.cos(phi) - field[:, 2] * np.sin(phi)
    heading = np.arctan2(-level_y, level_x)
    assert np.allclose(np.sin(heading - truth["yaw_rad"]), 0, atol=1e-6)


def test_gps_says_where_it_was_and_integrates_its_own_velocity(flight, perfect):
    t = np.arange(5.0, flight.duration_s - 5, 0.1)
    solution = perfect.gps(t)
    assert np.array_equal(solution.valid_at_s, t)
    north = np.deg2rad(solution.latitude_deg - HOME_LATITUDE_DEG) * 6_371_000
    travelled = np.concatenate(
        [[0], np.cumsum((solution.velocity_ned_mps[1:, 0] + solution.velocity_ned_mps[:-1, 0]) / 2 * 0.1)]
    )
    assert np.allclose(north - north[0], travelled, atol=0.05)
    assert np.all(solution.fix)


def test_the_autopilots_attitude_is_wrong_when_speed_changes(perfect, flight):
    """It takes the accelerometer's reading for vertical, which is wrong by 8 to 11 deg in such runs."""
    t = flight.truth["time_s"].to_numpy()
    error = np.rad2deg(perfect.autopilot_attitude_rad(t)[:, 1] - flight.truth["pitch_rad"].to_numpy())
    runs = (flight.truth["kind"] == "run").to_numpy()
    assert 6 < np.max(np.abs(error[runs])) < 25
    standing = (flight.truth["phase"] == "ground").to_numpy() & (t < 4)
    assert np.max(np.abs(error[standing])) < 0.01


def test_pulses_follow_the_aircraft_file(perfect, flight, flown):
    t, truth = flown
    pulses = perfect.servo_pulses_us(t)
    elevator = flight.aircraft.elevator
    back = [elevator.angle_of_pulse_rad(p) for p in pulses[:, elevator.channel - 1]]
    assert np.allclose(back, truth["elevator_command_rad"], atol=1e-9)


def test_outside_the_flight_everything_stands_still(perfect, flight):
    t = np.array([-5.0, flight.duration_s + 60.0])
    force, rates = perfect.imu(t)
    assert np.allclose(force, [0, 0, -g], atol=1e-6) and np.allclose(rates, 0, atol=1e-6)
    assert np.allclose(perfect.gps(t).velocity_ned_mps, 0, atol=1e-6)


# The tray with errors


def test_asked_twice_it_gives_the_same(flight):
    sensor_truth, again = (FlightSensorTruth(flight, draw(load_budget("harsh"), 7)) for _ in range(2))
    t = np.arange(0, flight.duration_s, 0.04)
    part = slice(200, 230)
    assert np.array_equal(sensor_truth.imu(t)[0][part], again.imu(t[part])[0])
    for which in ("alpha", "beta", "airspeed"):
        assert np.array_equal(
            sensor_truth.differential_pressure_Pa(which, t)[part], again.differential_pressure_Pa(which, t[part])
        )
    assert np.array_equal(sensor_truth.gps(t).velocity_ned_mps[part], again.gps(t[part]).velocity_ned_mps)


def test_bench_noise_is_table_4_1(flight):
    """At 55 ft/s and 1.2 kg/m^3: V 0.96 ft/s, alpha 0.008 rad; and on 25 Hz means a 0.19 ft/s^2, q 0.005 rad/s."""
    sensor_truth = FlightSensorTruth(flight, draw(load_budget("bench"), 1))
    t25, t200 = np.arange(0, 3.9, 0.04), np.arange(0, 3.84, 0.005)
    n = len(t25)
    spread = 4 / np.sqrt(2 * n)
    V, rho = 55 * FOOT, 1.2
    q = rho * V**2 / 2
    sigma_V = np.std(sensor_truth.differential_pressure_Pa("airspeed", t25)) / (rho * V)
    sigma_alpha = np.std(sensor_truth.differential_pressure_Pa("alpha", t25)) / (9 / 2 * q)
    assert sigma_V == pytest.approx(0.96 * FOOT, rel=spread)
    assert sigma_alpha == pytest.approx(0.008, rel=spread)
    force, rates = (x.reshape(-1, 8, 3).mean(axis=1) for x in sensor_truth.imu(t200))
    assert np.std(force, axis=0) == pytest.approx([0.19 * FOOT] * 3, rel=spread)
    assert np.std(rates, axis=0) == pytest.approx([0.005] * 3, rel=spread)


@pytest.mark.parametrize(
    ("name", "size", "component"),
    [("accel_bias_mps2", 0.3, "accel_bias"), ("gyro_bias_radps", 0.01, "gyro_bias")],
)
def test_draws_have_the_spread_that_the_budget_says(name, size, component):
    budget = ErrorBudget(systematic=Systematic(**{name: size}))
    draws = np.concatenate([getattr(draw(budget, seed), component) for seed in range(300)])
    assert np.std(draws) == pytest.approx(size, rel=4 / np.sqrt(2 * len(draws)))
    assert abs(np.mean(draws)) < 4 * size / np.sqrt(len(draws))


def test_the_study_draws_evenly_within_its_sizes():
    """Flat between its ends: the variance is a third of the square, with standard error size^2 sqrt(4/45/n)."""
    budget = load_budget("study")
    offsets = np.array([draw(budget, seed).values.alpha_offset_rad for seed in range(300)])
    size = budget.systematic.alpha_offset_rad
    assert np.abs(offsets).max() <= size == pytest.approx(np.radians(1.5))
    assert np.mean(offsets**2) == pytest.approx(size**2 / 3, abs=4 * size**2 * np.sqrt(4 / 45 / 300))


def test_lag_and_latency_are_drawn_evenly_up_to_their_longest():
    budget = ErrorBudget(systematic=Systematic(lag_s=0.02, gps_latency_s=0.3))
    lags = np.array([draw(budget, seed).values.lag_s for seed in range(300)])
    assert lags.min() >= 0 and lags.max() <= 0.02
    assert np.mean(lags) == pytest.approx(0.01, abs=4 * 0.02 / np.sqrt(12 * 300))


def test_each_systematic_error_shows_where_it_should(flight, perfect, flown):
    t, truth = flown
    q = truth["dynamic_pressure_Pa"].to_numpy()

    off = felt_with(flight, systematic={"alpha_offset_rad": 0.02}, seed=1)
    offset = off._errors.values.alpha_offset_rad
    shift = off.differential_pressure_Pa("alpha", t) - perfect.differential_pressure_Pa("alpha", t)
    assert np.allclose(shift / q, 9 / 2 * offset, rtol=0.12)  # cos 2 alpha up to 12 deg

    fast = felt_with(flight, systematic={"V_scale": 0.02}, seed=1)
    ratio = fast.differential_pressure_Pa("airspeed", t) / perfect.differential_pressure_Pa("airspeed", t)
    assert np.allclose(np.sqrt(ratio), 1 + fast._errors.values.V_scale)

    biased = felt_with(flight, systematic={"accel_bias_mps2": 0.3, "gyro_bias_radps": 0.01}, seed=1)
    for item, other, bias in zip(
        biased.imu(t), perfect.imu(t), (biased._errors.accel_bias, biased._errors.gyro_bias), strict=True
    ):
        assert np.allclose(item - other, bias)

    turned = felt_with(flight, systematic={"imu_misalignment_rad": 0.01}, seed=1)
    assert np.allclose(np.linalg.norm(turned.imu(t)[0], axis=1), np.linalg.norm(perfect.imu(t)[0], axis=1))
    assert not np.allclose(turned.imu(t)[0], perfect.imu(t)[0], atol=1e-3)

    late = felt_with(flight, systematic={"lag_s": 0.5}, seed=1)
    lag = late._errors.values.lag_s
    rising = (flight.truth["kind"] == "run") & (flight.truth["throttle"] == 1.0)
    t_run = flight.truth["time_s"][rising].to_numpy()[100:250]
    expected = perfect.differential_pressure_Pa("airspeed", t_run - lag)
    slope = np.gradient(perfect.differential_pressure_Pa("airspeed", t_run), t_run)
    assert np.max(np.abs(late.differential_pressure_Pa("airspeed", t_run) - expected) / slope) < 0.3 * lag

    slow = felt_with(flight, systematic={"gps_latency_s": 0.3}, seed=1)
    latency = slow._errors.values.gps_latency_s
    assert np.allclose(slow.gps(t).velocity_ned_mps, perfect.gps(t - latency).velocity_ned_mps, atol=1e-9)
    assert np.allclose(slow.gps(t).valid_at_s, t - latency)


def test_gps_falls_silent_when_asked(flight):
    sensor_truth = felt_with(flight, systematic={"gps_lost_s": 10.0, "gps_lost_for_s": 5.0})
    assert sensor_truth.gps(np.array([9.9, 10.0, 14.9, 15.1])).fix.tolist() == [True, False, False, True]


def test_vibration_comes_with_the_motor_and_grows_with_the_square_of_its_speed(flight):
    sensor_truth = felt_with(flight, noise={"vibration_mps2": 1.0})
    still, _ = sensor_truth.imu(np.arange(0.5, 3, 0.005))
    t = np.arange(20, 24, 0.0005)
    shaking = (sensor_truth.imu(t)[0] - felt_with(flight).imu(t)[0])[:, 0]
    assert np.allclose(still[:, 0], 0, atol=1e-9)
    # Two sines of amplitude 1 and 1/2 at 100 rev/s: mean square (1 + 1/4)/2 there.
    amplitude = (sensor_truth.motor_speed_revps(t) / 100) ** 2
    assert np.mean((shaking / amplitude) ** 2) == pytest.approx(0.625, rel=0.02)


def test_a_motor_that_stopped_with_its_propeller_anywhere_does_not_push(flight):
    sensor_truth = felt_with(flight, noise={"vibration_mps2": 1.0})
    turns = np.linspace(0.0, 1.0, 50)
    assert np.all(sensor_truth._vibration(turns, np.zeros(50)) == 0)


def test_the_harsh_budget_has_the_sizes_of_the_study():
    s = load_budget("harsh").systematic
    result = (np.rad2deg(s.alpha_offset_rad), s.accel_bias_mps2, np.rad2deg(s.imu_misalignment_rad), s.gyro_bias_radps)
    assert result == pytest.approx((1.5, 0.3, 0.5, 0.01))
    assert (s.thrust_scale, s.V_scale, s.lag_s) == (0.03, 0.02, 0.02)
    assert s.alpha_scale > 0 and s.thrust_slope_J > 0


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('[noise]\naccel = "1 m"\n', "accel"),
        ("[noise]\naccell = 1\n", "accell"),
        ('[systematic]\nthrust_scale = "3 %"\n', "thrust_scale"),
        ("[noise\n", "TOML"),
    ],
)
def test_a_broken_budget_is_one_clear_line(tmp_path, text, expected):
    path = tmp_path / "mine.toml"
    path.write_text(text, "utf-8")
    with pytest.raises(InputError, match=expected) as caught:
        load_budget(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_an_unknown_budget_lists_those_there_are():
    with pytest.raises(InputError, match="bench, harsh, none"):
        load_budget("kind")
