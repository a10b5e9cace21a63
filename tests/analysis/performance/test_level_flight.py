"""Level flight agrees with a calculation by hand, and with the simulator's trimmed flight."""

import numpy as np
import pytest
from motor_data import ALONG_PATH, LOSSLESS, NO_CORRECTION, POLAR, RHO, height_of, incidence_of, model_of, steady_points
from scipy.optimize import brentq

from flightpower.analysis.curve import lift_coefficient, speed_at
from flightpower.analysis.performance.level_flight import level_flight
from flightpower.analysis.performance.power_train import PowerTrainModel, fit_power_train
from flightpower.analysis.performance.propagation import combine_independent, exact
from flightpower.sim.plant import plant_of
from flightpower.sim.propulsion import power_train as true_train
from flightpower.sim.trim import Trimmer


def test_one_speed_by_hand(propeller, condition) -> None:
    """The polar gives drag, thrust equal to drag gives motor speed, and shaft power is battery power without losses."""
    V = 16.0
    q = RHO * V**2 / 2
    CL = condition.weight_N / (q * condition.wing_area_m2)
    drag = q * condition.wing_area_m2 * (0.0465 - 0.0195 * CL + 0.065 * CL**2)

    def excess(n: float) -> float:
        cT, _ = propeller.coefficients(V / (n * propeller.diameter_m), 60 * n)
        return float(cT) * RHO * n**2 * propeller.diameter_m**4 - drag

    n = brentq(excess, 60, 200, xtol=1e-10)
    _, cP = propeller.coefficients(V / (n * propeller.diameter_m), 60 * n)
    shaft = float(cP) * RHO * n**3 * propeller.diameter_m**5
    parameters = combine_independent(exact(**POLAR, **NO_CORRECTION, **ALONG_PATH), LOSSLESS.parameters)
    flight = level_flight(model_of(parameters, propeller), condition, np.array([V]))
    assert flight.required.value == pytest.approx([drag * V], rel=1e-12)
    assert flight.battery.value == pytest.approx([shaft], rel=1e-8)
    assert flight.propeller.value == pytest.approx([drag * V / shaft], rel=1e-8)
    assert flight.motor.value == pytest.approx([1.0])
    assert flight.inside.all()


def test_the_battery_gives_what_the_simulator_s_gives_in_trimmed_flight(nexstar, propeller, condition) -> None:
    """They agree to 0.3 %, the error of the fitted losses. The tilt of thrust, 8.6 deg at 12 m/s, alone is 0.5 %."""
    plant = plant_of(nexstar)
    trimmer = Trimmer(plant, height_of(plant.air, RHO))
    V = np.array([12.0, 14.0, 17.0, 20.0, 23.0])
    truth = []
    for v in V:
        trim = trimmer.solve(V=float(v), climb=0.0)
        now = true_train(
            nexstar.propulsion, propeller, V=v, n=trim.unknowns.motor, throttle=trim.throttle, rho=trimmer.density
        )
        truth.append(float(now.battery_voltage_V * now.battery_current_A))
    train = fit_power_train(steady_points(nexstar, propeller), nexstar.propulsion, propeller, **NO_CORRECTION)
    parameters = combine_independent(exact(**POLAR, **NO_CORRECTION), incidence_of(nexstar), train.parameters)
    flight = level_flight(model_of(parameters, propeller, train), condition, V)
    assert flight.battery.value == pytest.approx(truth, rel=0.003)


def test_speeds_outside_the_flown_lift_coefficients_are_marked(propeller, condition) -> None:
    parameters = combine_independent(exact(**POLAR, **NO_CORRECTION, **ALONG_PATH), LOSSLESS.parameters)
    CL = (0.3, 0.9)
    V = np.array([speed_at(0.95, condition), speed_at(0.6, condition), speed_at(0.25, condition)])
    flight = level_flight(model_of(parameters, propeller, flown_CL=CL), condition, V)
    assert flight.inside.tolist() == [False, True, False]
    assert lift_coefficient(V, condition) == pytest.approx([0.95, 0.6, 0.25])


def test_the_ends_of_the_flown_range_count_as_inside_in_spite_of_rounding(propeller, condition) -> None:
    parameters = combine_independent(exact(**POLAR, **NO_CORRECTION, **ALONG_PATH), LOSSLESS.parameters)
    for rounded in (1 - 1e-12, 1.0, 1 + 1e-12):
        V = rounded * np.array([speed_at(0.9, condition), speed_at(0.3, condition)])
        assert level_flight(model_of(parameters, propeller, flown_CL=(0.3, 0.9)), condition, V).inside.all()


def test_speeds_outside_the_propeller_table_are_marked(propeller, condition) -> None:
    """At 30 times the weight, the propeller turns faster than in its table at any lift coefficient."""
    parameters = combine_independent(exact(**POLAR, **NO_CORRECTION, **ALONG_PATH), LOSSLESS.parameters)
    heavy = condition._replace(weight_N=30 * condition.weight_N)
    flight = level_flight(model_of(parameters, propeller), heavy, speed_at([0.5, 0.8], heavy))
    assert np.isfinite(flight.battery.value).all() and not flight.inside.any()


def test_the_overall_efficiency_is_the_product_of_both(propeller, condition) -> None:
    """There are losses. Power required is drag times speed at lift = weight, whatever weight thrust carries."""
    losses = exact(shaft_scale=1.05, friction=0.1, copper=300.0, meter_scale=0.0)
    train = PowerTrainModel(losses, 0.01, True, "", ())
    parameters = combine_independent(exact(**POLAR, **NO_CORRECTION, alpha_0=0.0, alpha_CL=0.3), losses)
    V = np.array([13.0, 20.0])
    flight = level_flight(model_of(parameters, propeller, train), condition, V)
    assert flight.overall.value == pytest.approx(flight.propeller.value * flight.motor.value)
    assert np.all(flight.motor.value < 0.99)
    CL = lift_coefficient(V, condition)
    drag_N = condition.weight_N * (0.0465 - 0.0195 * CL + 0.065 * CL**2) / CL
    assert flight.required.value == pytest.approx(drag_N * V)
