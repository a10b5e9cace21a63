"""Ordinary defects of an installation: each shows in the sensor, or in the flight, as physics says."""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.atmosphere import GRAVITY_MPS2 as g
from flightpower.sim.air import Air, mean_wind
from flightpower.sim.defects import Defects
from flightpower.sim.fly import fly
from flightpower.sim.plan import load_plan, parse_plan
from flightpower.sim.sensors import FlightSensorTruth, draw, load_budget
from flightpower.sim.trim import power_required
from flightpower.sim.world import load_world, worlds, worlds_with_defects

FOUR_RUNS = """
height = "60 m"
[[segment]]
kind = "repeat"
times = 4
[[segment.segment]]
kind = "hold"
duration = "4 s"
speed_over_stall = 1.5
[[segment.segment]]
kind = "run"
throttle = 0.3
speed_over_stall = 1.3
"""
PORPOISE = """
height = "60 m"
[[segment]]
kind = "porpoise"
duration = "12 s"
load = 0.8
speed_over_stall = 1.5
"""
ENERGY_J = 266_400.0  # of the Nexstar's battery, 74 W h


def errors_of(**defects):
    return draw(replace(load_budget("none"), defects=Defects(**defects)), 0)


def flown_with(plan: str, **defects):
    return fly(load_aircraft("nexstar"), parse_plan(plan, "plan"), deviations=errors_of(**defects).deviations)


@pytest.fixture(scope="module")
def t(flight):
    """Times in free flight."""
    return flight.truth.loc[flight.truth["phase"] == "flight", "time_s"].to_numpy()[50:-50:7]


@pytest.fixture(scope="module")
def sensed(flight):
    """Sensor inputs of the same flight with these defects."""
    return lambda **defects: FlightSensorTruth(flight, errors_of(**defects))


@pytest.mark.parametrize("name", worlds_with_defects())
def test_a_world_of_a_defect_has_one_and_is_the_study_s_otherwise(name):
    world, none = load_world(name), Defects()
    changed = {key for key in vars(none) if getattr(world.errors.defects, key) != getattr(none, key)}
    assert len({key.partition("_")[0] for key in changed}) == 1
    assert replace(world.errors, title="", defects=none) == replace(load_budget("study"), title="")
    assert world.uncertainty is None and world.air.keys() <= {"time_of_day_s"}


def test_worlds_with_defects_are_among_the_worlds():
    assert len(worlds_with_defects()) >= 20 and set(worlds_with_defects()) < set(worlds())


def test_without_defects_the_sensors_are_the_same(flight, sensed, t):
    plain = FlightSensorTruth(flight, draw(load_budget("none"), 0))
    assert np.array_equal(sensed().imu(t)[0], plain.imu(t)[0])
    assert np.array_equal(sensed().motor_speed_revps(t), plain.motor_speed_revps(t))


def test_a_wrong_number_of_poles_scales_the_motor_speed(sensed, t):
    """Electrical frequency is poles / 2 times the motor speed; the user divides by what was entered."""
    true = sensed().motor_speed_revps(t)
    assert sensed(poles_entered=12).motor_speed_revps(t) == pytest.approx(true * 7 / 6)
    assert sensed(poles=16, poles_entered=14).motor_speed_revps(t) == pytest.approx(true * 8 / 7)


def test_pulses_are_lost_above_a_speed_only(sensed, t):
    true = sensed().motor_speed_revps(t)
    seen = sensed(pulses_lost=0.02, pulses_lost_above_revps=100.0).motor_speed_revps(t)
    fast = true > 100
    assert fast.any() and not fast.all()
    assert np.array_equal(seen[~fast], true[~fast])
    assert seen[fast] == pytest.approx(0.98 * true[fast])


def test_vibration_offsets_the_accelerometer_by_the_square_of_the_motor_speed(sensed, t):
    offset = sensed(vibration_offset_x_mps2=0.1, vibration_offset_z_mps2=-0.2).imu(t)[0] - sensed().imu(t)[0]
    n = sensed().motor_speed_revps(t)
    assert offset[:, 0] == pytest.approx(0.1 * (n / 100) ** 2, rel=0.02, abs=1e-4)
    assert offset[:, 1] == pytest.approx(0.0)
    assert offset[:, 2] == pytest.approx(-2 * offset[:, 0])
    assert offset[0, 0] != pytest.approx(offset[-1, 0], rel=0.1)
    standing = np.array([1.0])
    assert sensed(vibration_offset_x_mps2=0.1).imu(standing)[0] == pytest.approx(sensed().imu(standing)[0])


