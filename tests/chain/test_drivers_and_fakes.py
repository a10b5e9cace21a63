"""Each driver against its fake over the physical range: the decoded value is within a count of the simulator's.

Both sides were written from the datasheets, not from one another. The input rises in steps of some seconds and is
compared after it has settled, which leaves only quantization between the two.
"""

import math
import sys
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from flightpower.daq.sensors import honeywell, ms45xxdo, ms56xx
from flightpower.daq.sensors.ak8963 import AK8963Driver
from flightpower.daq.sensors.autopilot import AutopilotDriver
from flightpower.daq.sensors.bridge import BridgeTransducerDriver
from flightpower.daq.sensors.esc_counter import EscCounterDriver
from flightpower.daq.sensors.mpu9250 import MPU9250Driver, Ranges
from flightpower.daq.sensors.ublox import UBloxDriver
from flightpower.daq.sensors.ublox_ddc import DdcPort
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.messages import Status
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.tray import FakeTray, TrayVariant
from flightpower.sim.fly import fly
from flightpower.sim.plan import load_plan
from flightpower.sim.sensors import FlightSensorTruth, draw, load_budget

sys.path.append(str(Path(__file__).parents[1] / "hw_fakes"))
from analytic_sensor_truth import AnalyticSensorTruth, constant, ramp

START_NS = 7_000_000_000
TICK_NS = 40_000_000
G = 9.80665


def staircase(levels, step_s=2.0):
    """A function that gives each of `levels` for `step_s`, and then stays at the last. Levels are numbers or rows."""
    levels = np.asarray(levels, dtype=float)
    return lambda t_s: levels[np.clip((t_s / step_s).astype(int), 0, len(levels) - 1)]


def run(make, sensor_truth, seconds, seed=3, **options):
    """Samples of the driver that `make(tray)` gives, read at 25 Hz, as (time [s], sample)."""
    clock = SimulatedClock(start_ns=START_NS)
    tray = FakeTray(sensor_truth, clock, seed, variant=TrayVariant(**options))
    driver = make(tray)
    for wait_s in driver.start():
        clock.advance_ns(round(wait_s * 1e9))
    samples = []
    for _ in range(round(seconds * 1e9 / TICK_NS)):
        clock.advance_ns(TICK_NS - clock.now_ns() % TICK_NS)
        samples += driver.read(clock.now_ns())
    return [((sample.time_ns - START_NS) * 1e-9, sample) for sample in samples]


def settled(samples, levels, step_s=2.0, after_s=1.0):
    """(level, message) of samples from the later part of each step; every level occurs.

    The last 0.1 s are left out, since a fake barometer's housing changes its temperature on that grid.
    """
    results = [
        (levels[int(t_s / step_s)], sample.message)
        for t_s, sample in samples
        if t_s / step_s < len(levels) and after_s < t_s % step_s < step_s - 0.1 and sample.message.status is Status.OK
    ]
    assert {tuple(np.atleast_1d(level)) for level, _ in results} == {tuple(np.atleast_1d(level)) for level in levels}
    return results


I2C = "/dev/i2c-1"


@pytest.mark.parametrize("range_g", [2, 4, 8, 16])
def test_specific_force(range_g):
    levels = [[f * range_g * G, -f * range_g * G, 0.1 * f] for f in (-0.99, -0.5, -0.1, 0.0, 0.3, 0.7, 0.99)]
    sensor_truth = AnalyticSensorTruth(force_mps2=staircase(levels))
    samples = run(lambda tray: MPU9250Driver(tray.i2c(I2C), ranges=Ranges(g=range_g)), sensor_truth, 14)
    for level, m in settled(samples, levels):
        seen = (m.specific_force_x_mps2, m.specific_force_y_mps2, m.specific_force_z_mps2)
        assert seen == pytest.approx(level, abs=range_g / 32768 * G)


