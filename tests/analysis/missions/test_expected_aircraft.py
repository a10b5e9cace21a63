"""In a plan's aircraft, lift carries the weight and the motor drives the propeller, and its speeds follow from that."""

from dataclasses import replace
from math import exp, pi, sqrt

import numpy as np
import pytest

from flightpower.analysis.missions import expected_aircraft as of_module
from flightpower.analysis.missions import time_history as of_time_history
from flightpower.analysis.missions.expected_aircraft import ExpectedAircraft, expected_aircraft
from flightpower.analysis.missions.pieces import Pilot, Run, Space
from flightpower.analysis.missions.search import Request, plan_flight
from flightpower.analysis.missions.time_history import climb_rate_mps
from flightpower.flight.aircraft import Aircraft, load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller import Propeller
from flightpower.flight.units import GRAVITY_MPS2

HEIGHT_M = 500.0


@pytest.fixture(scope="module")
def aircraft() -> Aircraft:
    return load_aircraft("nexstar")


@pytest.fixture(scope="module")
def nexstar(aircraft: Aircraft) -> ExpectedAircraft:
    return expected_aircraft(aircraft, HEIGHT_M)


def test_density_is_that_of_the_standard_atmosphere_at_the_height(nexstar: ExpectedAircraft) -> None:
    assert nexstar.rho == pytest.approx(1.225 * exp(-HEIGHT_M / 10400), rel=0.002)


def test_the_drag_of_an_unknown_aircraft_is_a_parabola_about_its_least(nexstar: ExpectedAircraft) -> None:
    """The least C_D is 0.05 at C_L = 0.2, span efficiency is 0.75, and the largest C_L is 1.2."""
    A, AR = nexstar.A, nexstar.aircraft.aspect_ratio
    polar = np.polynomial.Polynomial(A)
    assert polar.deriv().roots() == pytest.approx([0.2])
    assert polar(0.2) == pytest.approx(0.05)
    assert A[2] == pytest.approx(1 / (pi * 0.75 * AR))
    S = nexstar.aircraft.geometry.wing_area_m2
    for V, load in ((12.0, 1.0), (20.0, 1.0), (20.0, 2.0)):
        q = nexstar.rho * V**2 / 2
        CL = load * nexstar.aircraft.mass.weight_N / (q * S)
        assert nexstar.lift_coefficient(V, load) == pytest.approx(CL)
        assert nexstar.drag_N(V, load) == pytest.approx(q * S * polar(CL))
    assert nexstar.lift_coefficient(nexstar.stall_mps) == pytest.approx(1.2)


def test_lift_follows_alpha_by_helmbold_s_slope(nexstar: ExpectedAircraft) -> None:
    AR = nexstar.aircraft.aspect_ratio
    assert nexstar.lift_slope == pytest.approx(2 * pi * AR / (2 + sqrt(4 + AR**2)))
    slow, fast = 12.0, 24.0
    rise = nexstar.alpha_rad(slow) - nexstar.alpha_rad(fast)
    assert rise * nexstar.lift_slope == pytest.approx(
        float(nexstar.lift_coefficient(slow) - nexstar.lift_coefficient(fast))
    )
    V_of_zero_alpha = sqrt(
        2 * nexstar.aircraft.mass.weight_N / (nexstar.rho * 0.3 * nexstar.aircraft.geometry.wing_area_m2)
    )
    assert nexstar.alpha_rad(V_of_zero_alpha) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("throttle", [1.0, 0.6])