def test_scales_of_the_imu_read_high_in_proportion(sensed, t):
    force, rates = sensed().imu(t)
    high_force, high_rates = sensed(imu_gyro_scale=0.02, imu_accelerometer_scale=0.03).imu(t)
    assert high_force == pytest.approx(1.03 * force)
    assert high_rates == pytest.approx(1.02 * rates)


def test_a_box_mounted_nose_up_feels_gravity_backwards(flight, sensed, t):
    """At rest the specific force is g upwards: along x it is g times the sine of the angle by which the box points
    up."""
    turn = np.radians(3.0)
    at_rest = np.array([1.0])
    pitch = float(flight.truth["pitch_rad"].iloc[0])
    force = sensed(imu_pitch_rad=turn).imu(at_rest)[0][0]
    assert force == pytest.approx([g * np.sin(pitch + turn), 0.0, -g * np.cos(pitch + turn)], abs=1e-9)
    (force, rates), (turned_force, turned_rates) = sensed().imu(t), sensed(imu_yaw_rad=0.07).imu(t)
    assert np.linalg.norm(turned_force, axis=1) == pytest.approx(np.linalg.norm(force, axis=1))
    assert turned_force[:, 0] == pytest.approx(np.cos(0.07) * force[:, 0] + np.sin(0.07) * force[:, 1])
    assert turned_rates[:, 2] == pytest.approx(rates[:, 2])


def test_the_magnetometer_turns_with_the_box(sensed, t):
    """Heading by the magnetometer of a level aircraft is larger by the yaw of the box."""
    at_rest = np.array([1.0])
    (x, y, _), (x0, y0, _) = (sensed(imu_yaw_rad=yaw).magnetic_field_T(at_rest)[0] for yaw in (0.07, 0.0))
    assert np.arctan2(-y, x) - np.arctan2(-y0, x0) == pytest.approx(0.07)


def test_a_bending_boom_shows_more_angle_of_attack_in_proportion_to_load_factor():
    """In porpoising; the pair of ports at 45 deg gives dp / qbar = 9/4 sin(2 alpha), so 9/2 cos(2 alpha) per radian."""
    flight, bending = flown_with(PORPOISE), np.radians(1.0)
    truth = flight.truth.iloc[50:-50]
    t, load = truth["time_s"].to_numpy(), -truth["specific_force_z_mps2"] / g
    bent, straight = (FlightSensorTruth(flight, errors_of(boom_bending_rad=angle)) for angle in (bending, 0.0))
    change = bent.differential_pressure_Pa("alpha", t) - straight.differential_pressure_Pa("alpha", t)
    shown = change / (truth["dynamic_pressure_Pa"] * 9 / 2 * np.cos(2 * (truth["alpha_rad"] + truth["upwash_rad"])))
    assert load.min() < 0.5 and load.max() > 1.5
    assert shown.to_numpy() == pytest.approx(bending * load.to_numpy(), abs=0.05 * bending)


def test_static_ports_near_the_wing_err_in_proportion_to_lift():
    """Airspeed pressure goes with the square of airspeed; behind the lines it comes a little later than the truth."""
    flight = flown_with(FOUR_RUNS)
    truth = flight.truth[flight.truth["kind"] == "run"]
    t, CL = truth["time_s"].to_numpy(), truth["CL"].to_numpy()
    wrong, right = (FlightSensorTruth(flight, errors_of(airspeed_per_lift=k)) for k in (0.03, 0.0))
    ratio = wrong.differential_pressure_Pa("airspeed", t) / right.differential_pressure_Pa("airspeed", t)
    assert np.ptp(CL) > 0.15
    assert np.sqrt(ratio) - 1 == pytest.approx(0.03 * CL, abs=0.03 * 0.04)


def test_a_leaking_line_loses_its_share_of_the_pressure(flight, sensed, t):
    tight, leaking = (sensed(airspeed_leak=leak).differential_pressure_Pa("airspeed", t) for leak in (0.0, 0.1))
    assert leaking == pytest.approx(0.9 * tight, rel=0.01)
    for which in ("alpha", "beta"):
        assert np.array_equal(
            sensed(airspeed_leak=0.1).differential_pressure_Pa(which, t), sensed().differential_pressure_Pa(which, t)
        )


