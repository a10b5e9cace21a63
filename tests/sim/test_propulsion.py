"""The power train: no energy from nowhere, and the throttle that holds a speed."""

import numpy as np
import pytest

from flight.propeller import load_propeller
from sim.propulsion import power_train, throttle_for, torque_constant

RHO = 1.2


@pytest.fixture(scope="module")
def propulsion(nexstar):
    return nexstar.propulsion


@pytest.fixture(scope="module")
def propeller(nexstar):
    return load_propeller(nexstar.propulsion.propeller)


def test_electrical_power_is_shaft_power_and_losses(propulsion, propeller):
    """At steady speed: battery output = propeller + friction + heat in the winding; heat in the battery besides."""
    for V, n in ((0.0, 90.0), (15.0, 100.0), (24.0, 125.0)):
        throttle = float(throttle_for(propulsion, propeller, V=V, n=n, rho=RHO))
        assert 0 < throttle <= 1.2
        train = power_train(propulsion, propeller, V=V, n=n, throttle=throttle, rho=RHO)
        assert train.motor_acceleration == pytest.approx(0.0, abs=1e-8)
        i = train.current / throttle
        k = torque_constant(propulsion)
        friction = 2 * np.pi * n * k * propulsion.motor_no_load_current_A
        heat = i**2 * propulsion.motor_resistance_ohm
        assert train.voltage * train.current == pytest.approx(train.shaft_power + friction + heat, rel=1e-9)
        assert train.voltage == pytest.approx(
            propulsion.battery_voltage_V - train.current * propulsion.battery_resistance_ohm
        )


def test_an_unloaded_motor_turns_at_kv_times_volts(propulsion):
    """What kv means, up to the no-load current's drop: the propeller taken off (air of no density)."""
    propeller = load_propeller(propulsion.propeller)
    n = propulsion.motor_kv_rpm_per_volt * propulsion.battery_voltage_V / 60
    i = propulsion.motor_no_load_current_A
    drop = i * (propulsion.motor_resistance_ohm + propulsion.battery_resistance_ohm) / propulsion.battery_voltage_V
    train = power_train(propulsion, propeller, V=0.0, n=n * (1 - drop), throttle=1.0, rho=1e-12)
    assert train.motor_acceleration == pytest.approx(0.0, abs=1e-6)


def test_the_speed_controller_freewheels(propulsion, propeller):
    """Throttle shut at speed: no current either way, thrust becomes drag, and the windmill finds its speed."""
    V = 25.0
    fast = power_train(propulsion, propeller, V=V, n=140.0, throttle=0.0, rho=RHO)
    assert fast.current == 0 and fast.motor_acceleration < 0
    slow = power_train(propulsion, propeller, V=V, n=40.0, throttle=0.0, rho=RHO)
    assert slow.motor_acceleration > 0 > slow.thrust


def test_a_stopped_motor_stays_stopped(propulsion, propeller):
    train = power_train(propulsion, propeller, V=0.0, n=0.0, throttle=0.0, rho=RHO)
    assert train.motor_acceleration == pytest.approx(0.0, abs=10.0)  # [rev/s^2], of the propeller's slowest 5 rev/s
    assert train.current == 0


def test_more_throttle_than_the_battery_has_is_said(propulsion, propeller):
    assert throttle_for(propulsion, propeller, V=0.0, n=400.0, rho=RHO) == np.inf
    assert throttle_for(propulsion, propeller, V=30.0, n=60.0, rho=RHO) == 0.0
