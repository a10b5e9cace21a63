"""`calibrate imu`: scale and offset of the accelerometers of a simulated tray that lies on each of its six sides."""

from dataclasses import replace

import numpy as np
import pytest
from flights import sensor_table

from flightpower.analysis.air.air import specific_force_at_cg
from flightpower.analysis.calibrations.imu import (
    RestingSide,
    accelerometers,
    not_supported,
    resting_sides,
    summary,
    to_toml,
)
from flightpower.analysis.trajectory.priors import stated_sigma
from flightpower.flight.aircraft import load_aircraft, parse_aircraft
from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.flight.errors import InputError
from flightpower.sim.fly import fly
from flightpower.sim.plan import load_plan
from flightpower.sim.sensors import FlightSensorTruth, draw, load_budget

NEXSTAR = load_complete_aircraft("nexstar")
G = 9.80665
SCALE, OFFSET_MPS2 = np.array([-0.01, 0.005, 0.02]), np.array([0.1, -0.2, 0.3])


@pytest.fixture(scope="module")
def lying():
    return fly(NEXSTAR, load_plan("six-sides"))


def errors_of(seed: int):
    errors = draw(load_budget("study"), seed)
    return replace(errors, accel_scale=SCALE, accel_bias=OFFSET_MPS2)


def table_of(lying, seed: int):
    return sensor_table(FlightSensorTruth(lying, errors_of(seed)), NEXSTAR)


def sides_of(lying, seed: int) -> list[RestingSide]:
    return resting_sides(table_of(lying, seed), "log")


def test_the_scale_of_each_axis_is_found_to_a_thousandth_within_its_error(lying):
    """A scale error of 2 % on the axis that points down is found to 0.1 %, though nose and tail point 6 deg off the
    vertical."""
    z = []
    for seed in range(6):
        result = accelerometers(sides_of(lying, seed))
        assert np.abs(result.scale - SCALE).max() < 1e-3
        assert np.abs(result.offset_mps2 - OFFSET_MPS2).max() < 0.01
        assert result.scale_error.max() < 1e-3
        z.append((result.scale - SCALE) / result.scale_error)
    assert np.sqrt(np.mean(np.square(z))) < 2.0


def test_sides_are_named_by_what_is_up_and_one_that_is_missing_is_reported(lying):
    sides = sides_of(lying, 0)
    assert [side.up for side in sides] == [(2, 1), (1, 1), (2, 0), (1, 0), (0, 0), (0, 1), (2, 1)]
    table = table_of(lying, 0)
    with pytest.raises(InputError, match="never with its tail up"):
        resting_sides(table.loc[:80.0], "log")


def exact(scale=SCALE, offset=OFFSET_MPS2, noise_mps2: float = 0.0) -> list[RestingSide]:
    """The six sides, each 5 deg off the vertical in some direction."""
    rng, sides = np.random.default_rng(0), []
    for side in np.vstack([np.eye(3), -np.eye(3)]):
        up = side + 0.087 * rng.normal(size=3)
        force = (1 + scale) * G * up / np.linalg.norm(up) + offset
        sides.append(RestingSide(0.0, force, np.full(3, noise_mps2**2)))
    return sides


def test_without_noise_scale_and_offset_are_exact():
    result = accelerometers(exact())
    assert result.scale == pytest.approx(SCALE, abs=1e-9) and result.offset_mps2 == pytest.approx(OFFSET_MPS2, abs=1e-8)
    assert not not_supported(result)


def test_the_error_is_that_of_the_readings_of_both_sides():
    """The error is half the difference of two readings, divided by g."""
    result = accelerometers(exact(noise_mps2=0.02))
    assert result.scale_error == pytest.approx(0.02 / G / np.sqrt(2), rel=0.1)
    assert not not_supported(result)
    noisy = accelerometers(exact(noise_mps2=0.15))
    message = not_supported(noisy)
    assert f"uncertain by {100 * noisy.scale_error.max():.2f} % (1 sigma), where 1 % are assumed" in message


def test_a_part_of_another_range_is_refused():
    with pytest.raises(InputError, match="down reads"):
        accelerometers(exact(scale=np.array([0.0, 0.0, 0.25])))


def test_the_lines_for_the_aircraft_file_take_the_errors_out_of_a_flight(lying):
    """The tray's readings on its sides become g, and the prior of the scale is a fifth of the prior without
    calibration."""
    result = accelerometers(sides_of(lying, 0))
    text = load_aircraft("nexstar").text.partition("[uncertainty]")[0] + to_toml(result)
    aircraft = parse_aircraft(text, "mine")
    table = table_of(lying, 0)
    corrected = specific_force_at_cg(table, aircraft)
    still = resting_sides(corrected, "log")
    assert [np.linalg.norm(side.force_mps2) for side in still] == pytest.approx([G] * len(still), abs=0.01)
    before, after = (stated_sigma(item.uncertainty)["az_scale"] for item in (NEXSTAR, aircraft))
    assert before == 0.01 and 0.001 < after < 0.002
    assert summary(result)[2].startswith("down: scale +2.0")