def test_the_gear_is_out_in_every_second_pair_of_runs():
    truth, clean = flown_with(FOUR_RUNS, gear_CD=0.01).truth, flown_with(FOUR_RUNS)
    flown_CD, V, CL = truth["CD"].to_numpy(), truth["V_mps"].to_numpy(), truth["CL"].to_numpy()
    polar = clean.plant.aero.CD0 + clean.plant.aero.K * (CL - clean.plant.aero.CL_minD) ** 2
    extra = np.round(np.where(V > 0, flown_CD - polar, 0.0), 6)
    of_run = [set(extra[rows.index]) for _, rows in truth[truth["kind"] == "run"].groupby("segment")]
    assert of_run == [{0.0}, {0.0}, {0.01}, {0.01}]
    assert set(extra[truth["kind"] == "hold"]) == {0.0}
    state = truth[["u_mps", "w_mps", "pitch_rad", "north_m"]].to_numpy()
    assert np.abs(np.diff(state, axis=0)).max() < 0.5  # nothing jumps when the gear moves
    assert (np.diff(truth["battery_energy_J"]) >= 0).all()


def test_the_true_curve_is_that_with_the_gear_in():
    V = np.array([13.0, 20.0])
    clean, flown = (flown_with(FOUR_RUNS, gear_CD=CD).plant for CD in (0.0, 0.01))
    assert np.array_equal(power_required(flown, V, density=1.2), power_required(clean, V, density=1.2))


def test_thrust_fades_with_the_energy_taken():
    """Thrust is compared with the table at the same motor speed and airspeed; 20 % is lost when the battery is
    empty."""
    faded = flown_with(FOUR_RUNS, thrust_loss=0.2)
    row = faded.truth.iloc[-1]
    table, _ = faded.plant.propeller.thrust_and_power(row["V_mps"], row["motor_speed_revps"], row["density_kgpm3"])
    used = row["battery_energy_J"] / ENERGY_J
    assert used > 0.005
    assert float(row["thrust_N"] / table) == pytest.approx(1 - 0.2 * used, rel=1e-9)


def test_a_battery_sags_with_the_energy_taken():
    sagging = flown_with(FOUR_RUNS, battery_sag=0.16)
    row, battery = sagging.truth.iloc[-1], sagging.aircraft.propulsion
    open_circuit = row["battery_voltage_V"] + row["battery_current_A"] * battery.battery_resistance_ohm
    expected = battery.battery_voltage_V * (1 - 0.16 * row["battery_energy_J"] / ENERGY_J)
    assert open_circuit == pytest.approx(expected, rel=1e-9)
    assert row["throttle"] > 0


def test_in_a_steady_updraft_the_aircraft_descends_through_the_air():
    """Level flight over the ground takes less power by weight times updraft; the true curve is without the updraft."""
    rising, calm = (flown_with(FOUR_RUNS, updraft_mps=w) for w in (0.05, 0.0))
    assert set(np.round(rising.truth["wind_down_mps"], 9)) == {-0.05}
    V = np.array([15.0])
    assert power_required(rising.plant, V, density=1.2)[0] == pytest.approx(
        power_required(calm.plant, V, density=1.2)[0]
    )
    hold = rising.truth["kind"].eq("hold") & rising.truth["time_s"].between(2, 4)
    saved = calm.truth["thrust_N"][hold].mean() - rising.truth["thrust_N"][hold].mean()
    assert saved == pytest.approx(0.05 * rising.aircraft.mass.weight_N / rising.truth["V_mps"][hold].mean(), rel=0.3)


def test_the_thermal_stands_in_the_first_acceleration():
    air = replace(Air(), **load_world("thermal").air)
    flight = fly(load_aircraft("nexstar"), load_plan("two-pairs"))
    first = flight.truth[flight.truth["segment"] == flight.truth.loc[flight.truth["kind"] == "run", "segment"].iloc[0]]
    _, _, down = mean_wind(air, first["north_m"].to_numpy(), first["east_m"].to_numpy(), first["height_m"].to_numpy())
    assert down.min() == pytest.approx(-1.0, abs=0.1)
    rest = flight.truth[flight.truth["segment"] > first["segment"].iloc[0] + 1]
    _, _, elsewhere = mean_wind(air, rest["north_m"].to_numpy(), rest["east_m"].to_numpy(), rest["height_m"].to_numpy())
    assert np.mean(elsewhere < -0.1) < 0.05
