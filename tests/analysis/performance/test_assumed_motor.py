"""The assumed motor keeps the values of the aircraft file; values added to them give a plausible efficiency."""

from dataclasses import asdict, replace

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.performance.power_train import motor_is_known, with_assumed_motor
from flightpower.flight.aircraft import Propulsion

RHO = 1.2


@pytest.fixture
def data():
    n = np.linspace(60, 130, 50)
    return pd.DataFrame({"V": 15.0, "n": n, "rho": RHO, "covered": True})


def test_a_motor_that_is_described_is_kept(nexstar, propeller, data):
    assert motor_is_known(nexstar.propulsion)
    assert asdict(with_assumed_motor(nexstar.propulsion, data, propeller)) == asdict(nexstar.propulsion)


def test_an_assumed_motor_loses_a_fifth_of_its_highest_power(propeller, data):
    assert not motor_is_known(Propulsion(motor_kv_rpm_per_volt=560.0))
    motor = with_assumed_motor(Propulsion(motor_kv_rpm_per_volt=560.0), data, propeller)
    _, shaft_W = propeller.thrust_and_power(15.0, 130.0, RHO)
    k = 60 / (2 * np.pi * motor.motor_kv_rpm_per_volt)
    torque_Nm = shaft_W / (2 * np.pi * 130.0)
    friction_W = 2 * np.pi * 130.0 * k * motor.motor_no_load_current_A
    copper_W = motor.motor_resistance_ohm * (torque_Nm / k) ** 2
    assert friction_W == pytest.approx(0.1 * shaft_W) and copper_W == pytest.approx(0.1 * shaft_W)


def test_nothing_flown_within_the_table_still_gives_a_motor(propeller, data):
    """It is a motor of 100 W at 100 rev/s that loses a tenth of its power to friction and a tenth in its copper."""
    motor = with_assumed_motor(replace(Propulsion()), data.assign(covered=False), propeller)
    k = 60 / (2 * np.pi * motor.motor_kv_rpm_per_volt)
    torque_Nm = 100.0 / (2 * np.pi * 100.0)
    assert 2 * np.pi * 100.0 * k * motor.motor_no_load_current_A == pytest.approx(10.0)
    assert motor.motor_resistance_ohm * (torque_Nm / k) ** 2 == pytest.approx(10.0)
