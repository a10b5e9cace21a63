"""The time history of a plan is a motion that physics allows, and its maneuvers are those of the plan."""

from math import pi

import numpy as np
import pytest

from flightpower.analysis.missions.expected_aircraft import ExpectedAircraft, expected_aircraft
from flightpower.analysis.missions.pieces import Hold, Land, Maneuver, Porpoise, Run, Stand, TakeOff, Turn
from flightpower.analysis.missions.plan_settings import PATH
from flightpower.analysis.missions.time_history import (
    TimeHistory,
    _landing,
    _take_off,
    _towards,
    climb_rate_mps,
    fly,
    throttle_at,
)
from flightpower.analysis.trajectory.priors import BENCH_SIGMA
from flightpower.flight import motion
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.units import GRAVITY_MPS2 as g

HEIGHT_M, WIND_MPS = 40.0, 3.0
FLOWN: list[Maneuver] = [
    Stand(20.0),
    TakeOff(16.0),
    Hold(10.0, 17.0),
    Turn(17.0, pi, 0.6),
    Run(0.9, 5.0, 24.0),
    Hold(20.0, 17.0),
    Porpoise(20.0, 17.0, 0.5, 1.8, 1.2),
    Land(16.0),
    Stand(10.0),
]


@pytest.fixture(scope="module")
def nexstar() -> ExpectedAircraft:
    return expected_aircraft(load_aircraft("nexstar"), HEIGHT_M)


@pytest.fixture(scope="module")
def history(nexstar: ExpectedAircraft) -> TimeHistory:
    return fly(FLOWN, nexstar, HEIGHT_M, WIND_MPS)


def part(history: TimeHistory, kind: type) -> slice:
    """Return the rows of the first maneuver of a kind."""
    i = next(i for i, maneuver in enumerate(FLOWN) if isinstance(maneuver, kind))
    return slice(*(round(float(s) / PATH.step_s) for s in history.starts_s[i : i + 2]))


def test_attitude_rates_and_accelerations_belong_to_one_motion(history: TimeHistory) -> None:
    """Body rates turn the attitude; specific force and gravity change the velocity over the ground."""
    table = history.table
    rates = motion.attitude_derivative(
        history.attitude[:, 0], history.attitude[:, 1], *(table[f"{axis}_radps"].to_numpy() for axis in "pqr")
    )
    still = table["V_mps"].isna().to_numpy()  # sensors at rest show noise
    for i, rate in enumerate(rates):
        expected = np.gradient(history.attitude[:, i], PATH.step_s)
        assert rate[~still] == pytest.approx(expected[~still], abs=1e-9)
    force = (table[f"a{axis}_mps2"].to_numpy() for axis in "xyz")
    felt = motion.earth_from_body(force, history.attitude.T)
    for i, component in enumerate(felt):
        expected = np.gradient(history.velocity[:, i], PATH.step_s) - (g if i == 2 else 0.0)
        assert component[~still] == pytest.approx(expected[~still], abs=1e-9)
    moved = np.gradient(history.position_m, PATH.step_s, axis=0)
    assert np.allclose(moved[5:-5], history.velocity[5:-5, :2], atol=0.5)
    assert history.position_m[-1] == pytest.approx(
        np.trapezoid(history.velocity[:, :2], dx=PATH.step_s, axis=0), abs=0.5
    )
    assert np.allclose(history.velocity, table[[f"gps_{axis}_mps" for axis in ("north", "east", "down")]])


