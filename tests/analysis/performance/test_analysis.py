"""Tests endurance, range, and whether full throttle sustains level flight, at several weights and densities."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from motor_data import (
    ALONG_PATH,
    FLOWN_CL,
    LOSSLESS,
    NO_CORRECTION,
    POLAR,
    RHO,
    STEP_S,
    full_throttle_run,
    steady_points,
)

from flightpower.analysis.curve import Condition, Polar, speed_at
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.performance.analysis import (
    ConditionPerformance,
    _whole_speeds,
    _with_battery_and_coverage,
    flight_performance,
    performance_at,
    performance_model,
)
from flightpower.analysis.performance.full_throttle import FullThrottle, fit_full_throttle
from flightpower.analysis.performance.level_flight import PerformanceModel
from flightpower.analysis.performance.propagation import ParameterVector, combine_independent, exact
from flightpower.analysis.performance.request import TitledCondition
from flightpower.analysis.records.flight import BatteryResult, CurveStatus, Interval
from flightpower.flight.runs import AIRCRAFT_SIZE
from flightpower.sim.plant import plant_of

BATTERY = BatteryResult(energy_Wh=50.0, usable=0.8)
UNKNOWN = FullThrottle(None, reason="not flown")


def test_range_goes_with_energy_and_its_speed_with_the_root_of_density(propeller, condition) -> None:
    parameters = combine_independent(exact(**POLAR, **NO_CORRECTION, **ALONG_PATH), LOSSLESS.parameters)

    def performance_for(energy_J: float, condition: Condition) -> ConditionPerformance:
        model = PerformanceModel(parameters, LOSSLESS, UNKNOWN, propeller, FLOWN_CL)
        return performance_at(model, TitledCondition("", condition), energy_J)

    once, twice, high = (
        performance_for(1e5, condition),
        performance_for(2e5, condition),
        performance_for(1e5, condition._replace(rho=0.8 * condition.rho)),
    )
    assert twice.case.range_m.value == pytest.approx(2 * once.case.range_m.value, rel=1e-12)
    assert twice.case.range_speed_mps.value == pytest.approx(once.case.range_speed_mps.value, rel=1e-12)
    # Lift coefficients are equal, so speed goes with 1/sqrt(rho); the propeller's Reynolds number shifts it a little.
    assert high.case.range_speed_mps.value == pytest.approx(once.case.range_speed_mps.value / np.sqrt(0.8), rel=0.02)
    assert once.full_throttle is None


def test_the_interval_of_range_covers_at_its_nominal_rate(propeller, condition) -> None:
    """120 polars and thrust errors are drawn around the truth; 95 % are covered, to 3 standard errors of a share."""
    truth = np.array([*POLAR.values(), 0.0, 0.0])
    sigma = np.array([0.0010, 0.0020, 0.0020, 0.01, 0.02])
    energy_J, names = 2e5, (*POLAR, *NO_CORRECTION)

    def range_m(values: np.ndarray) -> Interval:
        polar = ParameterVector(names, values, np.diag(sigma**2))
        parameters = combine_independent(polar, exact(**ALONG_PATH), LOSSLESS.parameters)
        model = PerformanceModel(parameters, LOSSLESS, UNKNOWN, propeller, FLOWN_CL)
        return performance_at(model, TitledCondition("", condition), energy_J, speeds=81).case.range_m

    true_range = float(range_m(truth).value)
    rng = np.random.default_rng(2)
    ranges_m = [range_m(values) for values in truth + sigma * rng.standard_normal((120, 5))]
    hits = np.mean([e.lo <= true_range <= e.hi for e in ranges_m])
    assert hits == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / 120))


def test_a_weight_that_full_throttle_cannot_hold_level_is_marked(nexstar, propeller, condition) -> None:
    """At equal lift coefficient, four times the weight needs 4^1.5 = 8 times the power (2.3)."""
    aero = plant_of(nexstar).aero
    polar = {"A0": aero.CD0 + aero.K * aero.CL_minD**2, "A1": -2 * aero.K * aero.CL_minD, "A2": aero.K}
    motor = fit_full_throttle(full_throttle_run(nexstar, propeller), nexstar.propulsion, propeller)
    assert motor.parameters is not None, motor.reason
    exactly = exact(**polar, **NO_CORRECTION, **ALONG_PATH)
    parameters = combine_independent(exactly, LOSSLESS.parameters, motor.parameters)
    model = PerformanceModel(parameters, LOSSLESS, motor, propeller, FLOWN_CL)
    light, heavy = (
        performance_at(model, TitledCondition("", condition._replace(weight_N=W)), 1e5)
        for W in (condition.weight_N, 4 * condition.weight_N)
    )
    assert light.sustained and light.full_throttle is not None and light.full_throttle.best_climb.value > 0
    assert not heavy.sustained and heavy.full_throttle is not None and heavy.full_throttle.best_climb.value < 0


def dynamic_estimate(noise: np.ndarray, systematic: np.ndarray) -> DynamicEstimate:
    values = np.array([*POLAR.values(), 0.02, -0.05])
    polar = Polar(values[:3], (noise + systematic)[:3, :3])
    return DynamicEstimate(
        polar=polar,
        parameters=[],
        status=CurveStatus.CONVERGED,
        verdict="",
        warnings=[],
        fits=[],
        values=values,
        noise=noise,
        systematic=systematic,
    )


@pytest.fixture(scope="module")
def model(nexstar, propeller) -> PerformanceModel:
    """Return the model of a flight with steady points and full throttle; angle of attack is 0.3 rad times C_L."""
    data = pd.concat([steady_points(nexstar, propeller), full_throttle_run(nexstar, propeller)])
    CL = 2 * nexstar.mass.weight_N / (data["rho"] * data["V"] ** 2 * nexstar.geometry.wing_area_m2)
    data = data.assign(CL=CL, alpha=0.3 * CL).set_axis(np.arange(len(data)) * STEP_S)
    estimate = dynamic_estimate(np.diag([1e-6, 1e-6, 1e-6, 1e-4, 1e-4]), np.diag([0.0, 4e-6, 0.0, 0.0, 0.0]))
    return performance_model(data, estimate, nexstar, propeller, FLOWN_CL)


def test_the_model_holds_polar_thrust_incidence_losses_and_full_throttle(model, nexstar, propeller) -> None:
    """Noise and systematic errors of the polar add up."""
    values = dict(zip(model.parameters.names, model.parameters.values, strict=True))
    assert (values["A0"], values["thrust_scale"], values["thrust_slope"]) == (POLAR["A0"], 0.02, -0.05)
    assert (values["alpha_0"], values["alpha_CL"]) == pytest.approx((0.0, 0.3), abs=1e-9)
    assert 100 < values["unloaded_revps"] < 200 and values["meter_scale"] == 0.0
    variance = dict(zip(model.parameters.names, np.diag(model.parameters.covariance), strict=True))
    assert (variance["A0"], variance["A1"]) == pytest.approx((1e-6, 5e-6))
    # Measured efficiencies use the corrected thrust.
    point = model.power_train.points[0]
    n = point.speed_mps / (0.56 * propeller.diameter_m)  # the advance ratio of the first steady point
    thrust_N, shaft_W = propeller.thrust_and_power(point.speed_mps, n, RHO)
    scale = 1 + 0.02 - 0.05 * (0.56 - 0.5)
    shaft_scale = values["shaft_scale"]
    assert point.propeller == pytest.approx(scale * thrust_N * point.speed_mps / (shaft_scale * shaft_W), rel=1e-6)


def test_performance_of_a_flight_covers_the_flown_speeds(model, condition) -> None:
    heavier = TitledCondition("heavier", condition._replace(weight_N=1.1 * condition.weight_N))
    performance = flight_performance(model, condition, [heavier], BATTERY)
    assert performance is not None and BATTERY.usable_J == pytest.approx(50 * 3600 * 0.8)
    slowest, fastest = speed_at(FLOWN_CL[1], condition), speed_at(FLOWN_CL[0], condition)
    speeds = [point.speed_mps for point in performance.power_train.efficiency]
    assert len(speeds) == 31 and (speeds[0], speeds[-1]) == pytest.approx((slowest, fastest))
    speeds_mps = [row.speed_mps for row in performance.field_table]
    assert len(speeds_mps) <= 10 and speeds_mps == np.round(speeds_mps).tolist()
    assert speeds_mps[0] == np.ceil(slowest) and fastest - 2 < speeds_mps[-1] <= fastest
    flown, other = performance.loadings
    assert (flown.title, other.title) == ("as flown", "heavier")
    assert other.endurance_s.value < flown.endurance_s.value


def test_the_service_ceiling_lies_below_the_absolute_ceiling(model, condition) -> None:
    """At the weight used, both ceilings are in the troposphere."""
    performance = flight_performance(model, condition._replace(weight_N=2.2 * condition.weight_N), [], BATTERY)
    assert performance is not None
    service, absolute = performance.available.service_ceiling_m, performance.available.absolute_ceiling_m
    assert service is not None and absolute is not None and 0 < service.value < absolute.value < 11_000


@pytest.mark.filterwarnings("ignore:invalid value")
def test_no_performance_where_the_propeller_cannot_give_the_thrust(model, condition) -> None:
    """A drag coefficient of 10^4 needs more thrust than the propeller gives at any motor speed searched."""
    values = np.concatenate([[1e4], model.parameters.values[1:]])
    model = replace(model, parameters=replace(model.parameters, values=values))
    assert flight_performance(model, condition, [], BATTERY) is None


def test_battery_power_is_voltage_times_current_and_the_ground_is_not_covered(propeller) -> None:
    """Rows are inside the table, outside the table, and at a height of 2 m, where the ground reduces drag."""
    J, n, rho = np.array([0.5, 1.5, 0.5]), np.full(3, 100.0), np.full(3, RHO)
    forces = pd.DataFrame({"V": J * n * propeller.diameter_m, "alpha": 0.1, "CL": 0.5, "n": n, "rho": rho, "J": J})
    mean = {"battery_V": np.full(3, 14.0), "battery_A": np.full(3, 5.0), "height_m": np.array([50.0, 50.0, 2.0])}
    data = _with_battery_and_coverage(forces, mean, propeller)
    assert AIRCRAFT_SIZE.least_height_m > 2
    assert data["battery_W"].tolist() == [70.0, 70.0, 70.0]
    assert data["covered"].tolist() == [True, False, False]
    assert data["throttle"].isna().all()


def test_the_field_table_has_whole_speeds_and_ten_rows_at_most() -> None:
    """Every whole speed is a row if they fit; otherwise only every second, third and so on."""
    assert _whole_speeds(np.array([9.3, 15.0, 19.8])).tolist() == list(range(10, 20))
    assert _whole_speeds(np.array([10.0, 20.0])).tolist() == [10, 12, 14, 16, 18, 20]
    assert _whole_speeds(np.array([10.2, 24.7])).tolist() == list(range(11, 25, 2))
    assert _whole_speeds(np.array([10.0, 40.9])).tolist() == list(range(10, 41, 4))