def test_the_motor_s_torque_is_the_propeller_s(nexstar: ExpectedAircraft, throttle: float) -> None:
    """The motor gets throttle times battery voltage less loss: U = k omega + R I, M = k (I - I0), (2.17)-(2.19)."""
    V = nexstar._grid_V[4]
    p = nexstar.aircraft.propulsion
    thrust_N = nexstar.thrust_N(throttle, V)
    n = float(nexstar.revps_of_thrust(np.array([V]), np.array([thrust_N]))[0])
    given_N, shaft_W = nexstar.propeller.thrust_and_power(V, n, nexstar.rho)
    assert given_N == pytest.approx(thrust_N, rel=1e-4)
    omega = 2 * pi * n
    k = 60 / (2 * pi * p.motor_kv_rpm_per_volt)
    # The converter is ideal: its current from the battery is `throttle` times the motor's.
    current = (throttle * p.battery_voltage_V - k * omega) / (
        p.motor_resistance_ohm + throttle**2 * (p.battery_resistance_ohm or 0.0)
    )
    assert k * (current - p.motor_no_load_current_A) == pytest.approx(shaft_W / omega, rel=1e-3)


def test_a_battery_s_resistance_and_the_idling_current_take_thrust(aircraft: Aircraft) -> None:
    def thrust_N(throttle: float, **change: float) -> float:
        changed = replace(aircraft, propulsion=replace(aircraft.propulsion, **change))
        return expected_aircraft(changed, HEIGHT_M).thrust_N(throttle, 15.0)

    resistance = aircraft.propulsion.battery_resistance_ohm or 0.0
    lost = [thrust_N(t) - thrust_N(t, battery_resistance_ohm=resistance + 0.05) for t in (1.0, 0.5)]
    assert lost[0] > 4 * lost[1] > 0
    current = aircraft.propulsion.motor_no_load_current_A
    assert current is not None
    assert thrust_N(0.8, motor_no_load_current_A=current + 1.0) < thrust_N(0.8)


def test_the_fastest_level_speed_is_where_full_thrust_equals_drag(nexstar: ExpectedAircraft) -> None:
    V = nexstar.fastest_mps
    assert nexstar.thrust_N(1.0, V) == pytest.approx(float(nexstar.drag_N(V)), rel=0.02)
    assert nexstar.thrust_N(1.0, 0.95 * V) > float(nexstar.drag_N(0.95 * V))
    assert nexstar.thrust_N(0.975, 15.0) == pytest.approx(
        (nexstar.thrust_N(0.95, 15.0) + nexstar.thrust_N(1.0, 15.0)) / 2
    )


def test_an_assumed_motor_turns_as_the_throttle_and_gives_the_speed_told(aircraft: Aircraft) -> None:
    keys = aircraft.keys - {"propulsion.motor_resistance"}
    result = expected_aircraft(replace(aircraft, keys=keys), HEIGHT_M, fastest_mps=30.0)
    assert result.fastest_mps == 30.0 and "a motor that gives 30 m/s" in result.basis
    assert result.thrust_N(1.0, 30.0) == pytest.approx(float(result.drag_N(30.0)), rel=0.02)
    V = np.array([result._grid_V[6]] * 2)
    thrust = np.array([result.thrust_N(throttle, V[0]) for throttle in (1.0, 0.9)])
    n = result.revps_of_thrust(V, thrust)
    assert n[1] / n[0] == pytest.approx(0.9, rel=1e-3)


def test_what_is_known_of_an_earlier_flight_is_used(aircraft: Aircraft) -> None:
    A = np.array([0.03, -0.01, 0.05])
    result = expected_aircraft(aircraft, HEIGHT_M, A=A, stall_mps=9.0)
    assert result.A is A and result.stall_mps == 9.0 and result.stall_basis == "as given"
    assert "drag of the earlier flights" in result.basis
    assert result.aircraft.mass.weight_N == pytest.approx(result.aircraft.mass_kg * GRAVITY_MPS2)


def test_any_speed_of_rotation_from_5_to_400_a_second_is_found(nexstar: ExpectedAircraft) -> None:
    n = np.array([5.2, 9.0, 90.0, 210.0, 390.0])
    V = 0.4 * n * nexstar.propeller.diameter_m
    thrust_N, _ = nexstar.propeller.thrust_and_power(V, n, nexstar.rho)
    assert nexstar.revps_of_thrust(V, thrust_N) == pytest.approx(n, rel=1e-5)


