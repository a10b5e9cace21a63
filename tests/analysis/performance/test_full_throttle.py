"""The motor fitted at full throttle agrees with the simulator's motor."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from motor_data import RHO, STEP_S, at_throttle, full_throttle_run, recorded, steady_points

from flightpower.analysis.performance.full_throttle import fit_full_throttle, speed_over_motor_constant
from flightpower.analysis.performance.propagation import ParameterVector
from flightpower.flight.aircraft import Propulsion
from flightpower.flight.propeller import Propeller
from flightpower.flight.propeller_speed import full_throttle_revps
from flightpower.sim.propulsion import power_train


@pytest.fixture(scope="module")
def motor(nexstar, propeller) -> ParameterVector:
    full_throttle = fit_full_throttle(full_throttle_run(nexstar, propeller), nexstar.propulsion, propeller)
    assert full_throttle.parameters is not None, full_throttle.reason
    return full_throttle.parameters


@pytest.mark.parametrize("rho", [RHO, 0.9])
def test_the_motor_turns_as_the_simulator_s_at_other_speeds_and_densities(nexstar, propeller, motor, rho) -> None:
    V = np.array([5.0, 11.0, 18.0, 25.0])
    values = dict(zip(motor.names, motor.values, strict=True))
    n = full_throttle_revps(propeller, V, rho, **values)
    slower, faster = (
        power_train(nexstar.propulsion, propeller, V=V, n=n * factor, throttle=1.0, rho=rho).motor_acceleration_revps2
        for factor in (0.995, 1.005)
    )
    assert np.all((slower > 0) & (faster < 0)), "torques must balance within 0.5 % of this speed"


def test_a_flight_may_begin_at_any_time_of_the_log(nexstar, propeller, motor) -> None:
    """The time step is that between two rows, so a run that is too short is still too short an hour later."""
    late = full_throttle_run(nexstar, propeller)
    late.index += 3600.0
    full_throttle = fit_full_throttle(late, nexstar.propulsion, propeller)
    assert full_throttle.parameters is not None and full_throttle.parameters.values == pytest.approx(
        motor.values, rel=1e-6
    )
    few = late.iloc[:5]
    assert "s of settled full throttle" in fit_full_throttle(few, nexstar.propulsion, propeller).reason


def test_a_throttle_not_quite_open_is_not_taken_for_full(nexstar, propeller, motor) -> None:
    """At a throttle of 0.98 the motor turns 2 % slower; these samples must not count as full throttle."""
    run = full_throttle_run(nexstar, propeller)
    nearly = run.iloc[:15].assign(throttle=0.98, n=0.98 * run["n"].iloc[:15])
    both = pd.concat([run, nearly])
    both.index = pd.Index(np.arange(len(both)) * 0.2, name="t_s")
    full_throttle = fit_full_throttle(both, nexstar.propulsion, propeller)
    assert full_throttle.parameters is not None, full_throttle.reason
    assert full_throttle.parameters.values == pytest.approx(motor.values, rel=1e-6)


def test_a_throttle_a_little_below_full_counts_for_what_it_is(nexstar, propeller) -> None:
    """With a slow climb at a throttle of 0.996, as a controller may hold it, full throttle is still found to 0.01 %.

    The motor turns 0.3 % slower in that climb; counted as full, it would make full throttle 0.08 % slower.
    """
    climb, run = at_throttle(nexstar, propeller, np.full(30, 13.0), 0.996), full_throttle_run(nexstar, propeller, 40.0)
    both = pd.concat([climb, climb[:5].assign(throttle=0.5), run])
    both.index = pd.Index(np.arange(len(both)) * 0.2, name="t_s")
    full_throttle = fit_full_throttle(both, nexstar.propulsion, propeller)
    assert full_throttle.parameters is not None, full_throttle.reason
    V = np.array([12.0, 18.0])
    values = dict(zip(full_throttle.parameters.names, full_throttle.parameters.values, strict=True))
    true = at_throttle(nexstar, propeller, V, 1.0)["n"].to_numpy()
    assert full_throttle_revps(propeller, V, RHO, **values) == pytest.approx(true, rel=1e-4)


def test_no_full_throttle_is_reported_and_not_made_up(nexstar, propeller) -> None:
    part = steady_points(nexstar, propeller)
    part["throttle"] = np.minimum(part["throttle"], 0.9)
    assert "0 s of settled full throttle" in fit_full_throttle(part, nexstar.propulsion, propeller).reason
    unknown = part.assign(throttle=np.nan)
    assert "no throttle position" in fit_full_throttle(unknown, nexstar.propulsion, propeller).reason


def accelerating_rotor(propulsion: Propulsion, propeller: Propeller, V: float, seconds: float) -> np.ndarray:
    """Return the simulator's motor speed [rev/s] every STEP_S at full throttle and V [m/s], from 60 rev/s."""
    n, small_s, recorded_n = 60.0, 0.001, []
    for i in range(round(seconds / small_s)):
        if i % round(STEP_S / small_s) == 0:
            recorded_n.append(n)
        n += small_s * float(
            power_train(propulsion, propeller, V=V, n=n, throttle=1.0, rho=RHO).motor_acceleration_revps2
        )
    return np.array(recorded_n)