def test_the_airspeed_is_the_velocity_relative_to_the_wind(history: TimeHistory, nexstar: ExpectedAircraft) -> None:
    table = history.table
    high = (table["height_m"] > 30).to_numpy()
    air = history.velocity - np.column_stack([history.wind, np.zeros(len(table))])
    assert np.allclose(np.linalg.norm(air, axis=1)[high], table["V_mps"][high], atol=1e-6)
    # A wind from 310 deg blows toward the southeast, with the strength requested at the height of the flight.
    level = np.abs(table["height_m"] - HEIGHT_M) < 1.0
    assert np.allclose(np.linalg.norm(history.wind, axis=1)[level], WIND_MPS, rtol=0.01)
    assert np.degrees(np.arctan2(*-history.wind[high][0][::-1])) % 360 == pytest.approx(310.0)
    low = (table["height_m"] < 15).to_numpy()
    assert np.linalg.norm(history.wind[low], axis=1).max() < 0.95 * WIND_MPS
    standing = part(history, Stand)
    assert np.abs(history.velocity[standing]).max() == 0.0
    assert np.allclose(table["qbar_Pa"][high], nexstar.rho / 2 * table["V_mps"][high] ** 2)


def test_lift_carries_the_load_and_thrust_the_drag_the_climb_and_the_acceleration(
    history: TimeHistory, nexstar: ExpectedAircraft
) -> None:
    table = history.table
    for kind in (Hold, Turn, Run, Porpoise):
        rows = part(history, kind)
        inside = slice(rows.start + 60, rows.stop - 60)
        some = table.iloc[inside]
        V, alpha = some["V_mps"].to_numpy(), some["alpha_rad"].to_numpy()
        normal = some["ax_mps2"].to_numpy() * np.sin(alpha) - some["az_mps2"].to_numpy() * np.cos(alpha)
        assert np.allclose(nexstar.alpha_rad(V, normal / g), alpha, atol=0.004), kind
        along = some["ax_mps2"].to_numpy() * np.cos(alpha) + some["az_mps2"].to_numpy() * np.sin(alpha)
        thrust = some["thrust_N"].to_numpy()
        expected = nexstar.drag_N(V, normal / g) + nexstar.aircraft.mass_kg * along
        assert np.allclose(thrust, expected, atol=0.03 * np.abs(thrust).max()), kind
        thrust_of_table, _ = nexstar.propeller.thrust_and_power(V, some["n_revps"].to_numpy(), nexstar.rho)
        assert np.allclose(thrust_of_table * np.cos(alpha), thrust, atol=0.02), kind
    assert (table["beta_rad"].dropna() == 0).all()
    assert table["rho"].eq(nexstar.rho).all()
    assert table["V_mps"].notna().equals(table["flying"]) and table["flying"].equals(table["propeller_covered"])


def test_the_probe_s_dynamic_pressure_follows_alpha_as_a_hemisphere_does(history: TimeHistory) -> None:
    """Around a sphere the pressure at an angle theta from the stagnation point is q (1 - 9/4 sin^2 theta).

    With the alpha holes at 45 deg, the difference is dp = q 9/4 sin 2 alpha, and the hole at the center reads
    q_c = q (1 - 9/4 sin^2 alpha). The columns are derivatives with respect to ln dp at constant q_c.
    """
    flying = history.table[history.table["flying"]]
    alpha = flying["alpha_rad"].to_numpy()
    assert np.ptp(alpha) > 0.05

    def q_over_qc(a: np.ndarray) -> np.ndarray:
        return 1 / (1 - 9 / 4 * np.sin(a) ** 2)

    def dp_over_q(a: np.ndarray) -> np.ndarray:
        return 9 / 4 * np.sin(2 * a)

    result = flying["dlnV_dlndp_alpha"].to_numpy()
    step = 1e-5
    dlnV = (np.log(q_over_qc(alpha + step)) - np.log(q_over_qc(alpha - step))) / 2
    dp = [dp_over_q(alpha + h) * q_over_qc(alpha + h) for h in (-step, 0.0, step)]
    dlndp = (dp[2] - dp[0]) / dp[1]
    large = np.abs(alpha) > 0.02
    assert np.allclose(result[large], (dlnV / dlndp)[large], rtol=1e-6)
    angle = flying["dalpha_dlndp_alpha_rad"].to_numpy()
    assert np.allclose(angle[large], (2 * step / dlndp)[large], rtol=1e-6)