def test_thrust_is_known_from_0_8_to_4_5_times_the_stall(nexstar: ExpectedAircraft) -> None:
    """Beyond these speeds, thrust keeps its value at the end."""
    stall = nexstar.stall_mps
    for end, inside in ((0.8, 0.83), (4.5, 4.4)):
        at_the_end = nexstar.thrust_N(1.0, end * stall)
        assert nexstar.thrust_N(1.0, (2 * end - inside) * stall) == pytest.approx(at_the_end)
        assert abs(nexstar.thrust_N(1.0, inside * stall) - at_the_end) > 0.01


def test_an_assumed_motor_may_turn_at_any_speed_from_5_to_400_a_second(aircraft: Aircraft) -> None:
    """With the throttle closed, the propeller turns at five revolutions per second."""
    unknown = replace(aircraft, keys=aircraft.keys - {"propulsion.motor_resistance"})
    quick = expected_aircraft(unknown, HEIGHT_M, fastest_mps=47.0)
    assert quick.thrust_N(1.0, 47.0) == pytest.approx(float(quick.drag_N(47.0)), rel=0.01)
    n = quick.revps_of_thrust(np.array([47.0]), np.array([float(quick.drag_N(47.0))]))
    assert 205.0 < float(n[0]) < 400.0
    idle, _ = quick.propeller.thrust_and_power(20.0, 5.0, quick.rho)
    assert quick.thrust_N(0.0, 20.0) == pytest.approx(float(idle), rel=1e-6)


def with_table_to(aircraft: ExpectedAircraft, rpm: float, monkeypatch: pytest.MonkeyPatch) -> ExpectedAircraft:
    """Return the aircraft with a propeller table that ends at `rpm`."""
    propeller = aircraft.propeller
    rows = tuple(replace(row, rpm=row.rpm * rpm / propeller.rows[-1].rpm) for row in propeller.rows)
    short = Propeller(propeller.name, propeller.diameter_m, rows, beyond_zero_thrust=propeller.beyond_zero_thrust)
    monkeypatch.setattr(of_module, "load_propeller", lambda _: short)
    return expected_aircraft(aircraft.aircraft, HEIGHT_M)


def test_nothing_is_planned_beyond_the_propeller_s_table(nexstar: ExpectedAircraft, monkeypatch) -> None:
    """Steady flight and accelerations stay within it up to the highest speed; runs at full throttle are left out."""
    assert nexstar.full_throttle and nexstar.acceleration_throttle == 0.87
    short = with_table_to(nexstar, 6500.0, monkeypatch)
    fast = np.array([0.92 * short.fastest_mps])
    assert 1.6 * short.stall_mps < fast[0] < 0.92 * nexstar.fastest_mps and not short.full_throttle
    for thrust_N in (short.drag_N(fast), np.array([short.thrust_N(short.acceleration_throttle, fast[0])])):
        assert 60 * short.revps_of_thrust(fast, thrust_N)[0] <= 6500.0
    assert short.thrust_N(short.acceleration_throttle, fast[0]) > 1.05 * short.drag_N(fast)[0], "must still accelerate"
    # Drag is a parabola of lift: porpoising by 1 g has a mean (1 + sin)^2 of 1.5, a turn at 1.21 g has 1.21^2 = 1.47.
    in_turns = short.revps_of_thrust(fast, short.drag_N(fast, 1.21))[0]
    assert 0.97 * 6500 < 60 * in_turns / 0.92 <= 6500, "slower by its margin, and not by more"


def test_between_maneuvers_the_aircraft_is_no_faster_than_the_table(nexstar: ExpectedAircraft, monkeypatch) -> None:
    assert nexstar.cruise_mps == pytest.approx(1.6 * nexstar.stall_mps)
    short = with_table_to(nexstar, 5800.0, monkeypatch)
    assert 1.4 * short.stall_mps < short.cruise_mps < 1.6 * short.stall_mps
    assert short.cruise_mps == pytest.approx(0.92 * short.fastest_mps)


