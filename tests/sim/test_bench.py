"""Segments that rehearse calibrations act on the sensors as the aircraft file and physics say."""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.analysis.air.tubing import air, low_frequency_lag_s
from flightpower.analysis.calibrations.tubing import find_steps, fit_lag, through
from flightpower.flight.aircraft import PneumaticLine, load_aircraft
from flightpower.flight.complete_aircraft import as_complete, load_complete_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.motion import attitude_derivative
from flightpower.sim.bench import BoomWeightsSegment, BurstsSegment, ColumnSegment, HandTurnSegment, RunUpSegment
from flightpower.sim.fly import fly
from flightpower.sim.plan import parse_plan
from flightpower.sim.plant import plant_of
from flightpower.sim.sensors import FlightSensorTruth, draw, load_budget
from flightpower.sim.sensors.tubing import step_response, time_constant_s

DT = 0.02
AIRBORNE = '[[segment]]\nkind = "hold"\nduration = "1 s"\n'
NO_LINE = PneumaticLine(length_m=0.0, diameter_m=1e-3, cavity_m3=0.0)
GROUND_AIR = (101_325.0, 288.15)
STANDING = np.array([0.0, 0.0, 0.3])


def test_a_burst_arrives_late_by_the_lag_of_its_line() -> None:
    """The area under a step behind a first-order lag is larger by pressure times lag; the rise in pressure is as
    late."""
    segment = BurstsSegment(line="alpha", pressure_Pa=300.0, count=1)
    t = np.arange(0.0, segment.duration_s, 1e-3)
    at_once, late = (segment.response(t, step_response(NO_LINE, *GROUND_AIR, lag), np.zeros(1)) for lag in (0.0, 0.025))
    assert at_once.max() == pytest.approx(300.0)
    assert at_once[[0, -1]] == pytest.approx(0.0, abs=1e-6)
    assert late[-1] == pytest.approx(0.0, abs=1e-6)
    burst = 2.0 + 1.0 + 2.0
    assert t[at_once > 299.9][-1] == pytest.approx(burst, abs=2e-3)
    after = t >= burst
    assert np.trapezoid(late[after], t[after]) == pytest.approx(300.0 * 0.025, rel=0.02)
    half = 2.5  # while the pressure rises, it is that of one lag earlier
    assert np.interp(half, t, late) == pytest.approx(np.interp(half - 0.025, t, at_once), rel=1e-3)


def test_bursts_are_not_tied_to_the_ticks() -> None:
    segment = BurstsSegment(line="alpha", count=2)
    t = np.arange(0.0, segment.duration_s, 1e-3)
    pressure = segment.response(t, step_response(NO_LINE, *GROUND_AIR), np.array([1.0, -1.0]))
    ends = t[np.flatnonzero(np.diff(pressure) < -100)]
    assert ends == pytest.approx([5.2, 9.8], abs=2e-3)


def test_a_water_column_acts_on_all_three_transducers_and_their_gains_differ() -> None:
    stand = '[[segment]]\nkind = "stand"\nduration = "2 s"\n\n'
    plan = f'{stand}[[segment]]\nkind = "column"\npressure = ["200 Pa", "400 Pa"]\n'
    errors = draw(load_budget("none"), seed=0)
    errors = replace(errors, values=replace(errors.values, alpha_scale=0.1, V_scale=0.1))
    truth = FlightSensorTruth(fly(load_complete_aircraft("nexstar"), parse_plan(plan, "plan")), errors)
    held = np.array([1.0, 8.0, 18.0])  # open, and in the middle of each of the two pressures
    for name, gain in (("alpha", 1.1), ("beta", 1.0), ("airspeed", 1.21)):
        assert truth.differential_pressure_Pa(name, held) == pytest.approx(gain * np.array([0, 200, 400]), abs=0.1)
    with pytest.raises(InputError, match="give the pressures"):
        ColumnSegment(pressure_Pa=()).check()


def test_turning_by_hand_is_a_motion_that_an_imu_could_measure() -> None:
    segment = HandTurnSegment(seconds_s=60.0)
    t = np.arange(0.0, segment.duration_s, DT)
    motion = segment.motion(np.zeros(3), STANDING, t)
    assert np.linalg.norm(motion.specific_force, axis=1) == pytest.approx(9.80665, rel=1e-6)
    phi, theta, psi = motion.attitude.T
    rates = np.column_stack(attitude_derivative(phi, theta, *motion.rates.T))
    assert np.gradient(motion.attitude, DT, axis=0)[1:-1] == pytest.approx(rates[1:-1], abs=2e-3)
    assert motion.attitude[0] == pytest.approx(STANDING) and np.abs(motion.rates[[0, -1]]).max() < 1e-2
    assert np.cos(psi[-1] - psi[0]) == pytest.approx(1.0, abs=1e-6)
    assert np.ptp(phi) > np.pi and np.ptp(theta) > 2.4  # on its back, nose up and nose down


