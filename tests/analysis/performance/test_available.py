"""Highest level speed, climb and ceilings agree with the simulator's trimmed flight."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from motor_data import RHO, full_throttle_run, height_of, incidence_of, model_of

from flightpower.analysis.curve import lift_coefficient
from flightpower.analysis.performance.climb import _last_crossings, ceilings_m, full_throttle_performance
from flightpower.analysis.performance.full_throttle import fit_full_throttle
from flightpower.analysis.performance.level_flight import PerformanceModel
from flightpower.analysis.performance.propagation import ParameterVector, combine_independent, exact
from flightpower.analysis.performance.settings import PERFORMANCE
from flightpower.flight.atmosphere import density, pressure_at, temperature_at
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_speed import full_throttle_revps
from flightpower.sim.plant import plant_of
from flightpower.sim.trim import Trimmer


@pytest.fixture(scope="module")
def motor(nexstar, propeller) -> ParameterVector:
    full_throttle = fit_full_throttle(full_throttle_run(nexstar, propeller), nexstar.propulsion, propeller)
    assert full_throttle.parameters is not None, full_throttle.reason
    return full_throttle.parameters


@pytest.fixture(scope="module")
def parameters(nexstar, motor) -> ParameterVector:
    """Return the parameters of the simulator's own polar and of the fitted motor."""
    aero = plant_of(nexstar).aero
    A0, A1, A2 = aero.CD0 + aero.K * aero.CL_minD**2, -2 * aero.K * aero.CL_minD, aero.K
    polar = exact(A0=A0, A1=A1, A2=A2, thrust_scale=0.0, thrust_slope=0.0)
    return combine_independent(polar, incidence_of(nexstar), motor)


@pytest.fixture(scope="module")
def flown_CL(condition) -> tuple[float, float]:
    slow, fast = lift_coefficient(np.array([11.6, 24.0]), condition)
    return float(fast), float(slow)


@pytest.fixture(scope="module")
def model(parameters, propeller, flown_CL) -> PerformanceModel:
    return model_of(parameters, propeller, flown_CL=flown_CL)


def test_highest_speed_and_climb_are_those_of_trimmed_flight(nexstar, model, condition) -> None:
    """In both, thrust points up by alpha and carries some weight; the motor fit and lift in sideslip leave 0.1 %."""
    performance = full_throttle_performance(model, condition)
    plant = plant_of(nexstar)
    trimmer = Trimmer(plant, height_of(plant.air, RHO))
    assert float(performance.maximum_speed.value) == pytest.approx(trimmer.V_max, rel=0.001)
    low, high = 0.0, 8.0
    for _ in range(20):  # bisect for the fastest climb at that speed in trim
        climb = (low + high) / 2
        try:
            trimmer.solve(V=performance.best_climb_speed, climb=climb)
            low = climb
        except InputError:
            high = climb
    assert float(performance.best_climb.value) == pytest.approx(low, rel=0.002)


def test_at_the_service_ceiling_a_hundred_feet_a_minute_are_left(
    propeller, parameters, model, condition, flown_CL
) -> None:
    heavy = condition._replace(weight_N=2.2 * condition.weight_N)  # puts the ceiling well inside the troposphere
    ceiling, absolute = ceilings_m(model, heavy, (0.508, 0.0))
    h = float(ceiling.value)
    assert 1000 < h < 10_000
    up_there = heavy._replace(rho=float(density(pressure_at(h), temperature_at(h))))
    climb = full_throttle_performance(model, up_there).best_climb
    assert float(climb.value) == pytest.approx(0.508, abs=0.01)
    assert absolute.value > h


def test_a_weight_far_too_large_has_no_climb_and_gives_no_warning(
    propeller, parameters, model, condition, flown_CL
) -> None:
    """At 100 times the weight, even the slowest speed is too fast for the propeller at full throttle."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        heavy = condition._replace(weight_N=100 * condition.weight_N)
        performance = full_throttle_performance(model, heavy)
    assert np.isnan(performance.best_climb.value) and np.isnan(performance.maximum_speed.value)


def test_power_available_equals_power_required_at_the_highest_speed(
    propeller, parameters, model, condition, flown_CL
) -> None:
    performance = full_throttle_performance(model, condition)
    V = float(performance.maximum_speed.value)
    A = dict(zip(parameters.names, parameters.values, strict=True))
    CL = float(lift_coefficient(V, condition))
    required = condition.rho * V**3 / 2 * condition.wing_area_m2 * (A["A0"] + A["A1"] * CL + A["A2"] * CL**2)
    assert np.interp(V, performance.V, performance.power.value) == pytest.approx(required, rel=0.002)


def test_a_highest_speed_near_the_end_of_the_search_keeps_its_interval(
    propeller, parameters, model, condition, flown_CL
) -> None:
    """With A0 known to 3 %, the speed is known to 1 %. Beyond the end of the search range it is extrapolated to first
    order, which gives the standard error to a tenth."""
    variance = parameters.covariance.copy()
    variance[0, 0] = (0.03 * parameters.values[0]) ** 2
    unsure = replace(parameters, covariance=variance)
    full_range = full_throttle_performance(model_of(unsure, propeller, flown_CL=flown_CL), condition).maximum_speed
    V, error = float(full_range.value), float(full_range.standard_error)
    assert 0.1 < error < 0.4
    fastest = float(lift_coefficient((V + 0.5 * error) / PERFORMANCE.fastest_sought, condition))
    at_end = model_of(unsure, propeller, flown_CL=(fastest, flown_CL[1]))
    near = full_throttle_performance(at_end, condition).maximum_speed
    assert float(near.value) == pytest.approx(V, abs=0.02)
    assert float(near.standard_error) == pytest.approx(error, rel=0.1)


def test_power_available_is_of_the_thrust_along_the_path(propeller, parameters, model, condition, flown_CL) -> None:
    """It is T V cos(alpha) (3.47): alpha exceeds 0.1 rad at the slowest speed, which reduces power by over 0.5 %."""
    performance = full_throttle_performance(model, condition)
    p = dict(zip(parameters.names, parameters.values, strict=True))
    V, sine = performance.V[0], performance.climb.value[0] / performance.V[0]
    n = full_throttle_revps(propeller, V, RHO, unloaded_revps=p["unloaded_revps"], revps_per_Nm=p["revps_per_Nm"])
    thrust_N, _ = propeller.thrust_and_power(V, n, RHO)
    alpha = 0.0
    for _ in range(30):
        lift_N = condition.weight_N * np.sqrt(1 - sine**2) - thrust_N * np.sin(alpha)
        alpha = p["alpha_0"] + p["alpha_CL"] * lift_N / (RHO * V**2 / 2 * condition.wing_area_m2)
    assert alpha > 0.1 and performance.covered[0]
    assert performance.power.value[0] == pytest.approx(thrust_N * V * np.cos(alpha), rel=1e-4)


def test_the_highest_level_speed_is_the_last_at_which_climb_becomes_descent() -> None:
    """If a sigma point still climbs at the last speed, the estimate's slope, -4 per m/s, gives its crossing."""
    V, climb = np.arange(4.0), np.array([[1.0, -1.0, 1.0, -3.0], [1.0, 1.0, -1.0, -1.0], [1.0, 1.0, 1.5, 0.5]])
    assert _last_crossings(V, climb) == pytest.approx([2.25, 1.5, 2.25 + (1.5 - 0.25) / 4])
    assert np.isnan(_last_crossings(V, climb[[2, 0]])[0])