def test_a_flight_takes_off_climbs_and_lands_at_its_rates(history: TimeHistory, nexstar: ExpectedAircraft) -> None:
    table = history.table
    up, down = part(history, TakeOff), part(history, Land)
    for rows, sign in ((up, -1.0), (down, 1.0)):
        between = (table["height_m"].iloc[rows] > 21) & (table["height_m"].iloc[rows] < HEIGHT_M - 5)
        assert np.allclose(history.velocity[rows, 2][between], sign * climb_rate_mps(nexstar), atol=0.1)
    assert climb_rate_mps(nexstar) == pytest.approx(0.3 * nexstar.stall_mps)
    assert table["height_m"].iloc[up.stop] == pytest.approx(HEIGHT_M, abs=3.0)
    assert table["height_m"].iloc[-1] == pytest.approx(0.0, abs=1.0)
    V = np.linalg.norm(history.velocity - np.pad(history.wind, ((0, 0), (0, 1))), axis=1)
    assert V[up.stop - 2] == pytest.approx(16.0, abs=0.01) and np.ptp(V[up.start + 330 : up.stop]) < 0.01
    assert len(history.rest) == 2
    assert [rows.stop - rows.start for rows in history.rest] == pytest.approx(
        [20 / PATH.step_s, 10 / PATH.step_s], abs=3
    )


def test_sensors_at_rest_show_their_bench_noise_and_flight_begins_at_seven_tenths_of_the_stall(
    history: TimeHistory, nexstar: ExpectedAircraft
) -> None:
    table = history.table
    for name, sigma in BENCH_SIGMA.items():
        seen = table[name].to_numpy()[history.rest[0]][5:-5]  # the specific force changes where the roll begins
        assert seen.std() == pytest.approx(sigma, rel=1e-6), name
    assert table["V_mps"].min() == pytest.approx(0.7 * nexstar.stall_mps, rel=0.05)
    assert table["dlnV_dlndp_alpha"].notna().equals(table["flying"])


def test_on_the_ground_the_wind_moves_the_aircraft_by_the_share_of_its_speed(
    history: TimeHistory, nexstar: ExpectedAircraft
) -> None:
    """At rest wind does not move it; above stall speed it moves with the air."""
    rows = part(history, TakeOff)
    rolling = rows.start + round(5.0 / PATH.step_s)
    V = float(_take_off(nexstar, 16.0, HEIGHT_M).V[rolling - rows.start])
    assert 0.1 < V / nexstar.stall_mps < 0.9
    sideways = np.array([np.sin(history.attitude[0, 2]), -np.cos(history.attitude[0, 2])])
    drift = history.velocity[rolling, :2] @ sideways / (history.wind[rolling] @ sideways)
    assert drift == pytest.approx(V / nexstar.stall_mps, rel=1e-6)


def test_a_part_of_a_plan_begins_at_its_height(nexstar: ExpectedAircraft) -> None:
    level = fly([Hold(4.0, 17.0)], nexstar, HEIGHT_M, 0.0, airborne=True).table
    assert level["height_m"].to_numpy() == pytest.approx(np.full(len(level), HEIGHT_M), abs=0.5)


def test_a_hold_reaches_its_speed_as_a_pilot_does(nexstar: ExpectedAircraft) -> None:
    """Speed changes with a time constant of 2 s, at up to 1.5 m/s^2 and no faster than drag without thrust allows."""
    slower = fly([Hold(5.0, 20.0), Hold(30.0, 13.0)], nexstar, HEIGHT_M, 0.0, airborne=True).table["V_mps"].to_numpy()
    rate = np.diff(slower) / PATH.step_s
    drag = nexstar.drag_N(slower[:-1]) / nexstar.aircraft.mass_kg
    assert (rate > -1.05 * drag)[150:].all() and rate[150:].min() < -0.6
    assert slower[-1] == pytest.approx(13.0, abs=0.01)
    faster = fly([Hold(5.0, 14.0), Hold(30.0, 20.0)], nexstar, HEIGHT_M, 0.0, airborne=True).table["V_mps"].to_numpy()
    assert 0.9 < (np.diff(faster)[130:] / PATH.step_s).max() <= 1.5 + 1e-9
    near = np.abs(20.0 - faster) < 1.0
    remaining = 20.0 - faster[near & (np.arange(len(faster)) > 130)]
    assert remaining[50] / remaining[0] == pytest.approx(np.exp(-50 * PATH.step_s / 2.0), rel=0.05)