@pytest.mark.parametrize("range_dps", [250, 500, 1000, 2000])
def test_angular_rate(range_dps):
    levels = [np.radians([f * range_dps, -f * range_dps, 3.0 * f]).tolist() for f in (-0.99, -0.5, 0.0, 0.3, 0.99)]
    sensor_truth = AnalyticSensorTruth(rate_radps=staircase(levels))
    samples = run(lambda tray: MPU9250Driver(tray.i2c(I2C), ranges=Ranges(dps=range_dps)), sensor_truth, 10)
    for level, m in settled(samples, levels):
        seen = (m.angular_rate_x_radps, m.angular_rate_y_radps, m.angular_rate_z_radps)
        assert seen == pytest.approx(level, abs=math.radians(range_dps / 32750))


@pytest.mark.parametrize("fifo", [True, False])
def test_the_logged_delay_is_the_one_that_was_made(fifo):
    """On a ramp a wrong delay is an offset. The 200 Hz samples are within 1 % of their rate and at an unknown phase of
    up to 5 ms. The phase is the same for both filters, whose delays differ by 1.9 and 2.2 ms."""
    sensor_truth = AnalyticSensorTruth(
        force_mps2=lambda t: np.outer(t, [1.0, 0.5, -1.0]), rate_radps=lambda t: np.outer(t, [0.1, -0.1, 0.2])
    )
    samples = run(lambda tray: MPU9250Driver(tray.i2c(I2C), fifo=fifo), sensor_truth, 10)
    force_s = [t_s - m.specific_force_group_delay_s - m.specific_force_x_mps2 for t_s, (_, _, m, *_) in samples[5:]]
    rate_s = [t_s - m.group_delay_s - m.angular_rate_x_radps / 0.1 for t_s, (_, _, m, *_) in samples[5:]]
    assert np.mean(np.abs(force_s)) < 5e-3
    assert np.mean(np.abs(rate_s)) < 5e-3
    assert abs(np.mean(force_s) - np.mean(rate_s)) < 0.8e-3


def test_beyond_the_range_is_called_saturated():
    samples = run(
        lambda tray: MPU9250Driver(tray.i2c(I2C), ranges=Ranges(g=2)),
        AnalyticSensorTruth(force_mps2=constant([30.0, 0, 0])),
        1,
    )
    assert {sample.message.status for _, sample in samples[3:]} == {Status.SATURATED}


def test_imu_temperature():
    levels = [250.0, 294.15, 300.0, 358.0]
    samples = run(lambda tray: MPU9250Driver(tray.i2c(I2C)), AnalyticSensorTruth(imu_K=staircase(levels)), 8)
    for level, m in settled(samples, levels):
        assert m.temperature_K == pytest.approx(level, abs=1 / 333.87)


def test_magnetic_field():
    levels = [[20e-6, -3e-6, 45e-6], [-65e-6, 65e-6, -65e-6], [0.0, 0.0, 0.0], [1000e-6, -500e-6, 300e-6]]

    def make(tray):
        imu = MPU9250Driver(tray.i2c(I2C))
        for _ in imu.start():
            tray.i2c(I2C)._pass_time(20_000)  # 0.45 s in all: no driver moves the clock
        return AK8963Driver(tray.i2c(I2C))

    samples = run(make, AnalyticSensorTruth(field_T=staircase(levels)), 9)
    for level, m in settled(samples, levels):
        # The fuse raises a count to at most 1.5 times the nominal one.
        assert (m.field_x_T, m.field_y_T, m.field_z_T) == pytest.approx(level, abs=1.5 * 4912e-6 / 32760)