def test_a_table_that_begins_with_fast_blades_still_has_an_end(nexstar: ExpectedAircraft, monkeypatch) -> None:
    """Even if slow flight lies outside the table, its end limits fast flight."""
    V = np.array([1.15 * nexstar.stall_mps])
    begin = 60 * nexstar.revps_of_thrust(V, nexstar.drag_N(V))[0]
    rows = [row for row in nexstar.propeller.rows if row.rpm in (4000.0, 6000.0)]
    rows[0] = replace(rows[0], rpm=begin)
    narrow = Propeller("narrow", nexstar.propeller.diameter_m, tuple(rows))
    monkeypatch.setattr(of_module, "load_propeller", lambda _: narrow)
    assert 1.4 < expected_aircraft(nexstar.aircraft, HEIGHT_M).fastest_mps / nexstar.stall_mps < 2.2


def test_a_table_that_covers_hardly_any_speed_limits_nothing(nexstar: ExpectedAircraft, monkeypatch) -> None:
    assert with_table_to(nexstar, 4500.0, monkeypatch).fastest_mps == pytest.approx(nexstar.fastest_mps, rel=0.05)


def test_no_climb_is_planned_that_the_battery_does_not_give(nexstar: ExpectedAircraft) -> None:
    V = 1.6 * nexstar.stall_mps
    weak = replace(nexstar, _grid_thrust_N=nexstar._grid_thrust_N * 1.4 * nexstar.drag_N(V) / nexstar.thrust_N(1.0, V))
    assert climb_rate_mps(weak) == pytest.approx(
        0.92 * V * 0.4 * float(nexstar.drag_N(V)) / nexstar.aircraft.mass.weight_N, rel=1e-6
    )
    assert climb_rate_mps(weak) < climb_rate_mps(nexstar)


@pytest.mark.parametrize("stall_mps", [0.01, 1.0, 30.0, 100.0])
def test_a_stall_speed_that_no_wing_has_is_refused(aircraft: Aircraft, stall_mps: float) -> None:
    """For a largest C_L of 0.25 to 4, the stall speed is 1/1.8 to 2.2 times the stall speed for C_L = 1.2."""
    with pytest.raises(InputError, match=r"a stall speed of .* 5\.9 to 23\.6 m/s is possible") as refused:
        expected_aircraft(aircraft, HEIGHT_M, stall_mps=stall_mps)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("stall_mps", [21.0, 23.0])
def test_a_plan_without_a_speed_between_stall_and_full_throttle_is_refused(
    aircraft: Aircraft, stall_mps: float
) -> None:
    """Full throttle gives 24.5 m/s, of which 92 % are planned; the slowest speed is 9 % above the stall."""
    request = Request(21.0, 5.0, Space(500.0, 40.0), Pilot(False, 1.0))
    with pytest.raises(InputError, match=r"is not below the fastest that is planned, 22\.\d m/s"):
        plan_flight(expected_aircraft(aircraft, 40.0, stall_mps=stall_mps), request)


def test_a_run_without_thrust_stays_at_half_the_stall(nexstar: ExpectedAircraft) -> None:
    """It does not fly backward, although the drag of level flight grows without limit as speed goes to zero."""
    halted = of_time_history.paths([Run(0.1, 1.0, 30.0)], nexstar, HEIGHT_M, airborne=True)[0]
    assert halted.V[-1] == pytest.approx(nexstar.stall_mps / 2)
    assert np.all(np.diff(halted.V) <= 0)


def test_a_plan_knows_that_a_table_was_computed(aircraft: Aircraft) -> None:
    """If the aircraft file does not state the uncertainty of thrust, it is that of a computed table."""
    silent = replace(aircraft, keys=aircraft.keys - {"uncertainty.thrust_scale", "uncertainty.thrust_slope"})
    assert expected_aircraft(aircraft, HEIGHT_M).aircraft.uncertainty == aircraft.uncertainty
    assert expected_aircraft(silent, HEIGHT_M).aircraft.uncertainty.thrust_scale_fraction == pytest.approx(
        0.17, abs=0.01
    )
