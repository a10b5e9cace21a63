"""Performance at several weights and densities: endurance, range, and whether full throttle sustains level flight."""

import numpy as np
import pytest
from motor_data import RHO, full_throttle_run

from analysis.drag.polar import Condition
from analysis.performance.analysis import ConditionPerformance, PerformanceModel, performance_at
from analysis.performance.conditions import TitledCondition
from analysis.performance.full_throttle import FullThrottle, fit_full_throttle
from analysis.performance.power_train import PowerTrainModel
from analysis.performance.propagation import ParameterVector, UncertainValue, combine_independent, exact
from sim.plant import plant_of

UNKNOWN = FullThrottle(None, reason="not flown")
POLAR = {"A0": 0.0465, "A1": -0.0195, "A2": 0.065}
NO_CORRECTION = {"thrust_scale": 0.0, "thrust_slope": 0.0}
ALONG_PATH = {"alpha_0": 0.0, "alpha_CL": 0.0}  # thrust carries no weight
LOSSLESS = PowerTrainModel(exact(shaft_scale=1.0, friction=0.0, copper=0.0, meter_scale=0.0), 0.0, True, "", ())
FLOWN_CL = (0.2, 1.1)


@pytest.fixture(scope="module")
def at(nexstar) -> Condition:
    return Condition(nexstar.mass.weight_N, RHO, nexstar.geometry.wing_area_m2)


def test_range_goes_with_energy_and_its_speed_with_the_root_of_density(propeller, at) -> None:
    parameters = combine_independent(exact(**POLAR, **NO_CORRECTION, **ALONG_PATH), LOSSLESS.parameters)

    def asked(energy_J: float, at: Condition) -> ConditionPerformance:
        model = PerformanceModel(parameters, LOSSLESS, UNKNOWN, propeller, FLOWN_CL)
        return performance_at(model, TitledCondition("", at), energy_J)

    once, twice, high = asked(1e5, at), asked(2e5, at), asked(1e5, at._replace(rho=0.8 * at.rho))
    assert twice.range.best.value == pytest.approx(2 * once.range.best.value, rel=1e-12)
    assert twice.range.speed_mps.value == pytest.approx(once.range.speed_mps.value, rel=1e-12)
    # Lift coefficients stay, so speed goes with 1/sqrt(rho); the propeller's Reynolds number shifts it by little.
    assert high.range.speed_mps.value == pytest.approx(once.range.speed_mps.value / np.sqrt(0.8), rel=0.02)
    assert once.full_throttle is None


def test_the_interval_of_range_covers_at_its_nominal_rate(propeller, at) -> None:
    """120 polars and thrusts about a truth; 95 % within 3 standard errors of a binomial share."""
    truth = np.array([*POLAR.values(), 0.0, 0.0])
    sigma = np.array([0.0010, 0.0020, 0.0020, 0.01, 0.02])
    energy_J, names = 2e5, (*POLAR, *NO_CORRECTION)

    def range_m(values: np.ndarray) -> UncertainValue:
        polar = ParameterVector(names, values, np.diag(sigma**2))
        parameters = combine_independent(polar, exact(**ALONG_PATH), LOSSLESS.parameters)
        model = PerformanceModel(parameters, LOSSLESS, UNKNOWN, propeller, FLOWN_CL)
        return performance_at(model, TitledCondition("", at), energy_J, speeds=81).range.best

    true_range = float(range_m(truth).value)
    rng = np.random.default_rng(2)
    found = [range_m(values) for values in truth + sigma * rng.standard_normal((120, 5))]
    hits = np.mean([e.lo <= true_range <= e.hi for e in found])
    assert hits == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / 120))


def test_a_weight_that_full_throttle_cannot_hold_level_is_marked(nexstar, propeller, at) -> None:
    """Four times the weight needs eight times the power at the same lift coefficient (2.3), 4^1.5."""
    aero = plant_of(nexstar).aero
    polar = {"A0": aero.CD0 + aero.K * aero.CL_minD**2, "A1": -2 * aero.K * aero.CL_minD, "A2": aero.K}
    motor = fit_full_throttle(full_throttle_run(nexstar, propeller), nexstar.propulsion, propeller)
    assert motor.parameters is not None, motor.reason
    exactly = exact(**polar, **NO_CORRECTION, **ALONG_PATH)
    parameters = combine_independent(exactly, LOSSLESS.parameters, motor.parameters)
    model = PerformanceModel(parameters, LOSSLESS, motor, propeller, FLOWN_CL)
    light, heavy = (
        performance_at(model, TitledCondition("", at._replace(weight_N=W)), 1e5) for W in (at.weight_N, 4 * at.weight_N)
    )
    assert light.sustained and light.full_throttle is not None and light.full_throttle.best_climb.value > 0
    assert not heavy.sustained and heavy.full_throttle is not None and heavy.full_throttle.best_climb.value < 0