@pytest.mark.parametrize(("variant", "which"), [(ms56xx.MS5611, 0x77), (ms56xx.MS5805, 0x76)], ids=["5611", "5805"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_barometers_over_pressure_and_temperature(variant, which, seed):
    """A count is about 0.02 Pa; rounding of the temperature moves the pressure by less than another count or two."""
    levels = [(p, T) for T in (233.15, 253.15, 273.15, 293.15, 310.0, 358.15) for p in (30e3, 70e3, 100e3, 110e3)]
    sensor_truth = AnalyticSensorTruth(
        absolute_Pa=staircase([p for p, _ in levels], 3.0), transducer_K=staircase([T for _, T in levels], 3.0)
    )
    samples = run(
        lambda tray: ms56xx.MS56xxDriver(tray.i2c(I2C), which, variant, topic="/baro", period_s=0.04),
        sensor_truth,
        72,
        seed,
    )
    for (pascal, kelvin), m in settled(samples, levels, 3.0, after_s=2.0):
        assert m.pressure_Pa == pytest.approx(pascal, abs=0.1)
        assert m.temperature_K == pytest.approx(kelvin, abs=0.001)


def test_a_barometers_sample_is_dated_at_the_middle_of_its_conversion():
    sensor_truth = AnalyticSensorTruth(absolute_Pa=lambda t: 90e3 + 1000.0 * t)
    samples = run(
        lambda tray: ms56xx.MS56xxDriver(tray.i2c(I2C), 0x77, ms56xx.MS5611, topic="/baro", period_s=0.04),
        sensor_truth,
        9,
    )
    late_s = [t_s - (s.message.pressure_Pa - 90e3) / 1000 for t_s, s in samples if s.message.status is Status.OK]
    # Half the difference between typical and longest conversion, the 1 ms grid, and the transfer that starts it.
    assert np.max(np.abs(late_s)) < 0.41e-3 + 0.5e-3 + 0.1e-3


BRIDGES = [
    ("MS4515DO-DS5AJ002DP", ms45xxdo, 2 * 249.089, "alpha"),
    ("MS4515DO-DS5AK002DP", ms45xxdo, 2 * 249.089, "beta"),
    ("SSCDRRN005ND2A5", honeywell, 5 * 249.089, "airspeed"),
]


@pytest.mark.parametrize(("number", "maker", "top_Pa", "which"), BRIDGES, ids=[b[3] for b in BRIDGES])
def test_pressure_differences(number, maker, top_Pa, which):
    address, transfer = maker.decode_part(number)
    levels = (np.array([-1, -0.9, -0.5, -0.01, 0, 0.01, 0.3, 0.8, 1]) * top_Pa).tolist()
    sensor_truth = AnalyticSensorTruth(differential_Pa=staircase(levels), transducer_K=ramp(250.0, 100 / 18))
    samples = run(
        lambda tray: BridgeTransducerDriver(tray.i2c(I2C), address, transfer, topic=f"/probe/{which}"), sensor_truth, 18
    )
    count_Pa = 2 * top_Pa / (0.8 * 16383)
    for level, m in settled(samples, levels):
        assert m.differential_pressure_Pa == pytest.approx(level, abs=count_Pa)
    for t_s, sample in samples:
        if sample.message.status is Status.OK:  # interpolated over a block of a second by the fake
            assert sample.message.temperature_K == pytest.approx(250 + 100 / 18 * t_s, abs=200 / 2047 + 0.05)


@pytest.mark.parametrize(("number", "maker", "top_Pa", "which"), BRIDGES, ids=[b[3] for b in BRIDGES])
def test_a_pinned_bridge_is_called_saturated(number, maker, top_Pa, which):
    address, transfer = maker.decode_part(number)
    for sign in (-1, 1):
        sensor_truth = AnalyticSensorTruth(differential_Pa=constant(sign * 2 * top_Pa))
        samples = run(
            lambda tray: BridgeTransducerDriver(tray.i2c(I2C), address, transfer, topic=f"/probe/{which}"),
            sensor_truth,
            1,
        )
        assert {sample.message.status for _, sample in samples} == {Status.SATURATED}


@pytest.mark.parametrize("on_i2c", [False, True], ids=["serial", "i2c"])
def test_navigation_solutions(on_i2c):
    sensor_truth = AnalyticSensorTruth(
        latitude_deg=lambda t: 35.6 + 1e-4 * t,
        longitude_deg=lambda t: -78.9 - 1e-4 * t,
        height_m=lambda t: 120 + 3.0 * t,
        velocity_mps=lambda t: np.column_stack([12 + 0.1 * t, -3 - 0.2 * t, 0 * t - 3]),
    )
    start = datetime(2016, 5, 14, 9, 30, tzinfo=UTC)

    def make(tray):
        if on_i2c:
            return UBloxDriver(DdcPort(tray.i2c(I2C)), baud=None)
        return UBloxDriver(tray.port("/dev/ttyAMA0", 38400))

    samples = run(make, sensor_truth, 12, utc_at_start=start, geoid_m=-33.0, gps_on_i2c=on_i2c)
    fixes = [(t_s, s.message) for t_s, s in samples if s.message.status is Status.OK]
    assert len(fixes) >= 90  # ten a second, once it is configured
    for t_s, m in fixes:
        valid_s = m.utc_ns * 1e-9 - start.timestamp()
        # A fix is valid 80 ms before it is sent, is 26 ms on the line (none on I2C), and up to a tick in the buffer.
        assert 0.08 - 1e-6 <= t_s - valid_s <= 0.08 + 0.03 + 0.04 + 1e-6
        assert m.latitude_deg == pytest.approx(35.6 + 1e-4 * valid_s, abs=1e-7)
        assert m.longitude_deg == pytest.approx(-78.9 - 1e-4 * valid_s, abs=1e-7)
        assert m.height_msl_m == pytest.approx(120 + 3.0 * valid_s, abs=1e-3)
        assert m.height_m == pytest.approx(m.height_msl_m - 33.0, abs=1.1e-3)
        assert m.velocity_north_mps == pytest.approx(12 + 0.1 * valid_s, abs=1e-3)
        assert m.velocity_east_mps == pytest.approx(-3 - 0.2 * valid_s, abs=1e-3)
        assert m.velocity_down_mps == pytest.approx(-3, abs=1e-3)
        assert m.horizontal_accuracy_m == pytest.approx(1.5) and m.speed_accuracy_mps == pytest.approx(0.3)


@pytest.mark.parametrize("framed", [False, True])
@pytest.mark.parametrize("pole_pairs", [6, 7])
def test_motor_speed(framed, pole_pairs):
    levels = [20.0, 50.0, 100.0, 170.0]
    sensor_truth = AnalyticSensorTruth(motor_revps=staircase(levels))
    samples = run(
        lambda tray: EscCounterDriver(tray.port("/dev/ttyUSB0", 115200), pole_pairs=pole_pairs, framed=framed),
        sensor_truth, 8, pole_pairs=pole_pairs, rpm_with_crc=framed,
    )  # fmt: skip
    for level, m in settled(samples, levels):
        assert m.motor_speed_revps == pytest.approx(level, rel=0.5 / m.period_us + 1e-6)


def test_the_framed_counter_tells_a_standing_motor_from_silence():
    sensor_truth = AnalyticSensorTruth(motor_revps=constant(0.0))
    for framed, message in ((True, {(Status.OK, 0.0)}), (False, {(Status.NO_DATA, None)})):
        samples = run(
            lambda tray, framed=framed: EscCounterDriver(
                tray.port("/dev/ttyUSB0", 115200), pole_pairs=7, framed=framed
            ),
            sensor_truth, 6, rpm_with_crc=framed,
        )  # fmt: skip
        assert {(s.message.status, s.message.motor_speed_revps) for _, s in samples} == message


def test_what_the_autopilot_tells():
    aircraft = load_aircraft("nexstar")
    angles = [-0.3, -0.1, 0.0, 0.05, 0.2]
    rows = [[1500, aircraft.elevator.pulse_of_angle_us(a), 1300, 1500, 1000, 1000, 1000, 1000] for a in angles]
    sensor_truth = AnalyticSensorTruth(
        pulses_us=staircase(rows), motor_revps=staircase([0.0, 20.0, 60.0, 120.0, 170.0])
    )
    samples = run(
        lambda tray: AutopilotDriver(tray.port("/dev/ttyUSB1", 57600), aircraft=aircraft, rate_Hz=25, rpm=True),
        sensor_truth,
        10,
    )
    by_topic = {t: [(t_s, s) for t_s, s in samples if s.topic == t] for t in {s.topic for _, s in samples}}
    elevator = aircraft.elevator
    per_us = abs((elevator.angle_rad[-1] - elevator.angle_rad[0]) / (elevator.pulse_us[-1] - elevator.pulse_us[0]))
    for angle, m in settled(by_topic["/controls"], angles):
        assert m.elevator_rad == pytest.approx(angle, abs=1.1 * per_us)
        assert m.throttle == pytest.approx(0.3)
    with_sticks = [s.message for _, s in by_topic["/controls"][50:] if s.message.stick_pulse_us]  # asked for at 25 Hz
    assert len(with_sticks) > 0.9 * len(by_topic["/controls"][50:])
    assert all(m.stick_pulse_us[2:] == [1300, 1500, 1000, 1000, 1000, 1000] for m in with_sticks)
    for speed, m in settled(by_topic["/rpm"], [0.0, 20.0, 60.0, 120.0, 170.0]):
        assert m.motor_speed_revps == pytest.approx(speed, rel=1e-6)  # a single-precision number
    _, attitude = by_topic["/attitude"][-1]
    assert (attitude.message.roll_rad, attitude.message.pitch_rad, attitude.message.yaw_rad) == pytest.approx(
        (0.1, 0.05, -2.0), abs=1e-6
    )
    _, battery = by_topic["/battery"][-1]
    assert battery.message.voltage_V == pytest.approx(15.2, abs=4e-3)  # four cells, rounded down to a millivolt
    assert battery.message.current_A == pytest.approx(12.34, abs=5e-3)


@pytest.fixture(scope="module")
def resting(tmp_path_factory):
    """A minute on the ground with the errors of the bench, and their budget's noise."""
    path = tmp_path_factory.mktemp("plan") / "stand.toml"
    path.write_text('title = "stand"\n[[segment]]\nkind = "stand"\nduration = "60 s"\n')
    errors = draw(load_budget("bench"), 0)
    flight = fly(load_aircraft("nexstar"), load_plan(str(path)), seed=0, deviations=errors.deviations)
    return FlightSensorTruth(flight, errors), errors.noise


def left_by(corner_Hz):
    """The share of white noise averaged over a tick that a first-order low-pass leaves (of the standard deviation)."""
    tau_per_tick = 1 / (2 * math.pi * corner_Hz) / (TICK_NS * 1e-9)
    return math.sqrt(1 - tau_per_tick * (1 - math.exp(-1 / tau_per_tick)))


def scatter(values):
    """Standard deviation without slow drift, and four standard errors of it (relative)."""
    return np.diff(values).std() / math.sqrt(2), 4 * math.sqrt(3 / len(values)) / 2


def test_noise_of_a_resting_imu_is_what_the_budget_says_and_its_filter_leaves(resting):
    sensor_truth, noise = resting
    messages = [s.message for _, s in run(lambda tray: MPU9250Driver(tray.i2c(I2C)), sensor_truth, 58)][10:]
    for name, sigma, corner_Hz in (
        ("specific_force", noise.accel_mps2, 41.0),
        ("angular_rate", noise.gyro_radps, 20.0),
    ):
        for axis in "xyz":
            unit = "mps2" if name == "specific_force" else "radps"
            values = np.array([getattr(m, f"{name}_{axis}_{unit}") for m in messages])
            # The plain standard deviation is right here, since neighboring means share what the filter remembers.
            assert values.std() == pytest.approx(sigma * left_by(corner_Hz), rel=4 / math.sqrt(2 * len(values)))


def test_noise_of_resting_pressures_is_what_the_budget_says(resting):
    sensor_truth, noise = resting
    address, transfer = ms45xxdo.decode_part("MS4515DO-DS5AJ002DP")
    samples = run(
        lambda tray: BridgeTransducerDriver(tray.i2c(I2C), address, transfer, topic="/probe/alpha"), sensor_truth, 58
    )
    result, error = scatter([s.message.differential_pressure_Pa for _, s in samples if s.message.status is Status.OK])
    assert result == pytest.approx(noise.alpha_Pa, rel=error)
    for which, variant, place in (("baro", ms56xx.MS5611, 0x77), ("static", ms56xx.MS5805, 0x76)):
        samples = run(
            lambda tray, variant=variant, place=place: ms56xx.MS56xxDriver(
                tray.i2c(I2C), place, variant, topic="/baro", period_s=0.04
            ), sensor_truth, 58,
        )  # fmt: skip
        result, error = scatter([s.message.pressure_Pa for _, s in samples if s.message.status is Status.OK])
        assert result == pytest.approx(getattr(noise, f"{which}_Pa"), rel=error)