def test_a_rotor_that_still_accelerates_takes_torque_from_the_motor(nexstar, propeller, motor) -> None:
    """A rotor of 120 times the inertia speeds up over seconds, more slowly than propeller torque alone would explain.

    The fit finds the same motor as a settled rotor; finite differences of 0.2 s leave 0.2 % in n_0 and 1.3 % in n_Q.
    """
    heavy = replace(nexstar.propulsion, propeller_inertia_kgm2=120 * nexstar.propulsion.propeller_inertia_kgm2)
    n = accelerating_rotor(heavy, propeller, V=18.0, seconds=8.0)
    assert n[-1] - n[5] > 20, "the rotor must still accelerate after settling_s"
    data = recorded(replace(nexstar, propulsion=heavy), propeller, np.full(len(n), 18.0), n, np.ones(len(n)))
    full_throttle = fit_full_throttle(data, heavy, propeller)
    assert full_throttle.parameters is not None, full_throttle.reason
    assert np.all(np.abs(full_throttle.parameters.values / motor.values - 1) < [0.005, 0.03])


def test_the_first_tenths_of_a_second_at_full_throttle_are_left_out(nexstar, propeller) -> None:
    """The speed controller ramps up for 0.6 s after the stick moves."""
    settled = full_throttle_run(nexstar, propeller)
    ramping = settled.assign(n=settled["n"] * np.where(np.arange(len(settled)) < 3, 0.9, 1.0))
    expected, result = (fit_full_throttle(run, nexstar.propulsion, propeller).parameters for run in (settled, ramping))
    assert expected is not None and result is not None
    assert result.values == pytest.approx(expected.values, rel=1e-9)


def test_one_speed_leaves_the_loss_by_torque_to_the_resistances(nexstar, propeller) -> None:
    """At a single torque, the flight determines n_0 - n_Q Q and not n_Q. So n_Q stays at its prior, the loss per N m of
    the simulator's motor between two other speeds, and is uncertain by half of that. (Density is chosen for equal
    torque at every noisy n, and the rotor is light.)"""
    run = at_throttle(nexstar, propeller, np.full(40, 15.0), 1.0)
    noisy = run["n"].to_numpy() + np.random.default_rng(0).normal(0, 0.05, len(run))
    power_W = [propeller.thrust_and_power(15.0, n, RHO)[1] / n for n in (run["n"].to_numpy(), noisy)]
    same_torque = run.assign(n=noisy, rho=RHO * power_W[0] / power_W[1])
    light = replace(nexstar.propulsion, propeller_inertia_kgm2=1e-9)
    full_throttle = fit_full_throttle(same_torque, light, propeller)
    assert full_throttle.parameters is not None, full_throttle.reason
    n = at_throttle(nexstar, propeller, np.array([12.0, 24.0]), 1.0)["n"].to_numpy()
    _, shaft_W = propeller.thrust_and_power(np.array([12.0, 24.0]), n, RHO)
    loss = -np.diff(n)[0] / np.diff(shaft_W / (2 * np.pi * n))[0]
    i = full_throttle.parameters.names.index("revps_per_Nm")
    assert full_throttle.parameters.values[i] == pytest.approx(loss, rel=0.005)
    assert np.sqrt(full_throttle.parameters.covariance[i, i]) == pytest.approx(loss / 2, rel=0.02)


def test_motor_speed_at_full_throttle_is_that_of_the_motor_s_constants(nexstar) -> None:
    """The ratio is 1 for a true motor speed and 7/6 if 12 poles are entered instead of 14. There is no ratio without
    full throttle, battery data or a motor constant."""
    p = nexstar.propulsion
    voltage, current = 14.0, 30.0
    n_revps = p.motor_kv_rpm_per_volt * (voltage - current * p.motor_resistance_ohm) / 60
    columns = {"n_revps": n_revps, "throttle": 1.0, "battery_V": voltage, "battery_A": current}
    table = pd.DataFrame(columns, index=np.arange(0, 5, 0.04))
    assert speed_over_motor_constant(table, p) == pytest.approx(1.0)
    assert speed_over_motor_constant(table.assign(n_revps=n_revps * 7 / 6), p) == pytest.approx(7 / 6)
    for unknown in (table.assign(throttle=0.5), table.drop(columns="battery_A"), table.assign(battery_V=np.nan)):
        assert speed_over_motor_constant(unknown, p) is None
    assert speed_over_motor_constant(table, Propulsion()) is None
