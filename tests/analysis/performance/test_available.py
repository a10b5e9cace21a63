"""Full throttle against the simulator's motor and its trim."""

import warnings
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from motor_data import RHO, at_throttle, full_throttle_run, height_of, incidence_of, steady_points

from analysis.drag.polar import Condition, lift_coefficient
from analysis.performance.available import FASTEST, SERVICE_CLIMB_MPS, ceilings_m, full_throttle_performance
from analysis.performance.full_throttle import fit_full_throttle
from analysis.performance.propagation import ParameterVector, combine_independent, exact
from analysis.performance.propeller_speed import full_throttle_revps
from flight.atmosphere import density, pressure_at, temperature_at
from flight.errors import InputError
from sim.plant import plant_of
from sim.propulsion import power_train
from sim.trim import Trimmer


@pytest.fixture(scope="module")
def motor(nexstar, propeller) -> ParameterVector:
    found = fit_full_throttle(full_throttle_run(nexstar, propeller), nexstar.propulsion, propeller)
    assert found.parameters is not None, found.reason
    return found.parameters


@pytest.fixture(scope="module")
def parameters(nexstar, motor) -> ParameterVector:
    """The simulator's own polar, and the motor as it was found."""
    aero = plant_of(nexstar).aero
    A0, A1, A2 = aero.CD0 + aero.K * aero.CL_minD**2, -2 * aero.K * aero.CL_minD, aero.K
    polar = exact(A0=A0, A1=A1, A2=A2, thrust_scale=0.0, thrust_slope=0.0)
    return combine_independent(polar, incidence_of(nexstar), motor)


@pytest.fixture(scope="module")
def at(nexstar) -> Condition:
    return Condition(nexstar.mass.weight_N, RHO, nexstar.geometry.wing_area_m2)


@pytest.fixture(scope="module")
def flown_CL(at) -> tuple[float, float]:
    slow, fast = lift_coefficient(np.array([11.6, 24.0]), at)
    return float(fast), float(slow)


@pytest.mark.parametrize("rho", [RHO, 0.9])
def test_the_motor_turns_as_the_simulator_s_at_other_speeds_and_densities(nexstar, propeller, motor, rho) -> None:
    V = np.array([5.0, 11.0, 18.0, 25.0])
    values = dict(zip(motor.names, motor.values, strict=True))
    n = full_throttle_revps(propeller, V, rho, **values)
    slower, faster = (
        power_train(nexstar.propulsion, propeller, V=V, n=n * factor, throttle=1.0, rho=rho).motor_acceleration
        for factor in (0.995, 1.005)
    )
    assert np.all((slower > 0) & (faster < 0)), "the balance of torques lies within 0.5 %"


def test_highest_speed_and_climb_are_those_of_trimmed_flight(nexstar, propeller, parameters, at, flown_CL) -> None:
    """Thrust carries some of the weight and points up by alpha in both; motor and lift of the sideslip leave 0.1 %."""
    found = full_throttle_performance(parameters.sigma_points(), propeller, at, flown_CL)
    plant = plant_of(nexstar)
    trimmer = Trimmer(plant, height_of(plant.air, RHO))
    assert float(found.maximum_speed.value) == pytest.approx(trimmer.V_max, rel=0.001)
    low, high = 0.0, 8.0
    for _ in range(20):  # the steepest trim at that speed that full throttle sustains
        climb = (low + high) / 2
        try:
            trimmer.solve(V=found.best_climb_speed, climb=climb)
            low = climb
        except InputError:
            high = climb
    assert float(found.best_climb.value) == pytest.approx(low, rel=0.002)


def test_at_the_service_ceiling_a_hundred_feet_a_minute_are_left(propeller, parameters, at, flown_CL) -> None:
    heavy = at._replace(weight_N=2.2 * at.weight_N)  # so that the ceiling lies well inside the troposphere
    ceiling, absolute = ceilings_m(parameters.sigma_points(), propeller, heavy, flown_CL, (SERVICE_CLIMB_MPS, 0.0))
    h = float(ceiling.value)
    assert 1000 < h < 10_000
    up_there = heavy._replace(rho=float(density(pressure_at(h), temperature_at(h))))
    climb = full_throttle_performance(parameters.sigma_points(), propeller, up_there, flown_CL).best_climb
    assert float(climb.value) == pytest.approx(SERVICE_CLIMB_MPS, abs=0.01)
    assert absolute.value > h