def test_a_run_ramps_its_throttle_and_ends_at_its_speed(nexstar: ExpectedAircraft) -> None:
    assert nexstar.thrust_N(throttle_at(nexstar, 18.0), 18.0) == pytest.approx(float(nexstar.drag_N(18.0)), rel=0.01)
    V = fly([Hold(8.0, 15.0), Run(1.0, 4.0, 22.0, 60.0)], nexstar, HEIGHT_M, 0.0, airborne=True).table["V_mps"]
    V = V.to_numpy()
    begin = round(8.0 / PATH.step_s)
    assert V[-1] == pytest.approx(22.0, abs=0.2)
    m, first = nexstar.aircraft.mass_kg, throttle_at(nexstar, 15.0)
    for seconds in (1.0, 2.0, 3.0, 4.5):
        i = begin + round(seconds / PATH.step_s)
        throttle = first + (1.0 - first) * min(seconds / 4.0, 1.0)
        rate = (V[i + 1] - V[i - 1]) / (2 * PATH.step_s)
        assert rate == pytest.approx((nexstar.thrust_N(throttle, V[i]) - float(nexstar.drag_N(V[i]))) / m, abs=0.06)
    down = fly([Hold(12.0, 20.0), Run(0.4, 2.5, 15.0, 60.0)], nexstar, HEIGHT_M, 0.0, airborne=True).table["V_mps"]
    assert down.iloc[-1] == pytest.approx(15.0, abs=0.1) and len(down) * PATH.step_s < 40.0


def test_a_turn_rolls_in_a_second_and_ends_wings_level(nexstar: ExpectedAircraft) -> None:
    for angle in (pi, -pi):
        history = fly([Hold(4.0, 18.0), Turn(18.0, angle, 0.6)], nexstar, HEIGHT_M, 0.0, airborne=True)
        bank = history.attitude[:, 0] * np.sign(angle)
        begin = round(4.0 / PATH.step_s)
        assert bank.max() == pytest.approx(0.6, abs=1e-6) and bank[-1] == pytest.approx(0.0, abs=1e-6)
        assert bank[begin + round(0.5 / PATH.step_s)] == pytest.approx(0.3, abs=0.03)
        assert history.attitude[-1, 2] == pytest.approx(angle, abs=0.03)
        assert (len(bank) - np.flatnonzero(bank > 1e-6)[-1]) * PATH.step_s == pytest.approx(4.0, abs=0.2)


def test_porpoising_goes_from_the_first_period_to_the_last(history: TimeHistory) -> None:
    rows = part(history, Porpoise)
    load = -history.table["az_mps2"].to_numpy()[rows] / g - 1.0
    up = np.flatnonzero((load[:-1] < 0) & (load[1:] >= 0)) * PATH.step_s
    periods = np.diff(up)
    assert periods[1] == pytest.approx(1.75, abs=0.08) and periods[-2] == pytest.approx(1.24, abs=0.08)
    assert load[100:-100].max() == pytest.approx(0.5, abs=0.06)
    assert np.abs(load[:5]).max() < 0.2  # porpoising begins gently


