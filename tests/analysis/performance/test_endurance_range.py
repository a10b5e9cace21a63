"""Endurance and range by hand, and what they are known to."""

import numpy as np
import pytest
from motor_data import RHO, full_throttle_run, height_of, incidence_of, steady_points
from scipy.optimize import brentq

from analysis.drag.polar import Condition, lift_coefficient, speed_at
from analysis.performance.available import FullThrottle, full_throttle
from analysis.performance.endurance_range import LevelFlight, answer, density_altitude_m, level_flight, longest
from analysis.performance.power_train import PowerTrain, power_train
from analysis.performance.propagation import Estimate, Numbers, joined, known
from flight.atmosphere import density, pressure_at, temperature_at
from sim.plant import plant_of
from sim.propulsion import power_train as true_train
from sim.trim import Trimmer

POLAR = {"A0": 0.0465, "A1": -0.0195, "A2": 0.065}
NO_CORRECTION = {"thrust_scale": 0.0, "thrust_slope": 0.0}
ALONG_PATH = {"alpha_0": 0.0, "alpha_CL": 0.0}  # thrust that carries nothing
LOSSLESS = PowerTrain(known(shaft_scale=1.0, friction=0.0, copper=0.0, meter_scale=0.0), 0.0, True, "", ())
RANGE_CL = (0.2, 1.1)


@pytest.fixture(scope="module")
def at(nexstar) -> Condition:
    return Condition(nexstar.mass.weight_N, RHO, nexstar.geometry.wing_area_m2)


def of_battery(V: np.ndarray, power: np.ndarray) -> LevelFlight:
    none = Estimate(np.full_like(V, np.nan), np.full_like(V, np.nan))
    return LevelFlight(V, none, none, none, none, none, none, np.ones(len(V), dtype=bool), power[None])


def test_longest_endurance_and_range_of_a_closed_form() -> None:
    """P = a V^3 + b/V: least at V^4 = b/(3a), least over V at V^4 = b/a; 74 Wh of which 80 % are flown with."""
    a, b = 0.011, 330.0
    V = np.linspace(6, 30, 2000)
    flight = of_battery(V, a * V**3 + b / V)
    energy_J = 74 * 3600 * 0.8
    slow, far = (longest(flight, energy_J, range_wanted=wanted) for wanted in (False, True))
    V_slow, V_far = (b / (3 * a)) ** 0.25, (b / a) ** 0.25
    assert float(slow.speed_mps.value) == pytest.approx(V_slow, rel=1e-5)
    assert float(slow.gives.value) == pytest.approx(energy_J / (4 * a * V_slow**3), rel=1e-6)
    assert float(far.speed_mps.value) == pytest.approx(V_far, rel=1e-5)
    assert float(far.gives.value) == pytest.approx(energy_J / (2 * a * V_far**2), rel=1e-6)
    assert not (slow.at_slowest or slow.at_fastest or far.at_slowest or far.at_fastest)


def test_a_best_speed_at_the_end_of_what_was_flown_is_said_to_be_there() -> None:
    V = np.linspace(12, 24, 200)
    best = longest(of_battery(V, V**3), 1e5, range_wanted=False)
    assert best.at_slowest and not best.at_fastest
    assert float(best.speed_mps.value) == 12.0


def test_one_speed_by_hand(propeller, at) -> None:
    """Drag from the polar; motor speed where the table's thrust is that; its power is the battery's, without losses."""
    V = 16.0
    q = RHO * V**2 / 2
    CL = at.weight_N / (q * at.wing_area_m2)
    drag = q * at.wing_area_m2 * (0.0465 - 0.0195 * CL + 0.065 * CL**2)

    def excess(n: float) -> float:
        cT, _ = propeller.coefficients(V / (n * propeller.diameter_m), 60 * n)
        return float(cT) * RHO * n**2 * propeller.diameter_m**4 - drag

    n = brentq(excess, 60, 200, xtol=1e-10)
    _, cP = propeller.coefficients(V / (n * propeller.diameter_m), 60 * n)
    shaft = float(cP) * RHO * n**3 * propeller.diameter_m**5
    numbers = joined(known(**POLAR, **NO_CORRECTION, **ALONG_PATH), LOSSLESS.numbers)
    found = level_flight(numbers.nudged(), LOSSLESS, propeller, at, RANGE_CL, np.array([V]))
    assert found.required.value == pytest.approx([drag * V], rel=1e-12)
    assert found.battery.value == pytest.approx([shaft], rel=1e-8)
    assert found.propeller.value == pytest.approx([drag * V / shaft], rel=1e-8)
    assert found.motor.value == pytest.approx([1.0])
    assert found.inside.all()