def test_a_weight_far_too_large_has_no_climb_and_gives_no_warning(propeller, parameters, at, flown_CL) -> None:
    """At 100 times the weight the slowest flight is faster than the propeller at full throttle can follow."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        heavy = at._replace(weight_N=100 * at.weight_N)
        found = full_throttle_performance(parameters.sigma_points(), propeller, heavy, flown_CL)
    assert np.isnan(found.best_climb.value) and np.isnan(found.maximum_speed.value)


def test_power_available_equals_power_required_at_the_highest_speed(propeller, parameters, at, flown_CL) -> None:
    found = full_throttle_performance(parameters.sigma_points(), propeller, at, flown_CL)
    V = float(found.maximum_speed.value)
    A = dict(zip(parameters.names, parameters.values, strict=True))
    CL = float(lift_coefficient(V, at))
    required = at.rho * V**3 / 2 * at.wing_area_m2 * (A["A0"] + A["A1"] * CL + A["A2"] * CL**2)
    assert np.interp(V, found.V, found.power.value) == pytest.approx(required, rel=0.002)


def test_a_throttle_not_quite_open_is_not_taken_for_full(nexstar, propeller, motor) -> None:
    """Climbing at 0.98 the motor turns 2 % slower: it must not pass for full throttle at that torque."""
    run = full_throttle_run(nexstar, propeller)
    nearly = run.iloc[:15].assign(throttle=0.98, n=0.98 * run["n"].iloc[:15])
    both = pd.concat([run, nearly])
    both.index = pd.Index(np.arange(len(both)) * 0.2, name="t_s")
    found = fit_full_throttle(both, nexstar.propulsion, propeller)
    assert found.parameters is not None, found.reason
    assert found.parameters.values == pytest.approx(motor.values, rel=1e-6)


def test_a_throttle_a_little_below_full_counts_for_what_it_is(nexstar, propeller) -> None:
    """A slow climb at 0.996, within which a controller may hold it: at 12 m/s full throttle is known to 0.01 %.

    Taken for full, it makes full throttle 0.08 % slower, and that climb 0.3 %.
    """
    climb, run = at_throttle(nexstar, propeller, np.full(30, 13.0), 0.996), full_throttle_run(nexstar, propeller, 40.0)
    both = pd.concat([climb, climb[:5].assign(throttle=0.5), run])
    both.index = pd.Index(np.arange(len(both)) * 0.2, name="t_s")
    found = fit_full_throttle(both, nexstar.propulsion, propeller)
    assert found.parameters is not None, found.reason
    V = np.array([12.0, 18.0])
    values = dict(zip(found.parameters.names, found.parameters.values, strict=True))
    true = at_throttle(nexstar, propeller, V, 1.0)["n"].to_numpy()
    assert full_throttle_revps(propeller, V, RHO, **values) == pytest.approx(true, rel=1e-4)


def test_no_full_throttle_is_said_and_not_made_up(nexstar, propeller) -> None:
    part = steady_points(nexstar, propeller)
    part["throttle"] = np.minimum(part["throttle"], 0.9)
    assert "0 s of settled full throttle" in fit_full_throttle(part, nexstar.propulsion, propeller).reason
    unknown = part.assign(throttle=np.nan)
    assert "no throttle position" in fit_full_throttle(unknown, nexstar.propulsion, propeller).reason


def test_a_highest_speed_near_the_end_of_the_search_keeps_its_interval(propeller, parameters, at, flown_CL) -> None:
    """Drag known to 3 %: speed to 1 %. Where that reaches beyond the search it is taken to first order, to a tenth."""
    variance = parameters.covariance.copy()
    variance[0, 0] = (0.03 * parameters.values[0]) ** 2
    unsure = replace(parameters, covariance=variance).sigma_points()
    whole = full_throttle_performance(unsure, propeller, at, flown_CL).maximum_speed
    V, error = float(whole.value), float(whole.standard_error)
    assert 0.1 < error < 0.4
    fastest = float(lift_coefficient((V + 0.5 * error) / FASTEST, at))
    near = full_throttle_performance(unsure, propeller, at, (fastest, flown_CL[1])).maximum_speed
    assert float(near.value) == pytest.approx(V, abs=0.02)
    assert float(near.standard_error) == pytest.approx(error, rel=0.1)