@pytest.mark.parametrize("height_m", [12.0, 40.0, 90.0])
def test_a_take_off_gains_its_height_and_begins_and_ends_smoothly(nexstar: ExpectedAircraft, height_m: float) -> None:
    """Speed rises from zero as a fifth-order polynomial, steepest in the middle at 15/8 of its mean rate."""
    path = _take_off(nexstar, 16.0, height_m)
    V, seconds = path.V, PATH.take_off_s
    rising = round(seconds / PATH.step_s)
    # While it is slow, the climb angle is limited to half a radian, which costs the height of the first seconds.
    assert 0.9 * height_m < float(np.sum(V * np.sin(path.climb)) * PATH.step_s) <= height_m + 0.01
    assert V[rising - 1 :] == pytest.approx(16.0) and V[rising // 2 - 1] == pytest.approx(8.0, rel=0.01)
    assert np.diff(V).max() / PATH.step_s == pytest.approx(15 / 8 * 16.0 / seconds, rel=0.01)
    assert V[0] < 0.01 and path.climb[-1] == 0.0 and np.degrees(np.abs(path.climb).max()) < 30.01
    end = _landing(nexstar, 20.0, 16.0, height_m)
    assert float(np.sum(end.V * np.sin(end.climb)) * PATH.step_s) == pytest.approx(-height_m, rel=0.15)
    assert end.V[0] == pytest.approx(20.0, abs=0.2) and end.V[-1] < 0.01 and len(end.V) == len(V)


def test_thrust_carries_the_weight_s_component_in_a_climb(nexstar: ExpectedAircraft) -> None:
    """m Vdot = T - D - m g sin(climb) holds, at angles of attack at which lift carries m g cos(climb)."""
    history = fly([Stand(2.0), TakeOff(16.0), Hold(2.0, 16.0)], nexstar, 90.0, 0.0)
    rows = slice(-round(17.0 / PATH.step_s), -round(12.0 / PATH.step_s))  # climbing at a constant rate
    climb = np.arcsin(-history.velocity[rows, 2] / 16.0)
    assert climb == pytest.approx(np.arcsin(climb_rate_mps(nexstar) / 16.0), rel=1e-3)
    expected = nexstar.drag_N(np.full(len(climb), 16.0), np.cos(climb)) + nexstar.aircraft.mass_kg * g * np.sin(climb)
    assert history.table["thrust_N"].to_numpy()[rows] == pytest.approx(expected, rel=1e-3)
    flying = history.table["V_mps"].notna()
    assert history.table["thrust_N"][flying].to_numpy()[-1] == pytest.approx(float(nexstar.drag_N(16.0)), rel=1e-3)


@pytest.mark.parametrize(("V", "wanted"), [(12.0, 20.0), (24.0, 12.0), (17.0, 17.0)])
def test_a_change_of_speed_is_limited_by_thrust_and_drag_and_then_ends_by_the_lag(
    nexstar: ExpectedAircraft, V: float, wanted: float
) -> None:
    """Drag limits deceleration, and full throttle less drag acceleration; within these, speed follows the lag."""
    speeds = _towards(nexstar, V, wanted, 1500)
    change = np.diff(speeds) / PATH.step_s
    drag_mps2 = nexstar.drag_N(speeds[:-1]) / nexstar.aircraft.mass_kg
    spare_mps2 = np.array([nexstar.thrust_N(1.0, v) for v in speeds[:-1]]) / nexstar.aircraft.mass_kg - drag_mps2
    by_lag = (wanted - speeds[:-1]) / PATH.speed_lag_s
    low, high = -drag_mps2, np.clip(spare_mps2, 0.05, PATH.hardest_mps2)
    cell = 0.2  # the limits are read from a grid
    assert change == pytest.approx(np.clip(by_lag, low, high), abs=cell)
    free = (by_lag > low + cell) & (by_lag < high - cell)
    assert free.sum() > 1000 and change[free] == pytest.approx(by_lag[free], abs=1e-9)
    assert speeds[-1] == pytest.approx(wanted, abs=1e-9)
    assert (wanted == V) or np.any(np.abs(by_lag) > np.abs(change) + cell), "the limits must be reached"