def test_the_battery_gives_what_the_simulator_s_gives_in_trimmed_flight(nexstar, propeller, at) -> None:
    """To 0.3 %, of the losses' fit. At 12 m/s thrust points up by 8.6 deg: left out, that alone is 0.5 %."""
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
    train = power_train(steady_points(nexstar, propeller), nexstar.propulsion, propeller, (0.0, 0.0))
    numbers = joined(known(**POLAR, **NO_CORRECTION), incidence_of(nexstar), train.numbers)
    found = level_flight(numbers.nudged(), train, propeller, at, RANGE_CL, V)
    assert found.battery.value == pytest.approx(truth, rel=0.003)


def test_twice_the_energy_is_twice_the_way_and_thin_air_is_flown_faster(propeller, at) -> None:
    numbers = joined(known(**POLAR, **NO_CORRECTION, **ALONG_PATH), LOSSLESS.numbers)

    def asked(energy_J: float, at: Condition):
        return answer(numbers, LOSSLESS, propeller, at, RANGE_CL, energy_J, full_throttle=False)

    once, twice, high = asked(1e5, at), asked(2e5, at), asked(1e5, at._replace(rho=0.8 * at.rho))
    assert twice.range.gives.value == pytest.approx(2 * once.range.gives.value, rel=1e-12)
    assert twice.range.speed_mps.value == pytest.approx(once.range.speed_mps.value, rel=1e-12)
    # Lift coefficients stay, so speed goes with 1/sqrt(rho); the propeller's Reynolds number shifts it by little.
    assert high.range.speed_mps.value == pytest.approx(once.range.speed_mps.value / np.sqrt(0.8), rel=0.02)
    assert once.performance is None


def test_the_interval_of_endurance_covers_as_often_as_it_says(propeller, at) -> None:
    """120 polars and thrusts about a truth; 95 % within 3 standard errors of a binomial share."""
    truth = np.array([*POLAR.values(), 0.0, 0.0])
    sigma = np.array([0.0010, 0.0020, 0.0020, 0.01, 0.02])
    energy_J, names = 2e5, (*POLAR, *NO_CORRECTION)

    def range_m(values: np.ndarray) -> Estimate:
        numbers = joined(Numbers(names, values, np.diag(sigma**2)), known(**ALONG_PATH), LOSSLESS.numbers)
        return answer(numbers, LOSSLESS, propeller, at, RANGE_CL, energy_J, full_throttle=False, speeds=81).range.gives

    true_range = float(range_m(truth).value)
    rng = np.random.default_rng(2)
    found = [range_m(values) for values in truth + sigma * rng.standard_normal((120, 5))]
    hits = np.mean([e.lo <= true_range <= e.hi for e in found])
    assert hits == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / 120))


def test_density_altitude_is_the_atmosphere_turned_round() -> None:
    h = np.array([-200.0, 0.0, 1234.0, 5000.0, 10_000.0])
    assert density_altitude_m(density(pressure_at(h), temperature_at(h))) == pytest.approx(h, abs=1e-6)


def test_what_lies_outside_lift_or_table_is_not_called_inside(propeller, at) -> None:
    numbers = joined(known(**POLAR, **NO_CORRECTION, **ALONG_PATH), LOSSLESS.numbers)
    CL = (0.3, 0.9)
    V = np.array([speed_at(0.95, at), speed_at(0.6, at), speed_at(0.25, at)])
    found = level_flight(numbers.nudged(), LOSSLESS, propeller, at, CL, V)
    assert found.inside.tolist() == [False, True, False]
    assert lift_coefficient(V, at) == pytest.approx([0.95, 0.6, 0.25])


def test_too_heavy_for_full_throttle_does_not_fly(nexstar, propeller, at) -> None:
    """Four times the weight needs eight times the power at the same lift coefficient (2.3), 4^1.5."""
    aero = plant_of(nexstar).aero
    polar = {"A0": aero.CD0 + aero.K * aero.CL_minD**2, "A1": -2 * aero.K * aero.CL_minD, "A2": aero.K}
    motor = full_throttle(full_throttle_run(nexstar, propeller), nexstar.propulsion, propeller)
    assert isinstance(motor, FullThrottle)
    numbers = joined(known(**polar, **NO_CORRECTION, **ALONG_PATH), LOSSLESS.numbers, motor.numbers)
    light, heavy = (
        answer(numbers, LOSSLESS, propeller, at._replace(weight_N=W), RANGE_CL, 1e5, full_throttle=True)
        for W in (at.weight_N, 4 * at.weight_N)
    )
    assert light.flies and light.performance is not None and light.performance.best_climb.value > 0
    assert not heavy.flies and heavy.performance is not None and heavy.performance.best_climb.value < 0
