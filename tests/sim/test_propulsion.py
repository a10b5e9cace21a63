"""The power train: no energy from nowhere, and the throttle that holds a speed."""

import numpy as np
import pytest

from flightpower.flight.aircraft import parse_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.fly import fly
from flightpower.sim.plan import parse_plan
from flightpower.sim.propulsion import power_train, throttle_for, torque_constant

RHO = 1.2
GLIDE = """
height = "100 m"
[[segment]]
kind = "hold"
duration = "2 s"
speed = "20 m/s"
[[segment]]
kind = "run"
throttle = 0.0
speed_over_stall = 1.1
longest = "4 s"
"""


@pytest.fixture(scope="module")
def propulsion(nexstar):
    return nexstar.propulsion


@pytest.fixture(scope="module")
def propeller(nexstar):
    return load_propeller(nexstar.propulsion.propeller)


def test_electrical_power_is_shaft_power_and_losses(propulsion, propeller):
    """At steady speed: battery output = propeller + friction + heat in the winding; plus heat in the battery."""
    for V, n in ((0.0, 90.0), (15.0, 100.0), (24.0, 125.0)):
        throttle = float(throttle_for(propulsion, propeller, V=V, n=n, rho=RHO))
        assert 0 < throttle <= 1.2
        train = power_train(propulsion, propeller, V=V, n=n, throttle=throttle, rho=RHO)
        assert train.motor_acceleration_revps2 == pytest.approx(0.0, abs=1e-8)
        i = train.battery_current_A / throttle
        k = torque_constant(propulsion)
        friction = 2 * np.pi * n * k * propulsion.motor_no_load_current_A
        heat = i**2 * propulsion.motor_resistance_ohm
        assert train.battery_voltage_V * train.battery_current_A == pytest.approx(
            train.shaft_power_W + friction + heat, rel=1e-9
        )
        assert train.battery_voltage_V == pytest.approx(
            propulsion.battery_voltage_V - train.battery_current_A * propulsion.battery_resistance_ohm
        )


def test_an_unloaded_motor_turns_at_kv_times_volts(propulsion):
    """This is what kv means, up to the drop by the no-load current; the propeller is taken off (air of no density)."""
    propeller = load_propeller(propulsion.propeller)
    n = propulsion.motor_kv_rpm_per_volt * propulsion.battery_voltage_V / 60
    i = propulsion.motor_no_load_current_A
    drop = i * (propulsion.motor_resistance_ohm + propulsion.battery_resistance_ohm) / propulsion.battery_voltage_V
    train = power_train(propulsion, propeller, V=0.0, n=n * (1 - drop), throttle=1.0, rho=1e-12)
    assert train.motor_acceleration_revps2 == pytest.approx(0.0, abs=1e-6)


def test_the_speed_controller_freewheels(propulsion, propeller):
    """The throttle is shut at speed: no current flows either way, thrust becomes drag, and the windmill finds its
    speed."""
    V = 25.0
    fast = power_train(propulsion, propeller, V=V, n=140.0, throttle=0.0, rho=RHO)
    assert fast.battery_current_A == 0 and fast.motor_acceleration_revps2 < 0
    slow = power_train(propulsion, propeller, V=V, n=40.0, throttle=0.0, rho=RHO)
    assert slow.motor_acceleration_revps2 > 0 > slow.thrust_N


def test_a_stopped_motor_stays_stopped(propulsion, propeller):
    train = power_train(propulsion, propeller, V=0.0, n=0.0, throttle=0.0, rho=RHO)
    assert train.motor_acceleration_revps2 == pytest.approx(
        0.0, abs=10.0
    )  # [rev/s^2], of the propeller's slowest 5 rev/s
    assert train.battery_current_A == 0


def test_more_throttle_than_the_battery_has_is_reported(propulsion, propeller):
    assert throttle_for(propulsion, propeller, V=0.0, n=400.0, rho=RHO) == np.inf
    assert throttle_for(propulsion, propeller, V=30.0, n=60.0, rho=RHO) == 0.0


def test_a_folding_propeller_neither_brakes_nor_drives(propulsion, propeller):
    """Beyond zero thrust a windmill pulls back and drives the motor; a folded propeller drags a hundredth of that, and
    the motor runs down by its own friction."""
    V, n = 20.0, 40.0
    condition = dict(V=V, n=n, throttle=0.0, rho=RHO)
    windmill = power_train(propulsion, propeller, **condition)
    folded = power_train(propulsion, propeller.with_beyond_zero_thrust("fold"), **condition)
    assert windmill.thrust_N < -1.0 and windmill.shaft_power_W < 0
    assert -0.05 < folded.thrust_N < 0
    assert folded.shaft_power_W == 0 and folded.propeller_torque_Nm == 0
    assert folded.motor_acceleration_revps2 < 0
    for J in (0.2, 0.6):  # the propeller is the same where there is thrust
        assert propeller.coefficients(J, 6000) == propeller.with_beyond_zero_thrust("fold").coefficients(J, 6000)


@pytest.mark.parametrize(("behavior", "area_over_diameter2"), [("windmill", 0.042), ("fold", 0.00154)])
def test_a_propeller_that_stands_drags_as_its_blades_do(propulsion, propeller, behavior, area_over_diameter2):
    standing = propeller.with_beyond_zero_thrust(behavior)
    train = power_train(propulsion, standing, V=15.0, n=0.0, throttle=0.0, rho=RHO)
    drag = RHO * 15.0**2 / 2 * area_over_diameter2 * propeller.diameter_m**2
    assert -train.thrust_N == pytest.approx(drag, rel=1e-6)
    nearly = power_train(propulsion, standing, V=15.0, n=1e-6, throttle=0.0, rho=RHO)
    assert nearly.thrust_N == pytest.approx(train.thrust_N, rel=1e-4)


def test_an_aircraft_that_folds_its_propeller_glides_further(nexstar):
    """The throttle is closed at the same speed: a windmill brakes, a folded propeller hardly; the file says which it
    is."""
    text = nexstar.text.replace("[propulsion]", '[propulsion]\nbeyond_zero_thrust = "fold"')
    sinks = {}
    for craft in (nexstar, parse_aircraft(text, "folding.toml")):
        plan = parse_plan(GLIDE, "glide")
        truth = fly(craft, plan).truth
        last = truth[truth["segment"] == 1].iloc[-1]
        sinks[craft.propulsion.beyond_zero_thrust] = last
    V = {name: row["V_mps"] for name, row in sinks.items()}
    assert V["fold"] > V["windmill"] + 0.3  # after four seconds with the throttle closed
    assert sinks["fold"]["thrust_N"] == pytest.approx(0.0, abs=0.1) and sinks["windmill"]["thrust_N"] < -0.3


def test_an_unknown_behavior_is_refused():
    with pytest.raises(InputError, match="'feather' is not one of windmill, fold"):
        load_propeller("apc-12x8e").with_beyond_zero_thrust("feather")