def test_in_a_run_up_the_motor_is_in_balance_at_each_throttle_and_the_strapped_aircraft_leans(nexstar) -> None:
    stand = '[[segment]]\nkind = "stand"\nduration = "2 s"\n\n'
    plan = f'{stand}[[segment]]\nkind = "run-up"\nthrottle = [0.5, 1.0, 0.5]\n\n{stand}'
    flight = fly(nexstar, parse_plan(plan, "mine"))
    held = flight.truth.set_index("time_s").loc[[10.0, 24.0, 38.0]]
    assert held["throttle"].tolist() == pytest.approx([0.5, 1.0, 0.5])
    assert (held["motor_speed_revps"] > 50).all() and held["motor_speed_revps"].iloc[
        1
    ] < nexstar.propulsion.max_rpm / 60
    friction_W = 0.1 * held["shaft_power_W"] + 20
    assert (held["battery_voltage_V"] * held["battery_current_A"] > held["shaft_power_W"]).all()
    motor_A = held["battery_current_A"] / held["throttle"]
    heat_W = motor_A**2 * nexstar.propulsion.motor_resistance_ohm
    lost_W = held["battery_voltage_V"] * held["battery_current_A"] - held["shaft_power_W"] - heat_W
    assert (lost_W > 0).all() and (lost_W < friction_W).all()
    assert held["thrust_N"].tolist() == pytest.approx(
        [float(flight.plant.propeller.thrust_and_power(0.0, n, rho)[0])
         for n, rho in zip(held["motor_speed_revps"], held["density_kgpm3"], strict=True)])  # fmt: skip
    lean = RunUpSegment().lean_rad
    assert held["pitch_rad"].tolist() == pytest.approx([-lean / 4, -lean, -lean / 4], rel=1e-6)
    assert held["specific_force_x_mps2"].iloc[1] == pytest.approx(-9.80665 * np.sin(lean), rel=1e-4)
    assert flight.truth["motor_speed_revps"].iloc[[0, -1]].tolist() == [0.0, 0.0]


def test_a_weight_on_the_boom_pitches_the_aircraft_and_bends_the_boom() -> None:
    segment = BoomWeightsSegment(mass_kg=(0.1, 0.2), carried_kg=0.05, give_rad_per_N=0.002)
    t = np.arange(0.0, segment.duration_s, DT)
    motion = segment.motion(np.zeros(3), STANDING, t)
    at_rest = np.interp(13.0, t, motion.attitude[:, 1])
    assert at_rest - STANDING[1] == pytest.approx(-0.002 * 0.1 * 9.80665, rel=1e-3)
    assert np.abs(motion.rates[:, 1]).max() > 0.1  # the hand that attaches the weight
    without, item, two, after = segment.tip_rad(0.01)
    assert without == after == 0.0
    assert item == pytest.approx(-0.01 * 0.1 / 0.05 - 0.002 * 0.1 * 9.80665)
    assert two == pytest.approx(2 * item)
    with pytest.raises(InputError, match="give the weights"):
        BoomWeightsSegment(mass_kg=()).check()


def test_deflected_surfaces_are_held_and_their_pulses_are_those_of_the_aircraft_file(nexstar) -> None:
    text = """
    [[segment]]
    kind = "stand"
    duration = "1 s"
    [[segment]]
    kind = "deflect"
    surface = "rudder"
    angle = ["-20 deg", "10 deg"]
    """
    truth = fly(nexstar, parse_plan(text, "mine")).truth
    angle = np.degrees(truth.loc[truth["kind"] == "deflect", "rudder_command_rad"])
    for held in (-20.0, 10.0):
        assert np.sum(np.isclose(angle, held)) * DT == pytest.approx(4.0, abs=0.1)
    assert truth["rudder_command_rad"].iloc[-1] == pytest.approx(0.0, abs=1e-2)
    assert set(truth["phase"]) == {"ground"} and truth["motor_speed_revps"].max() == 0.0
    assert np.all(truth["elevator_command_rad"] == 0.0)


