"""`calibrate run-up`: the values of a simulated run-up are recovered within their stated uncertainty."""

from dataclasses import replace

import numpy as np
import pytest
from flights import sensor_table

from flightpower.analysis.air.air import specific_force_at_cg
from flightpower.analysis.calibrations import run_up
from flightpower.analysis.calibrations.run_up import thrusts_N, to_toml, wrong_speed
from flightpower.analysis.calibrations.settings import RUN_UP
from flightpower.analysis.calibrations.thrust import calibrate
from flightpower.flight.aircraft import load_aircraft, parse_aircraft
from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.fly import fly
from flightpower.sim.plan import load_plan
from flightpower.sim.sensors import FlightSensorTruth, draw, load_budget

OFFSET_MPS2 = (0.1, -0.05, 0.2)
NEXSTAR = load_complete_aircraft("nexstar")


@pytest.fixture(scope="module")
def flight():
    return fly(NEXSTAR, load_plan("run-up"))


def table(flight, seed: int, offset_mps2=OFFSET_MPS2, poles_entered: int = 14):
    """The readings of a run-up, with the sensor errors of the study's budget."""
    errors = draw(load_budget("study"), seed)
    x, y, z = offset_mps2
    defects = replace(
        errors.defects, vibration_offset_x_mps2=x, vibration_offset_y_mps2=y, vibration_offset_z_mps2=z,
        poles_entered=poles_entered,
    )  # fmt: skip
    sensors = FlightSensorTruth(flight, replace(errors, defects=defects, noise=replace(errors.noise, vibration_mps2=0)))
    table = sensor_table(sensors, NEXSTAR)
    t_s = table.index.to_numpy()
    table["battery_V"], table["battery_A"] = sensors.battery(t_s)
    throttle_us = sensors.servo_pulses_us(t_s)[:, NEXSTAR.propulsion.throttle_channel - 1]
    return table.assign(throttle=(throttle_us - 1000) / 1000)


def test_the_offset_by_vibration_is_found_within_its_error_though_the_aircraft_leans(flight):
    """Leaning by 0.01 rad changes the forward force by 0.1 m/s^2 even at full throttle. Over 12 draws."""
    z = []
    for seed in range(12):
        measured = table(flight, seed)
        vibration_offset = run_up.vibration_offset(measured, run_up.held_speeds(measured, "log"))
        z.append((vibration_offset.offset_mps2 - OFFSET_MPS2) / vibration_offset.error_mps2)
        assert vibration_offset.error_mps2.max() < 0.03
    assert np.sqrt(np.mean(np.square(z), axis=0)).max() < 1.8
    assert np.sqrt(np.mean(np.square(z))) < 1.4
    assert np.abs(np.mean(z, axis=0)).max() < 3 / np.sqrt(12)


def test_without_vibration_no_offset_is_found(flight):
    measured = table(flight, 3, (0.0, 0.0, 0.0))
    vibration_offset = run_up.vibration_offset(measured, run_up.held_speeds(measured, "log"))
    assert np.all(np.abs(vibration_offset.offset_mps2) < 3 * vibration_offset.error_mps2)
    assert vibration_offset.sigma_in_flight_mps2 == pytest.approx(vibration_offset.error_mps2[[0, 2]].max(), rel=0.2)


def test_in_flight_a_large_offset_is_known_to_a_share_of_it():
    vibration_offset = run_up.VibrationOffset(np.array([0.5, 0.0, 0.0]), np.array([0.01, 0.01, 0.01]))
    assert vibration_offset.sigma_in_flight_mps2 == pytest.approx(np.hypot(0.01, RUN_UP.transfer * 0.5))


def test_the_motor_s_constant_shows_the_number_of_poles(flight):
    propulsion = NEXSTAR.propulsion
    right, wrong = (
        run_up.speed_over_constant(run_up.held_speeds(table(flight, 0, poles_entered=n), "log"), propulsion)
        for n in (14, 12)
    )
    assert right == pytest.approx(1.0, abs=0.03)
    assert wrong == pytest.approx(14 / 12, abs=0.03)
    entered = replace(NEXSTAR, propulsion=replace(propulsion, pole_pairs=6))
    assert "14 poles rather than 12" in wrong_speed(wrong, entered)


