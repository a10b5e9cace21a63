"""`calibrate boom`: weights hung on the boom of a simulated aircraft show how far it bends."""

import math
from dataclasses import replace

import numpy as np
import pytest
from flights import sensor_table

from flightpower.analysis.calibrations.boom import CarriedMass, boom_bending, hanging_weights, quantities, to_toml
from flightpower.flight.aircraft import load_aircraft, parse_aircraft
from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.flight.errors import InputError
from flightpower.sim.bench import BoomWeightsSegment
from flightpower.sim.fly import fly
from flightpower.sim.plan import load_plan
from flightpower.sim.sensors import FlightSensorTruth, draw, load_budget

NEXSTAR = load_complete_aircraft("nexstar")
PLAN = load_plan("boom-weights")
(HUNG,) = (segment for segment in PLAN.segments if isinstance(segment, BoomWeightsSegment))
MASSES = [0.0, *HUNG.mass_kg, 0.0]
BENDING_RAD, READING_RAD = math.radians(0.5), math.radians(0.1)


@pytest.fixture(scope="module")
def flight():
    return fly(NEXSTAR, PLAN)


def stretches(flight, seed: int):
    errors = draw(load_budget("study"), seed)
    errors = replace(errors, noise=replace(errors.noise, vibration_mps2=0))
    return hanging_weights(sensor_table(FlightSensorTruth(flight, errors), NEXSTAR), "log")


def read_from_level(seed: int, bending_rad: float = BENDING_RAD) -> list[float]:
    """Tip angles rounded to a tenth of a degree, read on a probe that sits 0.07 rad nose up."""
    rng = np.random.default_rng(seed)
    return (0.07 + np.array(HUNG.tip_rad(bending_rad)) + READING_RAD * rng.uniform(-0.5, 0.5, len(MASSES))).tolist()


def test_the_bending_per_g_is_found_within_its_error_though_the_aircraft_gives_on_its_gear(flight):
    """The landing gear gives by a third of the boom's bending. Over 12 draws of sensors and readings."""
    carried, z = CarriedMass(HUNG.carried_kg, 0.0), []
    for seed in range(12):
        results = stretches(flight, seed)
        assert len(results) == len(MASSES)
        result = boom_bending(results, MASSES, read_from_level(seed), carried)
        z.append((result.per_g_rad - BENDING_RAD) / result.error_rad)
        assert result.error_rad < 0.05 * BENDING_RAD
    assert np.sqrt(np.mean(np.square(z))) < 1.5
    assert abs(np.mean(z)) < 3 / np.sqrt(12)


def test_the_error_of_the_carried_mass_is_part_of_the_result(flight):
    result = stretches(flight, 0)
    exact, estimated = (
        boom_bending(result, MASSES, read_from_level(0), CarriedMass(HUNG.carried_kg, error)) for error in (0.0, 0.1)
    )
    assert estimated.per_g_rad == exact.per_g_rad
    assert estimated.error_rad == pytest.approx(math.hypot(exact.error_rad, 0.1 * exact.per_g_rad))


def test_a_stiff_boom_bends_by_nothing_and_a_wrong_sign_is_refused(flight):
    result = stretches(flight, 1)
    stiff = boom_bending(result, MASSES, read_from_level(1, 0.0), CarriedMass(HUNG.carried_kg, 0.1))
    assert 0 <= stiff.per_g_rad < 3 * stiff.error_rad
    with pytest.raises(InputError, match="bends up"):
        boom_bending(result, MASSES, [-angle for angle in read_from_level(1)], CarriedMass(0.05, 0.1))
    with pytest.raises(InputError, match="2 different"):
        boom_bending(result, [0.0, *[0.1] * 5, 0.0], read_from_level(1), CarriedMass(0.05, 0.1))


def test_an_aircraft_that_never_stood_still_is_refused(flight):
    errors = draw(load_budget("none"), 0)
    measured = sensor_table(FlightSensorTruth(flight, errors), NEXSTAR)
    with pytest.raises(InputError, match="stood still 1 times"):
        hanging_weights(measured.loc[:12.0], "log")


def test_the_lines_for_the_aircraft_file_are_read(flight):
    result = boom_bending(stretches(flight, 0), MASSES, read_from_level(0), CarriedMass(HUNG.carried_kg, 0.1))
    text = load_aircraft("nexstar").text.partition("[uncertainty]")[0].replace("[probe]\n", to_toml(result), 1)
    own_aircraft = parse_aircraft(text, "mine.toml")
    assert own_aircraft.uncertainty.boom_bending_rad == pytest.approx(result.error_rad, rel=0.05)
    assert own_aircraft.probe.boom_bending_rad == pytest.approx(result.per_g_rad, abs=1e-6)


def test_lists_have_a_unit():
    assert quantities("0 100 -50 g", "kg", "--weights", "") == pytest.approx([0.0, 0.1, -0.05])
    assert quantities("", "kg", "--weights", "") == []
    for wrong in ("100", "1 2"):
        with pytest.raises(InputError, match="--weights"):
            quantities(wrong, "kg", "--weights", "")