@pytest.mark.parametrize(("diameter_mm", "cavity_mm3"), [(0.3, 20), (0.42, 20), (0.8, 500)])
def test_the_response_of_a_line_has_its_lag(diameter_mm: float, cavity_mm3: float) -> None:
    line = PneumaticLine(length_m=0.9, diameter_m=diameter_mm * 1e-3, cavity_m3=cavity_mm3 * 1e-9)
    response = step_response(line, *GROUND_AIR)
    assert response.value[0] == pytest.approx(0.0, abs=1e-6) and response.value[-1] == pytest.approx(1.0, abs=1e-3)
    assert np.trapezoid(1 - response.value, response.t_s) == pytest.approx(time_constant_s(line, *GROUND_AIR), rel=5e-3)


@pytest.mark.parametrize("diameter_mm", [0.3, 0.42])
def test_the_response_is_that_of_bergh_and_tijdeman(diameter_mm: float) -> None:
    """Two independent models: cells with inertia here, Bessel functions of the frequency there."""
    line = PneumaticLine(length_m=0.9, diameter_m=diameter_mm * 1e-3, cavity_m3=20e-9)
    response, gas = step_response(line, *GROUND_AIR), air(*GROUND_AIR)
    expected = 1 - through(line, gas)(low_frequency_lag_s([line], gas))(response.t_s)
    assert np.abs(response.value - expected).max() < 0.03


def test_bursts_on_a_narrow_line_show_the_lag_of_the_simulator() -> None:
    """A lag of 17 ms, sampled at 100 Hz, with the transducer's noise, zero offset and warm-up drift."""
    text = load_aircraft("nexstar").text
    start, end = text.index("[probe.lines.alpha]"), text.index("[probe.lines.beta]")
    narrow = '[probe.lines.alpha]\nlength = "0.9 m"\ndiameter = "0.42 mm"\ncavity = "20 mm^3"\n'
    own_aircraft = as_complete(text[:start] + narrow + text[end:], "mine.toml")
    stand = '[[segment]]\nkind = "stand"\nduration = "3 s"\n'
    flight = fly(own_aircraft, parse_plan(stand + '[[segment]]\nkind = "bursts"\nline = "alpha"\n', "mine"))
    t = np.arange(0.0, flight.duration_s, 0.01)
    pressure = FlightSensorTruth(flight, draw(load_budget("bench"), 0)).differential_pressure_Pa("alpha", t)
    static, temperature = (float(flight.truth[name].mean()) for name in ("static_pressure_Pa", "temperature_K"))
    line = own_aircraft.probe.lines["alpha"]
    true_s = time_constant_s(line, static, temperature)
    assert true_s == pytest.approx(17.5e-3, rel=0.02)
    steps, noise = find_steps(t, pressure)
    assert len(steps) == 8
    lag = fit_lag(steps, noise, through(line, air(static, temperature)))
    assert lag.lo_s < true_s < lag.hi_s < 1.1 * true_s


@pytest.mark.parametrize(
    ("segment", "message"),
    [
        ('kind = "deflect"\nsurface = "elevator"\nangle = ["30 deg"]', "beyond the elevator's travel, -22.0 to 21.0"),
        ('kind = "deflect"\nsurface = "flap"\nangle = ["3 deg"]', "not one of elevator, aileron, rudder"),
        ('kind = "deflect"\nsurface = "rudder"\nangle = []', "give the angles"),
        ('kind = "bursts"\nline = "static"', "not one of alpha, beta, airspeed"),
        ('kind = "bursts"\nline = "alpha"\ncount = 0', "count"),
        ('kind = "run-up"\nthrottle = [0.5, 1.2]', "above 0 and up to 1"),
        ('kind = "turn-by-hand"\nseconds = "5 s"', "seconds"),
    ],
)
def test_what_cannot_be_done_is_refused(nexstar, segment: str, message: str) -> None:
    (bench,) = parse_plan(f"[[segment]]\n{segment}\n", "mine").segments
    with pytest.raises(InputError, match=message):
        bench.check()
        bench.columns(plant_of(nexstar), np.arange(0.0, bench.duration_s, DT))


def test_a_refusal_names_plan_and_segment(nexstar) -> None:
    with pytest.raises(InputError, match=r"^plan mine: segment 1 \(bursts\): line: 'tail' is not one of [^\n]*$"):
        fly(nexstar, parse_plan('[[segment]]\nkind = "bursts"\nline = "tail"\n', "mine"))


def test_it_is_done_on_the_ground(nexstar) -> None:
    with pytest.raises(InputError, match="in the air"):
        fly(
            nexstar,
            parse_plan('[[segment]]\nkind = "hold"\nduration = "1 s"\n[[segment]]\nkind = "turn-by-hand"\n', "x"),
        )