def test_without_a_meter_or_full_throttle_neither_constant_nor_battery_is_known(flight):
    measured = table(flight, 0).assign(battery_V=np.nan)
    held = run_up.held_speeds(measured, "log")
    assert run_up.speed_over_constant(held, NEXSTAR.propulsion) is None and run_up.battery(held) is None
    partly = run_up.held_speeds(table(flight, 0).assign(throttle=0.8), "log")
    assert run_up.speed_over_constant(partly, NEXSTAR.propulsion) is None


def test_the_battery_s_resistance_is_found_within_its_error(flight):
    for seed in range(4):
        battery = run_up.battery(run_up.held_speeds(table(flight, seed), "log"))
        current_scale = draw(load_budget("study"), seed).values.battery_scale
        true_ohm = NEXSTAR.propulsion.battery_resistance_ohm / (1 + current_scale)
        assert abs(battery.resistance_ohm - true_ohm) < 4 * battery.resistance_error_ohm < 0.1 * true_ohm * 4
        assert battery.voltage_V == pytest.approx(NEXSTAR.propulsion.battery_voltage_V, abs=4 * battery.voltage_error_V)


def test_thrust_read_from_a_scale_is_that_of_a_stand(flight):
    held = run_up.held_speeds(table(flight, 0), "log")
    true_N = [float(np.interp(speed.time_s, flight.truth["time_s"], flight.truth["thrust_N"])) for speed in held[1:-1]]
    readings = run_up.thrust_readings(held, [1.04 * thrust for thrust in true_N[:-1]] + [None], "log")
    result, unsupported = calibrate(readings, load_propeller("apc-12x8e"), 0.01, "log")
    assert result.readings == 6 and not unsupported
    assert result.ratio == pytest.approx(1.04, abs=0.02)
    with pytest.raises(InputError, match="2 readings of thrust for 7 motor speeds"):
        run_up.thrust_readings(held, [1.0, 2.0], "log")


@pytest.mark.parametrize("part", [slice(0, 30), slice(30, None), slice(0, 10)])
def test_a_run_up_that_does_not_begin_and_end_at_rest_is_refused(flight, part):
    measured = table(flight, 0)
    with pytest.raises(InputError, match="begin and end"):
        run_up.held_speeds(measured.loc[part.start : part.stop], "log")


def test_too_few_speeds_are_refused(flight):
    measured = table(flight, 0)
    with pytest.raises(InputError, match="1 motor speeds"):
        run_up.held_speeds(measured.assign(n_revps=np.where(measured["n_revps"] > 50, 90.0, np.nan)), "log")


def test_the_lines_for_the_aircraft_file_are_read_and_correct_the_accelerometer(flight):
    measured = table(flight, 0)
    held = run_up.held_speeds(measured, "log")
    offset = run_up.vibration_offset(measured, held)
    text = to_toml(offset, None, None)
    own_aircraft = parse_aircraft(load_aircraft("nexstar").text.partition("[uncertainty]")[0] + text, "mine.toml")
    assert own_aircraft.installation.accelerometer_vibration_mps2 == pytest.approx(offset.offset_mps2, abs=5e-4)
    assert own_aircraft.uncertainty.accelerometer_vibration_mps2 == pytest.approx(offset.sigma_in_flight_mps2, rel=0.05)
    before, after = (specific_force_at_cg(measured, item) for item in (NEXSTAR, own_aircraft))
    fastest = max(held, key=lambda speed: speed.revps)
    change = (before - after).iloc[fastest.rows][list(run_up.FORCES)].mean()
    assert change.to_numpy() == pytest.approx(offset.offset_mps2 * (fastest.revps / 100) ** 2, rel=0.02, abs=2e-3)
    assert not (before - after).iloc[held[0].rows][list(run_up.FORCES)].to_numpy().any()


def test_thrusts_are_a_list_with_a_unit():
    assert thrusts_N("5 - 10,5 N") == [5.0, None, 10.0, 5.0]
    assert thrusts_N("1 kgf") == pytest.approx([9.80665])
    assert thrusts_N("") == []
    for wrong in ("5 10", "- - N", "-5 10 N"):
        with pytest.raises(InputError, match="--thrust"):
            thrusts_N(wrong)
